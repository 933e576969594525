"""All numbers that the diagnosis decides by, and what follows from them.

Each is a judgement of how exact models of pneumatic muscles are, or of how much is searched; ``python
benchmarks/settings.py`` halves and doubles each and prints what that changes. The weights behind trust in names are
fitted, in `pamid.gap.diagnosis.trusted`. The accuracy of computations (rounds of a solver, draws, frequencies) is set
where they are.
"""

from __future__ import annotations

from math import log

# --- how much is searched ----------------------------------------------------------------------------------------
MAX_ROWS = 160_000
"""Most rows that a diagnosis looks at; longer logs are thinned to whole runs."""
SEARCH_ROWS = 40_000
"""Most rows in which causes are searched; what is found is fitted to all."""
MOST_CAUSES = 6
"""Most effects of one answer."""
KEPT = 5
"""Sets of effects that are followed at each size, and that are refitted exactly."""
CLOSE, CLOSE_SHARE = 12.0, 0.08
"""How far below the best a set may score to first order and still be refitted: nats, and share of the best's gain."""
GRID = 0.3
"""Share of what an effect explains that a point of its grid explains at least: ``python benchmarks/grids.py``."""

# --- how inexact noise and forms are ----------------------------------------------------------------------------
NU = 5.0
"""Degrees of freedom of Student's t: tails heavy enough for windows in which a model of first order fails."""
NOISE_KNOWN = 0.04
"""How well the noise of an equation is known from its own signals, as a share."""
FORM_LOCAL = 0.015
"""Standard deviation of an effect's form, as a share of what it adds in a window."""
FORM_SMOOTH = 0.3
"""The same where it goes smoothly with the state."""
FORM_ROUGH = 3.0
"""How many times that a rough form may be, if the log speaks for it."""
FORM_ELSEWHERE = 0.01
"""What an effect may add in windows and equations of which the library's form says nothing, as a share of its size."""
OF_ITS_OWN = 0.05
"""Size of a further effect, and of what it explains, from which it is one of its own: a share of those beside which it
acts, whose inexact forms could call for it; and how near to one of two forms a share between them is expected."""

# --- what is reported -------------------------------------------------------------------------------------------
FALSE_ALARM = 0.01
"""Probability at which the evidence of an effect or of an excess counts as a gap."""
OTHER_SYSTEMS = 10.0
"""Evidence, in nats, that an effect of other systems needs beyond its price."""
INCLUDED = 0.95
"""Posterior probability of a cause, or of a class, from which it is said beside others: one in twenty is wrong."""
CLASS, CLASS_SHARE = 2.0, 0.004
"""Difference in score that the form of a candidate is worth: nats, and share of the gain."""
MATERIAL = 0.1
"""Share, of a gap or of what is predictable or could be learned, from which it is worth a word; it affects no name."""
FAR, FEW = 8.0, 4
"""Residuals beyond so many of their noise, in so many windows, are a gap by themselves."""

# --- what follows -----------------------------------------------------------------------------------------------
TOLERANCE = 12.0 / (1.0 + 1.0) ** 2
"""Precision of a parameter within its tolerance: that of a uniform distribution from −1 to 1."""
FORM_EXACT = FORM_LOCAL / 5.0
"""The inexactness of faults of sensors and wrong parameters, whose forms are known."""
FORM_TIMES = 0.0, 1.0, FORM_ROUGH
"""Multiples of the inexactness of forms that a log may support: none, the usual, a rough form."""
CERTAIN = log(INCLUDED / (1.0 - INCLUDED))
"""The same as the logarithm of odds."""
NONE_SURE = 1.0 - FALSE_ALARM
"""Confidence in no gap where there is no sign of one; half where evidence is only just missing."""
LEAST_GAIN = -log(2.0 * FALSE_ALARM)
"""Gain in log-likelihood that a first effect must bring at least: that of a false alarm, there being two tests."""
EXCESS = 2.0 * NOISE_KNOWN
"""Excess of a residual over its noise, as a share, that is a gap, or a sign, by itself."""
DECIDED = 2.0 * OTHER_SYSTEMS
"""Difference in score, in nats, beyond which a rival is ruled out: no further run is designed for it."""
