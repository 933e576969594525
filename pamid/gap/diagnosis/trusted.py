"""What names are trusted by: written by ``python benchmarks/withheld --develop --write``, not by hand."""

from __future__ import annotations

SIGNS = {
    "constant": 3.06,
    "cancelling": -1.54,
    "coloured": -0.94,
    "disagreeing": -1.5,
    "faint": -1.97,
    "given_up": 0,
    "left": -3.4,
    "left_of_gap": -0.62,
    "many": -1.92,
    "paced": -1.3,
    "predictable": -0.3,
    "rivalled": -0.35,
    "uncertain": 0,
    "unclosed": -0.63,
    "uneven": 0,
}
"""Weights of the signs of a cause beyond the library, see `pamid.gap.diagnosis.signs`."""
TRUSTED = 0.5
"""Probability from which a name is said: it is then more likely right than not."""
SURE = 0.75
"""Probability from which at most one name in twenty is wrong, where one gap in five has a cause beyond the library."""
