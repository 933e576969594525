"""
A cause is named, and the map turns white
=========================================

The log is from a bench with Coulomb friction, which the simulator lacks. The maps show the mean of measured minus
modelled force over the state: without friction in the simulator the colours differ between the two directions of
motion, and with the named cause added both maps are white.
"""

from textwrap import fill

from pamid import BenchParameters, simulate
from pamid.bench import multisine, step, triangle
from pamid.gap import diagnose
from pamid.report import GapDisplay, answers

simulator = BenchParameters.for_muscle("B")
runs = [multisine(w, 20, 2500, seed=w) for w in (5, 8, 12)] + [triangle(4, 20, 1600), step(0, 12, 1000)]
log = simulate(simulator, runs, effects=[("coulomb_friction", {"amplitude": 6.0})], seed=0)

found = diagnose(log, simulator)
for sentence in answers(found):
    print(fill(sentence, 96))
display = GapDisplay.from_diagnosis(found).plot("map", x="eps", y="deps")

# %%
# How sure is that? Every effect of the library is in the ranking, with the reason why it was ruled out.

ranking = GapDisplay.from_diagnosis(found).plot("ranking")
