"""What is in a log: columns, sampling, faults, excitation; what can be identified from it, and what to record next."""

from .._lazy import attach

_HOME = {
    "Survey": "survey",
    "Channel": "channels",
    "Sampling": "sampling",
    "Coverage": "coverage",
    "Answerable": "answerable",
    "Separation": "separation",
}

__getattr__, __dir__, __all__ = attach(__name__, _HOME)
