"""All thresholds of the diagnosis, and those that follow from them.

Each states how exact models of pneumatic muscles are, or how much is searched; ``python benchmarks/settings.py`` halves
and doubles each and prints what changes. The weights behind the confidence in names are fitted, in
`pamid.gap.diagnosis.trusted`. Numerical accuracy (rounds of a solver, draws, frequencies) is set where it is used.
"""

from math import log

# --- how much is searched ----------------------------------------------------------------------------------------
MAX_ROWS = 160_000
"""Maximum rows of a diagnosis; longer logs are thinned to whole runs."""
SEARCH_ROWS = 40_000
"""Maximum rows in which causes are searched; the result is fitted to all."""
MOST_CAUSES = 6
"""Maximum effects in one answer."""
KEPT = 5
"""Sets of effects kept at each size, and refitted exactly."""
CLOSE, CLOSE_SHARE = 12.0, 0.08
"""Largest first-order deficit at which a set is still refitted: nats, and share of the best set's gain."""
FEWEST = 12
"""Windows below which a part of a log is too short to say what acts in it, or repeats."""
GRID = 0.3
"""Smallest share of an effect's gain that a point of its grid explains: ``python benchmarks/grids.py``."""

# --- how inexact noise and forms are ----------------------------------------------------------------------------
NU = 5.0
"""Degrees of freedom of Student's t: heavy enough tails for windows in which the linearisation fails."""
NOISE_KNOWN = 0.04
"""Relative uncertainty of an equation's noise, as estimated from its own signals."""
FORM_LOCAL = 0.015
"""Standard deviation of the error of an effect's form, relative to its contribution in a window."""
FORM_SMOOTH = 0.3
"""The same for the part that is smooth in the state."""
FORM_ROUGH = 3.0
"""Factor on it for a rough form, if the log supports one."""
FORM_ELSEWHERE = 0.01
"""Possible contribution in windows and equations where the library's form has none, relative to the effect's size."""
OF_ITS_OWN = 0.05
"""Smallest size of a further effect, and of what it explains, relative to the effects beside it: a smaller one may
compensate for their inexact forms. Also how near to one of two forms a share between them is expected."""

# --- what is reported -------------------------------------------------------------------------------------------
FALSE_ALARM = 0.01
"""Probability below which an effect or an excess residual counts as a gap."""
OTHER_SYSTEMS = 10.0
"""Additional evidence, in nats, that an effect of other kinds of systems needs."""
INCLUDED = 0.95
"""Smallest posterior probability at which a cause or a class is named beside others: one in twenty is wrong."""
CLASS, CLASS_SHARE = 2.0, 0.004
"""Score difference that an inexact form can explain: nats, and share of the gain."""
MATERIAL = 0.1
"""Smallest share of a gap, or of what is predictable in it, that a report mentions, and of an input's deviation that
drives a system rather than being noise of its sensor; it affects no name."""
FAR, FEW = 8.0, 4
"""Residuals beyond this multiple of their noise, in this many windows, are a gap by themselves."""

# --- derived -----------------------------------------------------------------------------------------------
TOLERANCE = 12.0 / (1.0 + 1.0) ** 2
"""Precision of a parameter within its tolerance: that of a uniform distribution from −1 to 1."""
FORM_EXACT = FORM_LOCAL / 5.0
"""The same for sensor faults and wrong parameters, whose forms are known."""
FORM_TIMES = 0.0, 1.0, FORM_ROUGH
"""Multiples of the inexactness that a log may support: exact, usual, rough."""
CERTAIN = log(INCLUDED / (1.0 - INCLUDED))
"""`INCLUDED` as log odds."""
NONE_SURE = 1.0 - FALSE_ALARM
"""Confidence in "no gap" without any sign of one; it falls to one half where the evidence just fails the test."""
LEAST_GAIN = -log(2.0 * FALSE_ALARM)
"""Smallest gain in log-likelihood of a first effect: that of a false alarm, with two tests."""
EXCESS = 2.0 * NOISE_KNOWN
"""Relative excess of a residual over its noise that is a gap, or a sign, by itself."""
DECIDED = 2.0 * OTHER_SYSTEMS
"""Score difference, in nats, beyond which a candidate is ruled out: no further run is designed for it."""
