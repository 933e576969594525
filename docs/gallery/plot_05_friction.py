"""
Six kinds of friction have six shapes
=====================================

These six effects all widen the loop of force over contraction. Each acts alone on the simulated bench, under a slow
and a fast sine. The picture shows what each effect adds to the force: dry friction jumps at the reversal and does not
depend on speed, viscous friction grows with it, Bouc–Wen hysteresis turns gradually, creep depends on elapsed time. A
diagnosis distinguishes them by these shapes, and can do so only as far as the log shows them.
"""

import matplotlib.pyplot as plt
import numpy as np

from pamid import BenchParameters
from pamid.effects import Signals, make_effect
from pamid.plots.style import BLUE, ORANGE

plant = BenchParameters.for_muscle("B").plant()
names = (
    "coulomb_friction",
    "stribeck_friction",
    "viscous_friction",
    "load_dependent_friction",
    "hysteresis",
    "creep",
)
dt = 1e-3
fig, axes = plt.subplots(2, 3, figsize=(8, 4.8), sharex=True, layout="constrained")
for ax, name in zip(axes.flat, names, strict=True):
    for frequency, colour in ((0.25, BLUE), (1.0, ORANGE)):
        w = 2 * np.pi * frequency
        t = np.arange(0, 2 / frequency, dt)
        s = Signals(
            position=0.12 + 0.06 * np.sin(w * t), velocity=0.06 * w * np.cos(w * t), pressure=3e5 + 1e5 * np.sin(w * t)
        )
        effect = make_effect(name)
        x = effect.trace(s, plant, dt, np.array([0]))
        added = effect.force(s, x, plant)
        last = slice(t.size // 2, None)
        ax.plot(100 * s.position[last], added[last], color=colour, label=f"{frequency:g} Hz")
    ax.set_title(name.replace("_", " "))
for ax in axes[-1]:
    ax.set_xlabel("contraction / %")
for ax in axes[:, 0]:
    ax.set_ylabel("added force / N")
axes[0, 0].legend(loc="center")
plt.show()
