"""
Where a model is off, not only how much
=======================================

One number does not say why a model is off. The map shows the mean error over the state, on runs that the fit has not
seen; the loops show one such run. A geometry leaves all of the hysteresis: one colour while the muscle shortens, the
other while it lengthens. A hybrid that sees the direction of motion leaves half as much, and nearly all of it in one
corner that its runs hardly reached: the next thing to record. Note the different colour scales.
"""

import matplotlib.pyplot as plt
from pamid.estimators import GeometricForce, RateTransformer, ResidualHybrid

from pamid import BenchParameters, simulate
from pamid.bench import multisine, sine, triangle, unfold
from pamid.plots import LoopDisplay, ResidualMapDisplay

bench = BenchParameters.for_muscle("B")


def log_of(runs, seed):
    """Return signals, force and run of muscle 1."""
    table = unfold(simulate(bench, runs, effects=["hysteresis"], seed=seed), bench)
    table = table[table["muscle"] == 1].reset_index(drop=True)
    X = RateTransformer().fit_transform(table[["trajectory", "time", "eps", "P"]])
    return X[["eps", "deps", "P", "dP"]], table["F"], table["run"]


X, F, _ = log_of([sine(w, a, 800) for w in (3, 6, 10) for a in (8, 16, 20)] + [triangle(4, 18, 1200)], 0)
X_new, F_new, run_new = log_of([multisine(w, 18, 2500, seed=w) for w in (4, 7)] + [triangle(5, 15, 1500)], 1)

models = {
    "Chou and Hannaford": GeometricForce("chou_hannaford", rest_length=0.2, rest_diameter=0.02),
    "with a network for the rest": ResidualHybrid(n_starts=1, random_state=0),
}
fig, axes = plt.subplots(2, 2, figsize=(8.4, 6), layout="constrained")
last = (run_new == run_new.iloc[-1]).to_numpy()
for column, (name, model) in enumerate(models.items()):
    model.fit(X[::4], F[::4])
    ResidualMapDisplay.from_estimator(model, X_new, F_new, over=("eps", "deps")).plot(ax=axes[0, column])
    LoopDisplay.from_estimator(model, X_new[last], F_new[last], groups=run_new[last]).plot(ax=axes[1, column])
    axes[0, column].set_title(name)
plt.show()
