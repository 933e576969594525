"""Estimators of one equation compared on unseen runs."""

from __future__ import annotations

from .._lazy import attach, renamed

_HOME = {
    "compare": "run",
    "Comparison": "comparison",
    "CandidateModel": "entries",
    "candidates": "entries",
    "Prepared": "protocol",
    "prepare": "protocol",
    "ResidualTest": "whiteness",
    "residual_test": "whiteness",
}
"""In which module each public name lives."""

_lookup, __dir__, __all__ = attach(__name__, _HOME)
__getattr__ = renamed(__name__, {"Candidate": "CandidateModel"}, _lookup)
