"""Every number that the diagnosis decides by, what it means, and the command that measured it."""

from __future__ import annotations

# --- which sets of effects are looked at ------------------------------------------------------------------------
MOST_CAUSES = 6
"""Most effects of one answer."""
BEAM = 4
"""Sets of effects that are followed at each size."""
BRANCHES = 8
"""Effects that are tried on top of each of them."""
REFITS = 5
"""Sets of effects, and alternatives to each cause, that are refitted exactly."""
CLOSE = 12.0, 0.08
"""How far below the best a set may score to first order and still be refitted: nats, and share of the best's gain."""

# --- how inexact the forms of effects are -----------------------------------------------------------------------
FORM_LOCAL = 0.015
"""Standard deviation of an effect's form, as a share of what it adds in a window."""
FORM_TIMES = 0.0, 1.0, 3.0
"""How many times that and the next two a log may speak for: not at all, as usual, a rough form."""
FORM_SMOOTH = 0.3
"""The same where it goes smoothly with the state."""
FORM_EXACT = 0.003
"""The same for faults of sensors and wrong parameters, whose forms are known."""
FORM_ELSEWHERE = 0.01
"""What an effect may add in windows and equations of which the library's form says nothing, as a share of its size."""

OF_ITS_OWN = 0.05
"""Size of a further effect, and of what it explains, from which it is one of its own: a share of those beside which it
acts, whose inexact forms could call for it."""

# --- priors -----------------------------------------------------------------------------------------------------
TOLERANCE = 3.0
"""Precision of a parameter within its tolerance, that of a uniform distribution."""
ONE_MORE = 10.0
"""Evidence, in nats, that a further effect needs beyond its price: there are many of them to choose from."""

# --- what no effect explains ------------------------------------------------------------------------------------
COSINES = 40
"""Random cosines of each of two widths in a function of no particular form."""

# --- how much is looked at --------------------------------------------------------------------------------------
MAX_ROWS = 160_000
"""Most rows that a diagnosis looks at; longer logs are thinned to whole trajectories."""
SEARCH_ROWS = 40_000
"""Most rows in which causes are searched; what is found is fitted to all."""

# --- decisions --------------------------------------------------------------------------------------------------
FALSE_ALARM = 0.01
"""Probability at which the evidence of an effect or of an excess counts as a gap."""
EXCESS = 0.08
"""Share by which a residual must be above its noise to be a gap by itself, since noise is known to a few per cent."""
CLASS, CLASS_SHARE = 2.0, 0.004
"""Difference in score that the form of a candidate is worth: nats, and share of the gain."""
DECIDED = 20.0
"""Difference in score, in nats, beyond which a rival is out of the question: no further run is about it."""

# --- what a name must show --------------------------------------------------------------------------------------
SIGNS = {"constant": 2.5, "left": -3.8, "cancelling": -4.2, "faint": -1.5}
"""Weights of the signs of a cause beyond the library, by logistic regression on the development cases of
``benchmarks/withheld`` (seed 9001, every second single and pair, all off-library)."""
TRUSTED = 0.5
"""Probability above which a name is said."""
NOTICED = 1.1, 1.06
"""Scales of an equation's residual, in noise, from which what was there and what is left count as signs."""
HALF = 12.0
"""How sharply belief falls where named causes of a measured system close half of its gap."""
