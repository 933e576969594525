"""
Which pressure gives this force at this contraction?
====================================================

A controller needs the reverse of a force model: the pressure that produces a desired force and contraction. The
inverse model learns it from lifts of four loads and answers for loads that it has not seen. Lifting and lowering
differ by the hysteresis of the braid, so the model also uses the last direction of motion.
"""

import matplotlib.pyplot as plt
import numpy as np
from pamid.estimators import InverseModel

from pamid.bench.single import LiftSettings, simulate_lift
from pamid.plots.style import FAINT

settings = LiftSettings(frequency=0.1)
log = simulate_lift(loads=[15, 40, 70, 100], every=20, settings=settings)
inverse = InverseModel(direction=True, random_state=0).fit(log[["trajectory", "F", "eps"]], log["P"])

unseen = simulate_lift(loads=[25, 55, 85], every=20, settings=settings, seed=1)
P = inverse.predict(unseen[["trajectory", "F", "eps"]])

fig, ax = plt.subplots(figsize=(6.4, 4), layout="constrained")
for k, (load, run) in enumerate(unseen.groupby("load")):
    colour = plt.colormaps["viridis"](0.15 + 0.3 * k)
    ax.plot(100 * run["eps"], run["P"] / 1e5, color=FAINT, linewidth=5, zorder=1)
    rows = unseen.index.get_indexer(run.index)
    error = np.abs(P[rows] - run["P"]).max() / 1e3
    ax.plot(100 * run["eps"], P[rows] / 1e5, color=colour, label=f"{load:g} kg: within {error:.0f} kPa")
ax.plot([], [], color=FAINT, linewidth=5, label="the pressure that it took")
ax.set_xlabel("contraction / %")
ax.set_ylabel("pressure / bar, absolute")
ax.set_title("Pressure for a force and a contraction, under loads not in the fit")
ax.legend()
plt.show()
