"""
No effect fits: the answer is unknown
=====================================

The load cells show an additional ripple over the contraction, which no effect in the library for a bench describes.
The honest answer is ``unknown``: nothing is added to the simulator, but the map still shows where to look, and the
remainder shows what the gap depends on.
"""

from textwrap import fill

import numpy as np

from pamid import BenchParameters, simulate
from pamid.bench import contraction, multisine, step, triangle
from pamid.gap import diagnose
from pamid.report import GapDisplay, answers

simulator = BenchParameters.for_muscle("B")
runs = [multisine(w, 20, 2500, seed=w) for w in (5, 8, 12)] + [triangle(4, 20, 1600), step(0, 12, 1000)]
log = simulate(simulator, runs, seed=0)
log = simulate(
    simulator, [multisine(w, 20, 2500, seed=w) for w in (5, 8, 12)] + [triangle(4, 20, 1600), step(0, 12, 1000)], seed=0
)
for muscle in (1, 2):
    eps = contraction(log["q"], muscle, simulator)
    log[f"F{muscle}"] += 4 * np.sin(90 * eps)

found = diagnose(log, simulator)
for sentence in answers(found):
    print(fill(sentence, 96))
print({k: found.leftover[k] for k in ("depends_on", "predictable_share", "formula")})
display = GapDisplay.from_diagnosis(found).plot("map", x="eps", y="deps")
