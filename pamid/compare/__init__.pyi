# Written by python docs/tables.py.

from .comparison import Comparison as Comparison
from .entries import CandidateModel as CandidateModel
from .entries import candidates as candidates
from .protocol import Prepared as Prepared
from .protocol import prepare as prepare
from .run import compare as compare
from .whiteness import ResidualTest as ResidualTest
from .whiteness import residual_test as residual_test

__all__ = [
    "CandidateModel",
    "Comparison",
    "Prepared",
    "ResidualTest",
    "candidates",
    "compare",
    "prepare",
    "residual_test",
]
