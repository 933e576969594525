# Written by python docs/tables.py.

from .comparison import Comparison as Comparison
from .entries import Candidate as Candidate
from .entries import candidates as candidates
from .protocol import Prepared as Prepared
from .protocol import prepare as prepare
from .run import compare as compare

__all__ = [
    "Candidate",
    "Comparison",
    "Prepared",
    "candidates",
    "compare",
    "prepare",
]
