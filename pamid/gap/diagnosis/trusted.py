"""What names are trusted by: written by ``python benchmarks/withheld --develop --write``, not by hand."""

from __future__ import annotations

SIGNS = {
    "constant": 3.57,
    "cancelling": -1.89,
    "coloured": -1.14,
    "disagreeing": -2,
    "faint": -1.26,
    "given_up": -1.23,
    "left": -3.15,
    "left_of_gap": -1.77,
    "many": -1.26,
    "paced": -1.64,
    "predictable": -1.16,
    "rivalled": -1.4,
    "uncertain": 0,
    "unclosed": -0.16,
    "uneven": 0,
}
"""Weights of the signs of a cause beyond the library, see `pamid.gap.diagnosis.signs`."""
TRUSTED = 0.5
"""Probability from which a name is said: it is then more likely right than not."""
SURE = 0.65
"""Probability from which at most one name in twenty is wrong, where one gap in five has a cause beyond the library."""
