# Written by python docs/tables.py.

from .display import GapDisplay as GapDisplay
from .page import report_html as report_html
from .page import write_report as write_report
from .sentences import Answers as Answers
from .sentences import answers as answers

__all__ = [
    "Answers",
    "GapDisplay",
    "answers",
    "report_html",
    "write_report",
]
