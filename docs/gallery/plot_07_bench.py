"""
What a bench records in one run
===============================

Two muscles pull at a joint against each other, each behind its own valve. The joint follows a sine, then a step;
below are the pressures that this takes, the flow into each muscle, and their forces. Everything is as the sensors of
the bench would show it, including noise and quantisation.
"""

import matplotlib.pyplot as plt
import numpy as np

from pamid import BenchParameters, simulate
from pamid.bench import sine, step
from pamid.plots.style import BLUE, GREY, ORANGE

bench = BenchParameters.for_muscle("B")
log = simulate(bench, [sine(6, 15, samples=1400), step(-10, 12, samples=1400)], effects=["hysteresis"], seed=0)

fig, axes = plt.subplots(4, 2, figsize=(8, 7.2), sharex="col", sharey="row", layout="constrained")
for column, (name, run) in enumerate(log.groupby("trajectory", sort=False)):
    t = run["time"]
    angle, pressure, flow, force = axes[:, column]
    angle.plot(t, np.degrees(run["q_ref"]), color=GREY, linestyle=(0, (4, 3)), label="wanted")
    angle.plot(t, np.degrees(run["q"]), color=BLUE, label="measured")
    angle.set_title(name)
    for muscle, colour in ((1, BLUE), (2, ORANGE)):
        pressure.plot(t, run[f"P{muscle}"] / 1e5, color=colour, label=f"muscle {muscle}")
        flow.plot(t, 1e3 * run[f"mdot{muscle}"], color=colour, linewidth=0.8)
        force.plot(t, run[f"F{muscle}"], color=colour)
    force.set_xlabel("time / s")
labels = ("joint angle / °", "pressure / bar,\nabsolute", "flow / (g/s)", "force / N")
for ax, label in zip(axes[:, 0], labels, strict=True):
    ax.set_ylabel(label)
axes[0, 1].legend(loc="lower right")
axes[1, 1].legend(loc="center right")
fig.align_ylabels()
plt.show()
