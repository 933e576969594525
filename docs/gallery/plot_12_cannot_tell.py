"""
Two causes look alike until the right run is recorded
=====================================================

Fittings and tube hold gas that the simulator does not include: a dead volume. Under sines of one kind, warmer gas
would leave nearly the same trace in the flow, so the diagnosis reports both as a class, and proposes the run that
would decide between them. With that run in the log, the same command names one cause: the right one.
"""

from textwrap import fill

import matplotlib.pyplot as plt

from pamid import BenchParameters, simulate
from pamid.bench import isobaric, sine
from pamid.gap import diagnose
from pamid.plots.style import BLUE, FAINT
from pamid.report import answers

simulator = BenchParameters.for_muscle("B")
truth = [("dead_volume", {"volume": 1e-5})]
sines = [sine(4, 15, 2000), sine(6, 10, 2000)]

fig, axes = plt.subplots(1, 2, figsize=(8, 2.8), sharey=True, layout="constrained")
for ax, runs, title in zip(
    axes, (sines, [*sines, isobaric(4, 10, 2000)]), ("two sines", "and a run at one pressure"), strict=True
):
    found = diagnose(simulate(simulator, runs, effects=truth, seed=0), simulator)
    print(fill(f"{title}: {answers(found).verdict}. {answers(found).which}", 96), "\n")
    if found.next_run is not None:
        print(fill(f"next: {found.next_run.trajectory}: {found.next_run.reason}", 96), "\n")
    named = found.causes[0].effects
    shown = {c.effect: 100 * c.confidence for c in found.candidates}
    words = ("dead_volume", "gas_temperature", "polytropic_exponent", "heat_transfer", "unknown")
    bars = ax.barh(
        [w.replace("_", " ") for w in words],
        [shown[w] for w in words],
        color=[BLUE if w in named else FAINT for w in words],
    )
    ax.bar_label(bars, fmt="%.0f", padding=3, fontsize=8)
    ax.set_xlim(0, 110)
    ax.set_xlabel("confidence / %")
    ax.set_title(f"{title}: {'one cause' if len(named) == 1 else 'one of a class'}")
axes[0].invert_yaxis()
plt.show()
