r"""
A muscle's force map, and where its data end
============================================

The first picture to draw of a muscle: how strongly it pulls at each contraction and pressure. A geometric model is
identified from a log and evaluated at rest,
:math:`F = \frac{P - P_\mathrm{atm}}{L_0}\,\frac{\partial V}{\partial\varepsilon}`. The dots are the samples of the
fit: on an antagonistic joint, pressure and contraction rise together. Away from the dots the colours come from the
geometry alone.
"""

import matplotlib.pyplot as plt
from pamid.estimators import GeometricForce

from pamid import BenchParameters, simulate
from pamid.bench import training_trajectories, unfold
from pamid.plots import ForceMapDisplay

bench = BenchParameters.for_muscle("B")  # 0.2 m long, 0.02 m wide
table = unfold(simulate(bench, training_trajectories(1500), seed=0), bench)
X, F = table[["eps", "P"]], table["F"]

model = GeometricForce("chou_hannaford", rest_length=0.2, rest_diameter=0.02).fit(X, F)
for name, value in model.parameters_.items():
    print(f"{name} = {value:.5g} ± {model.standard_errors_.get(name, 0.0):.1g}")

fig, ax = plt.subplots(figsize=(6.4, 4), layout="constrained")
display = ForceMapDisplay.from_estimator(model, X).plot(ax=ax)
ax.scatter(100 * X["eps"], (X["P"] - 101_325) / 1e5, s=3, color="white", alpha=0.5)
ax.set_title("Force at rest of muscle B; white: the samples of the fit")
plt.show()
