"""What names are trusted by: written by ``python benchmarks/withheld --develop --write``, not by hand."""

from __future__ import annotations

SIGNS = {
    "constant": 3.7,
    "cancelling": -1.9,
    "coloured": -0.91,
    "disagreeing": -1.98,
    "faint": -1.42,
    "given_up": -1.26,
    "left": -3.17,
    "left_of_gap": -1.77,
    "many": -1.48,
    "paced": -1.69,
    "predictable": -1.38,
    "rivalled": -1.29,
    "uncertain": 0,
    "unclosed": -0.35,
    "uneven": 0,
}
"""Weights of the signs of a cause beyond the library, see `pamid.gap.diagnosis.signs`."""
TRUSTED = 0.5
"""Probability from which a name is said: it is then more likely right than not."""
SURE = 0.87
"""Probability from which at most one name in twenty is wrong, where one gap in five has a cause beyond the library."""
