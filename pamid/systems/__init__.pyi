# Written by python docs/tables.py.

from .base import Input as Input
from .base import Quantity as Quantity
from .base import System as System
from .comparison import compare_system as compare_system
from .draft import draft_for as draft_for
from .file import kind_of_file as kind_of_file
from .file import read_system as read_system
from .file import system_text as system_text
from .registry import all_systems as all_systems

__all__ = [
    "Input",
    "Quantity",
    "System",
    "all_systems",
    "compare_system",
    "draft_for",
    "kind_of_file",
    "read_system",
    "system_text",
]
