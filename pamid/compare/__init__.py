"""Estimators of one equation held against each other on trajectories that they have not seen."""

from __future__ import annotations

from .._lazy import attach

_HOME = {
    "compare": "run",
    "Comparison": "comparison",
    "Candidate": "entries",
    "candidates": "entries",
    "Prepared": "protocol",
    "prepare": "protocol",
    "ResidualTest": "whiteness",
    "residual_test": "whiteness",
}
"""In which module each public name lives."""

__getattr__, __dir__, __all__ = attach(__name__, _HOME)
