"""
Intervals hold only if whole runs are held out
==============================================

How large may the error of a prediction be on an unseen run? The residuals of the fit are too small, especially for a
forest that has nearly memorised its samples, as here. Folds of single samples are no better, since the neighbours of
each held-out sample were in the fit. ``ConformalRegressor`` holds out whole runs, around any regressor. The pictures
show one new run, and the share of samples of 16 new runs that the intervals cover.
"""

import matplotlib.pyplot as plt
import numpy as np
from pamid.estimators import ConformalRegressor
from sklearn.ensemble import ExtraTreesRegressor

from pamid import BenchParameters, simulate
from pamid.bench import sine, triangle, unfold
from pamid.plots.style import BLUE, INK, ORANGE

bench = BenchParameters.for_muscle("B")


def log_of(runs, seed):
    """Return signals, force and run of muscle 1."""
    table = unfold(simulate(bench, runs, effects=["hysteresis"], seed=seed), bench)
    table = table[table["muscle"] == 1].reset_index(drop=True)
    return table[["eps", "P"]], table["F"].to_numpy(), table


X, F, table = log_of([kind(w, a, 300) for kind in (sine, triangle) for w in (3, 5, 9) for a in (8, 11, 14, 17, 20)], 0)
forest = ExtraTreesRegressor(30, min_samples_leaf=2, random_state=0)
fitted = ConformalRegressor(forest, confidence=0.9).fit(X, F, groups=table["run"])

X_new, F_new, new = log_of([kind(w, a, 300) for kind in (sine, triangle) for w in (4, 7) for a in (9, 12, 16, 19)], 1)
P_new = fitted.predict(X_new)
widths = {
    "by the residuals of the fit": (np.quantile(np.abs(F - fitted.predict(X)), 0.9), ORANGE),
    "for a new run": (fitted.half_width_, BLUE),
}

fig, (ax, bars) = plt.subplots(1, 2, figsize=(8.4, 3.4), layout="constrained", width_ratios=[2.4, 1])
one = (new["trajectory"] == new["trajectory"].iloc[-1]).to_numpy()
time = new["time"][one]
for k, (label, (width, colour)) in enumerate(reversed(widths.items())):
    ax.fill_between(
        time,
        P_new[one] - width,
        P_new[one] + width,
        color=colour,
        alpha=0.3,
        linewidth=0,
        label=f"{label}: ±{width:.1f} N",
    )
    held = 100 * np.mean(np.abs(F_new - P_new) <= width)
    bars.bar(1 - k, held, color=colour, alpha=0.6, width=0.6)
    bars.text(1 - k, held + 1, f"{held:.0f} %", ha="center", fontsize=9)
ax.plot(time, F_new[one], color=INK, linewidth=1, label="measured")
ax.set_xlabel("time / s")
ax.set_ylabel("force / N")
ax.set_title("One run that the fit has not seen")
ax.legend(loc="upper right")
bars.axhline(90, color=INK, linewidth=0.8, linestyle=(0, (4, 3)))
bars.set_xticks([0, 1], ["by the\nresiduals", "for a\nnew run"])
bars.set_ylabel("samples within / %")
bars.set_ylim(0, 108)
bars.set_title("16 new runs, 90 % wanted")
plt.show()
