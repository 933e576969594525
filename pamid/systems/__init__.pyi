# Written by python docs/tables.py.

from .base import Input as Input
from .base import Quantity as Quantity
from .base import System as System
from .comparison import compare_system as compare_system
from .file import read_system as read_system
from .registry import all_systems as all_systems

__all__ = [
    "Input",
    "Quantity",
    "System",
    "all_systems",
    "compare_system",
    "read_system",
]
