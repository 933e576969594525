"""Weights of the signs: written by ``python benchmarks/withheld --develop --write``, not by hand."""

from __future__ import annotations

ALONE = {
    "constant": 2.09,
    "alike": 0,
    "coloured": -1.21,
    "disagreeing": -0.65,
    "faint": 0,
    "left": -2.97,
    "left_beside": -0.35,
    "left_of_equation": -0.35,
    "left_of_gap": 0,
    "paced": -0.8,
    "predictable": -1.05,
    "uncertain": -0.47,
    "unclosed": 0,
    "undone": 0,
    "uneven": -0.99,
    "elsewhere": -1.77,
}
"""Weights of the signs of a cause outside the library, see `pamid.gap.diagnosis.signs`, for one that explains alone."""
BESIDE = {
    "constant": 2.64,
    "alike": -1.06,
    "coloured": -1.63,
    "disagreeing": 0,
    "faint": -1.63,
    "left": -0.87,
    "left_beside": -3.6,
    "left_of_equation": -0.66,
    "left_of_gap": -1.95,
    "paced": -1.48,
    "predictable": -0.48,
    "uncertain": 0,
    "unclosed": -1.92,
    "undone": -1.86,
    "uneven": -0.6,
    "elsewhere": -1.77,
}
"""The same for causes that explain together."""
TRUSTED = 0.5
"""Probability from which a name is reported: it is then more likely right than not."""
SURE = 0.70
"""Probability from which at most one name in twenty is wrong, where one gap in five has a cause outside the library."""
