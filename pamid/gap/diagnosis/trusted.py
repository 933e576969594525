"""What names are trusted by: written by ``python benchmarks/withheld --develop --write``, not by hand."""

from __future__ import annotations

SIGNS = {
    "constant": 3.53,
    "cancelling": -2.16,
    "coloured": -1.01,
    "disagreeing": -1.78,
    "faint": -2.51,
    "given_up": -1.33,
    "left": -2.86,
    "left_of_gap": -1.66,
    "many": -2.51,
    "paced": -1.49,
    "predictable": -1.59,
    "rivalled": -1.45,
    "uncertain": 0,
    "unclosed": -0.25,
    "uneven": -0.05,
}
"""Weights of the signs of a cause beyond the library, see `pamid.gap.diagnosis.signs`."""
TRUSTED = 0.5
"""Probability from which a name is said: it is then more likely right than not."""
SURE = 0.59
"""Probability from which at most one name in twenty is wrong, where one gap in five has a cause beyond the library."""
