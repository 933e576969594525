"""
Diagnose, design a run, record it, diagnose again
=================================================

Slow sines leave a class: a dead volume, another exponent of the gas and a warmer gas explain them equally well. The
next run is designed so that these explanations, each refitted, differ most; it is recorded, and the diagnosis
continues. The left picture shows the confidences after each log, the right one the designed run.
"""

import matplotlib.pyplot as plt
import numpy as np

from pamid import BenchParameters, simulate
from pamid.bench import sine, triangle
from pamid.gap.design.family import Limits
from pamid.gap.design.search import plan_next
from pamid.gap.several.go_on import go_on
from pamid.gap.several.history import History
from pamid.plots.style import BLUE, GREY, ORANGE, SKY

bench = BenchParameters.for_muscle("B")
cause = [("dead_volume", {})]
library = ["dead_volume", "polytropic_exponent", "gas_temperature", "leakage"]

history = History(bench, library)
found = go_on(history, {"first": simulate(bench, [sine(1, 10, 1800), triangle(1.5, 8, 1800)], effects=cause, seed=0)})
plan = plan_next(found.rivals, history.logs, bench, Limits(seconds=2.0), designs=40)
found = go_on(history, {"designed": simulate(bench, plan.trajectories(), effects=cause, seed=1)})

fig, (left, right) = plt.subplots(1, 2, figsize=(8.6, 3.4), layout="constrained")
seconds = [r.seconds for r in found.rounds]
for name, colour in zip(library, (BLUE, ORANGE, SKY, GREY), strict=True):
    left.plot(seconds, [100 * r.confidences.get(name, 0) for r in found.rounds], "o-", color=colour, label=name)
left.set(xlabel="time recorded / s", ylabel="confidence / %", ylim=(-4, 104))
left.legend(fontsize=8)
points = plan.set_points()
right.plot(points["time"], np.degrees(points["q_ref"]), color=BLUE)
right.set(xlabel="time / s", ylabel="reference angle / deg")
pressure = right.twinx()
pressure.plot(points["time"], points["p_offset"] / 1e5, color=ORANGE)
pressure.set_ylabel("added to both pressures / bar")
right.set_title(plan.runs[0].kind + f", {min(e.nats for e in plan.expected):.0f} nats expected", fontsize=9)
plt.show()
