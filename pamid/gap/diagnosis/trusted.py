"""What names are trusted by: written by ``python benchmarks/withheld --develop --write``, not by hand."""

from __future__ import annotations

SIGNS = {
    "constant": 4.07,
    "cancelling": -1.91,
    "coloured": -1.58,
    "disagreeing": -0.91,
    "faint": -1.51,
    "left": -2.31,
    "left_of_gap": -1.21,
    "many": -1.43,
    "predictable": -2.13,
    "rivalled": -1.6,
    "uncertain": 0,
    "unclosed": -1.04,
    "uneven": 0,
}
"""Weights of the signs of a cause beyond the library, see `pamid.gap.diagnosis.signs`."""
TRUSTED = 0.5
"""Probability from which a name is said: it is then more likely right than not."""
SURE = 0.70
"""Probability from which at most one name in twenty is wrong, where one gap in five has a cause beyond the library."""
