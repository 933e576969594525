r"""
The volume is found only if pressure and contraction vary separately
====================================================================

A hybrid model learns the gas volume from the flow alone, through the first law
:math:`\dot m = \frac{\dot P V}{\gamma R T} + \frac{P \dot V}{R T}`. On the simulated bench the true volume is known.
On the left the log contains only sines: pressure and contraction move together, and many volumes give the same flow.
On the right some runs hold the joint or one pressure constant; now the two terms of the law are separated, and the
volume is found.
"""

import matplotlib.pyplot as plt
import numpy as np
from pamid.estimators import RateTransformer, ThermodynamicPIHM

from pamid import BenchParameters, simulate
from pamid.bench import isobaric, isometric, sine, unfold
from pamid.plots import VolumeDisplay

bench = BenchParameters.for_muscle("B")
sines = [sine(w, a, 500) for w in (2, 4, 10) for a in (10, 15, 20)]
held = [isobaric(4, 15, 600), isobaric(8, 15, 600), *(isometric(q, 9e4, 600) for q in (-15, -5, 5, 15))]

fig, axes = plt.subplots(1, 2, figsize=(8.2, 3.8), sharey=True, layout="constrained")
for ax, runs, title in zip(axes, (sines, sines + held), ("sines alone", "with signals held"), strict=True):
    table = unfold(simulate(bench, runs, seed=0), bench)
    X = RateTransformer().fit_transform(table[["trajectory", "time", "eps", "P"]])
    X, mdot = X[["eps", "deps", "P", "dP"]][::4], table["mdot"][::4]
    model = ThermodynamicPIHM(
        rest_length=0.2, rest_diameter=0.02, hidden_layer_sizes=(16,), max_iter=20, random_state=0
    ).fit(X, mdot)
    display = VolumeDisplay.from_estimator(model, X).plot(ax=ax)
    truth = bench.plant().volume(display.eps)
    ax.plot(100 * display.eps, 1e6 * truth, color="#222222", linestyle=(0, (4, 3)), label="true volume")
    covered = (display.eps >= display.covered[1, 0]) & (display.eps <= display.covered[1, 1])
    error = np.abs(display.V[1] / truth - 1)[covered].max()
    ax.set_title(f"{title}: within {100 * error:.1f} % at {display.pressures[1] / 1e5:.1f} bar")
    ax.legend(loc="lower right")
    ax.set_ylim(45, 150)
axes[1].set_ylabel("")
plt.show()
