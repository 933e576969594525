"""
How far from the data a volume is known
=======================================

The colours show the gas volume that a hybrid model has learnt from the flow, over contraction and pressure. The lines
show its uncertainty: the spread among fits to other draws of runs. Pale regions had no samples nearby. Runs that hold
the joint or one pressure widen the region in which the volume is known.
"""

import matplotlib.pyplot as plt
from pamid.estimators import RateTransformer, ThermodynamicPIHM

from pamid import BenchParameters, simulate
from pamid.bench import isobaric, isometric, sine, unfold
from pamid.plots import VolumeSurfaceDisplay

bench = BenchParameters.for_muscle("B")
runs = [sine(w, a, 400) for w in (4, 10) for a in (10, 20)]
runs += [isobaric(4, 15, 500), isobaric(8, 15, 500), *(isometric(q, 9e4, 500) for q in (-15, -5, 5, 15))]
table = unfold(simulate(bench, runs, seed=0), bench)
X = RateTransformer().fit_transform(table[["trajectory", "time", "eps", "P"]])
rows = slice(None, None, 6)
X, mdot, run = X[["eps", "deps", "P", "dP"]][rows], table["mdot"][rows], table["run"][rows]

model = ThermodynamicPIHM(rest_length=0.2, rest_diameter=0.02, hidden_layer_sizes=(12,), max_iter=12, random_state=0)
fig, ax = plt.subplots(figsize=(6.6, 4.2), layout="constrained")
VolumeSurfaceDisplay.from_estimator(model, X, mdot, groups=run, n_refits=4, random_state=0).plot(ax=ax)
ax.set_title("Gas volume of muscle B, learnt from its flow")
plt.show()
