# Written by python docs/tables.py.

from .fits import FittedParameters as FittedParameters
from .fits import read_fit as read_fit
from .judge import Judgement as Judgement
from .judge import Opinion as Opinion
from .judge import second_opinion as second_opinion
from .passport import Passport as Passport

__all__ = [
    "FittedParameters",
    "Judgement",
    "Opinion",
    "Passport",
    "read_fit",
    "second_opinion",
]
