"""
Five force models on runs they have not seen
============================================

Five force models are fitted to some runs of a muscle with hysteresis and scored on the others. The bars are 90 %
intervals over runs; the dashed line is what the sensors' noise alone would leave.
"""

import matplotlib.pyplot as plt

from pamid import BenchParameters, simulate
from pamid.bench import training_trajectories, unfold
from pamid.compare import compare
from pamid.plots.style import BLUE, GREY

bench = BenchParameters.for_muscle("B")
table = unfold(simulate(bench, training_trajectories(8000), effects=["hysteresis"], seed=0), bench)
names = [
    "GeometricForce(tondu_lopez)",
    "NonlinearElastic",
    "HosovskyHybrid",
    "PolynomialForce(surface)",
    "ResidualHybrid",
]
result = compare(table, "force", names, cv=3, fit_rows=1500, score_rows=6000, parameters=bench.values())
print(result)

scores = result.to_frame()
scores = scores[scores["estimator"].isin(names)].iloc[::-1]
fig, ax = plt.subplots(figsize=(6.8, 3), layout="constrained")
low, high = scores["rmse"] - scores["rmse_low"], scores["rmse_high"] - scores["rmse"]
ax.errorbar(
    scores["rmse"], scores["estimator"], xerr=[low, high], fmt="o", color=BLUE, ecolor=BLUE, elinewidth=3, alpha=0.9
)
ax.set_xlabel("held-out error of the force / N")
ax.set_xlim(left=0)
ax.axvline(result.noise_floor, color=GREY, linestyle=(0, (4, 3)), linewidth=1)
ax.set_title("Root mean square error on unseen runs, with 90 % intervals")
plt.show()
