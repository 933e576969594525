"""
Rates: three methods, tuned by the signal itself
================================================

Rates are not measured but estimated, and they dominate the error of a flow model. The picture compares three methods,
each tuned by the signal itself, on a triangle of pressure with the noise of a typical sensor. A sharp corner and a
smooth slope need opposite settings, and the methods reach nearly the same compromise; the differences between
neighbouring samples, in grey, show the noise that they suppress.
"""

import matplotlib.pyplot as plt
import numpy as np

from pamid.plots.style import BLUE, FAINT, GREEN, INK, ORANGE
from pamid.signals import differentiate

rng = np.random.default_rng(0)
t = np.arange(0, 2, 1e-3)  # s
true = 2e5 * (2 * np.abs((t * 1.25) % 1 - 0.5))  # Pa
rate = np.where(t * 1.25 % 1 < 0.5, -5e5, 5e5)
noisy = true + 60 * rng.standard_normal(t.size)

fig, axes = plt.subplot_mosaic(
    [["signal", "signal"], ["whole", "corner"]], figsize=(8, 5.2), layout="constrained", height_ratios=[1, 2]
)
axes["signal"].plot(t, noisy / 1e3, color=BLUE, linewidth=1)
axes["signal"].set_xlabel("time / s")
axes["signal"].set_ylabel("pressure / kPa")
axes["signal"].set_title("What is measured: a triangle of pressure with noise of 60 Pa")
for name in ("whole", "corner"):
    axes[name].plot(t[1:], np.diff(noisy) / 1e-3 / 1e6, color=FAINT, linewidth=0.5, label="differences of samples")
    axes[name].plot(t, rate / 1e6, color=INK, linewidth=1, linestyle=(0, (4, 3)), label="true rate")
    axes[name].set_xlabel("time / s")
for method, colour in (("savgol", BLUE), ("spline", ORANGE), ("kalman", GREEN)):
    found = differentiate(noisy, t, method=method)[1]
    error = np.sqrt(np.mean((found - rate) ** 2)) / 1e6
    axes["corner"].plot(t, found / 1e6, color=colour, linewidth=1.5, label=f"{method}, {1e3 * error:.0f} kPa/s off")
axes["corner"].set_xlim(0.38, 0.42)
axes["corner"].set_title("All three round the corner alike")
axes["corner"].legend(loc="upper left", fontsize=7)
axes["whole"].set_ylabel("rate of pressure / (MPa/s)")
axes["whole"].set_title("Its rate")
for name in ("whole", "corner"):
    axes[name].set_ylim(-0.85, 1.25)
plt.show()
