"""A second opinion on parameters that any tool fitted: what absorbed missing physics, what this log cannot tell."""

from .._lazy import attach

_HOME = {
    "FittedParameters": "fits",
    "Judgement": "judge",
    "Opinion": "judge",
    "Passport": "passport",
    "read_fit": "fits",
    "second_opinion": "judge",
}
"""In which file each public name lives."""

__getattr__, __dir__, _names = attach(__name__, _HOME)
__all__ = sorted(_HOME)
