"""Weights of the signs: written by ``python benchmarks/withheld --develop --write``, not by hand."""

ALONE = {
    "constant": 2.1,
    "alike": 0,
    "coloured": -1.72,
    "disagreeing": -0.53,
    "faint": -0.36,
    "left": -2.23,
    "left_beside": -0.32,
    "left_of_equation": -0.32,
    "left_of_gap": -0.04,
    "paced": -0.27,
    "predictable": -0.63,
    "uncertain": -0.19,
    "unclosed": 0,
    "unclosed_of_gap": -0.13,
    "undone": 0,
    "uneven": -0.37,
    "unsupported": -0.09,
    "elsewhere": -1.21,
}
"""Weights of the signs of a cause outside the library, see `pamid.gap.diagnosis.signs`, for one that explains alone."""
BESIDE = {
    "constant": 2.79,
    "alike": -0.69,
    "coloured": -0.59,
    "disagreeing": -0.37,
    "faint": -0.96,
    "left": -0.75,
    "left_beside": -2.53,
    "left_of_equation": -0.42,
    "left_of_gap": -1.28,
    "paced": -0.44,
    "predictable": -0.9,
    "uncertain": -0.96,
    "unclosed": -1.93,
    "unclosed_of_gap": -1.51,
    "undone": -1.78,
    "uneven": -1.03,
    "unsupported": -1.2,
    "elsewhere": -1.21,
}
"""The same for causes that explain together."""
TRUSTED = 0.5
"""Estimated probability from which a name is reported."""
SURE = 0.74
"""Probability from which at most one name in twenty is wrong, where one gap in five has a cause outside the library."""
