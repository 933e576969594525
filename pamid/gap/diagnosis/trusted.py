"""What names are trusted by: written by ``python benchmarks/withheld --develop --write``, not by hand."""

from __future__ import annotations

SIGNS = {
    "constant": 3.07,
    "cancelling": -1.56,
    "coloured": -0.89,
    "disagreeing": -1.47,
    "faint": -1.93,
    "left": -3.37,
    "left_of_gap": -0.62,
    "many": -1.91,
    "paced": -1.23,
    "predictable": -0.27,
    "rivalled": -0.33,
    "split": -0.94,
    "uncertain": 0,
    "unclosed": -0.64,
    "uneven": 0,
}
"""Weights of the signs of a cause beyond the library, see `pamid.gap.diagnosis.signs`."""
TRUSTED = 0.5
"""Probability from which a name is said: it is then more likely right than not."""
SURE = 0.76
"""Probability from which at most one name in twenty is wrong, where one gap in five has a cause beyond the library."""
