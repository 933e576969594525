"""
One sine covers a line; several runs cover the state
====================================================

A model knows the states that its log has visited, and a diagnosis can only name what the runs excite. One slow sine
follows a line through the state; several frequencies and amplitudes fill it; runs with one pressure held, with the
joint held or with the valves shut reach states that motion alone never reaches. Each dot is one sample of muscle 1.
"""

import matplotlib.pyplot as plt
from pamid.estimators import RateTransformer

from pamid import BenchParameters, simulate
from pamid.bench import isobaric, isometric, multisine, sealed_hold, sine, step, triangle, unfold
from pamid.plots.style import BLUE, GREEN, ORANGE, PURPLE

bench = BenchParameters.for_muscle("B")
sets = {
    "one slow sine": {"sine": [sine(2, 15, 3000)]},
    "several motions": {
        "sine": [sine(w, a, 900) for w in (2, 5, 10) for a in (8, 20)],
        "triangle and step": [triangle(3, 20, 1500), step(-15, 15, 1200)],
    },
    "and one signal held": {
        "sine": [multisine(6, 18, 2000)],
        "pressure held": [isobaric(3, 15, 1500), isobaric(6, 20, 1000)],
        "joint held": [isometric(q, 9e4, 1000, frequency=2) for q in (-16, -8, 0, 8, 16)],
        "valves shut": [sealed_hold(q, 1200) for q in (-12, 12)],
    },
}
colours = {
    "sine": BLUE,
    "triangle and step": ORANGE,
    "pressure held": ORANGE,
    "joint held": GREEN,
    "valves shut": PURPLE,
}

fig, axes = plt.subplots(2, 3, figsize=(8.4, 5), sharex="row", sharey="row", layout="constrained")
for column, (title, kinds) in enumerate(sets.items()):
    for kind, runs in kinds.items():
        table = unfold(simulate(bench, runs, seed=0), bench)
        table = table[table["muscle"] == 1]
        X = RateTransformer().fit_transform(table[["trajectory", "time", "eps", "P"]])[::5]
        axes[0, column].scatter(100 * X["eps"], X["P"] / 1e5, s=2, color=colours[kind], label=kind)
        axes[1, column].scatter(100 * X["deps"], X["dP"] / 1e6, s=2, color=colours[kind])
    axes[0, column].set_title(title)
    axes[0, column].set_ylim(2.2, 4.4)
    axes[1, column].set_xlim(-100, 100)
    axes[0, column].legend(loc="upper left", markerscale=3, fontsize=7)
    axes[0, column].set_xlabel("contraction / %")
    axes[1, column].set_xlabel("rate of contraction / (%/s)")
    axes[1, column].set_ylim(-1, 1)
axes[0, 0].set_ylabel("pressure / bar, absolute")
axes[1, 0].set_ylabel("rate of pressure / (MPa/s)")
plt.show()
