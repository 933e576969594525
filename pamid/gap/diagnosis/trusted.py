"""What names are trusted by: written by ``python benchmarks/withheld --develop --write``, not by hand."""

from __future__ import annotations

SIGNS = {
    "constant": 3.13,
    "alike": -3.2,
    "coloured": -2.32,
    "disagreeing": -1.05,
    "faint": -1.32,
    "left": -2.11,
    "left_beside": -3.77,
    "left_of_equation": -0.16,
    "left_of_gap": -0.41,
    "paced": -2.17,
    "predictable": -1.31,
    "uncertain": -0.34,
    "unclosed": -0.7,
    "undone": -1.5,
    "uneven": -0.66,
}
"""Weights of the signs of a cause beyond the library, see `pamid.gap.diagnosis.signs`."""
TRUSTED = 0.5
"""Probability from which a name is said: it is then more likely right than not."""
SURE = 0.80
"""Probability from which at most one name in twenty is wrong, where one gap in five has a cause beyond the library."""
