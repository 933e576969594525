"""
A model of another muscle from a few dozen samples
==================================================

A model of muscle A, trained on plenty of data, becomes a model of muscle B, which is twice as wide. ``QAdapter``
keeps what both share and learns a factor on the volume; the same network, trained from scratch, must learn everything
again. The dashed line is the model of B on all its data.
"""

import warnings

import matplotlib.pyplot as plt
import numpy as np
from pamid.estimators import QAdapter, RateTransformer, ThermodynamicPIHM
from sklearn.frozen import FrozenEstimator

from pamid import BenchParameters, simulate
from pamid.bench import sine, unfold
from pamid.errors import ExtrapolationWarning
from pamid.plots.style import BLUE, GREY, ORANGE

warnings.simplefilter("ignore", ExtrapolationWarning)  # the unseen run moves faster than any of the fit
runs = [sine(f, a, 400, phase=a) for f in (4, 10) for a in (10, 15, 20)]


def log_of(muscle, runs, seed):
    """Return signals and flow of muscle 1."""
    bench = BenchParameters.for_muscle(muscle)
    table = unfold(simulate(bench, runs, seed=seed), bench)
    table = table[table["muscle"] == 1].reset_index(drop=True)
    X = RateTransformer().fit_transform(table[["trajectory", "time", "eps", "P"]])
    return X[["eps", "deps", "P", "dP"]], table["mdot"]


settings = {"rest_length": 0.2, "hidden_layer_sizes": (16,), "max_iter": 25, "random_state": 0}
source = ThermodynamicPIHM(rest_diameter=0.01, **settings).fit(*log_of("A", runs, 0))
X, mdot = log_of("B", runs, 1)
X_new, mdot_new = log_of("B", [sine(7, 12, 900)], 2)


def error(model):
    """Return the root mean square error on an unseen run, mg/s."""
    return 1e6 * np.sqrt(np.mean((model.predict(X_new) - mdot_new) ** 2))


counts = (6, 12, 24, 48, 96, 192)
adapted, scratch = [], []
for n in counts:
    rows = np.linspace(0, len(X) - 1, n).astype(int)
    few, y = X.iloc[rows], mdot.iloc[rows]
    adapter = QAdapter(FrozenEstimator(source), rest_length=0.2, rest_diameter=0.02, random_state=0)
    adapted.append(error(adapter.fit(few, y)))
    scratch.append(
        error(ThermodynamicPIHM(rest_diameter=0.02, volume_model="neural", **settings).fit(few, y)) if n > 6 else np.nan
    )
best = error(ThermodynamicPIHM(rest_diameter=0.02, **settings).fit(X, mdot))

fig, ax = plt.subplots(figsize=(6.4, 3.8), layout="constrained")
ax.loglog(counts, scratch, "o-", color=ORANGE, label="the network from scratch")
ax.loglog(counts, adapted, "o-", color=BLUE, label="QAdapter from muscle A")
ax.axhline(best, color=GREY, linestyle=(0, (4, 3)), linewidth=1, label=f"all {len(X)} samples")
ax.set_xticks(counts, [str(n) for n in counts])
ax.set_yticks([3, 4, 5, 6], ["3", "4", "5", "6"])
ax.set_ylim(2.8, 5.8)
ax.minorticks_off()
ax.set_xlabel("samples of muscle B / –")
ax.set_ylabel("error of the flow on an unseen run / (mg/s)")
ax.set_title("The source knows the shape, the samples tell the size")
ax.legend()
plt.show()
