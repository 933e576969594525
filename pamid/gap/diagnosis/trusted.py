"""What names are trusted by: written by ``python benchmarks/withheld --develop --write``, not by hand."""

from __future__ import annotations

SIGNS = {
    "constant": 2.39,
    "alike": 0,
    "coloured": -1.45,
    "disagreeing": 0,
    "faint": -1.48,
    "left": -1.8,
    "left_beside": -2.72,
    "left_of_equation": 0,
    "left_of_gap": 0,
    "paced": -2.05,
    "predictable": -0.65,
    "uncertain": 0,
    "unclosed": -0.85,
    "undone": -1.86,
    "uneven": -0.77,
    "unexplained": -0.64,
}
"""Weights of the signs of a cause beyond the library, see `pamid.gap.diagnosis.signs`."""
TRUSTED = 0.5
"""Probability from which a name is said: it is then more likely right than not."""
SURE = 0.81
"""Probability from which at most one name in twenty is wrong, where one gap in five has a cause beyond the library."""
