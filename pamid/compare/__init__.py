"""Estimators of one equation compared on unseen runs."""

from .._lazy import attach, homes, renamed

_HOME = homes(
    run="compare",
    comparison="Comparison",
    entries="CandidateModel candidates",
    protocol="Prepared prepare",
    whiteness="ResidualTest residual_test",
)
"""In which module each public name lives."""

_lookup, __dir__, __all__ = attach(__name__, _HOME)
__getattr__ = renamed(__name__, {"Candidate": "CandidateModel"}, _lookup)
