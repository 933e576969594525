# Written by python docs/tables.py.

from .answerable import Answerable as Answerable
from .channels import Channel as Channel
from .coverage import Coverage as Coverage
from .sampling import Sampling as Sampling
from .separation import Separation as Separation
from .survey import Survey as Survey

__all__ = [
    "Answerable",
    "Channel",
    "Coverage",
    "Sampling",
    "Separation",
    "Survey",
]
