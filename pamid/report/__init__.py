"""A diagnosis for people: its sentences, its pictures, and the page that holds both."""

from .._lazy import attach

_HOME = {
    "Answers": "sentences",
    "GapDisplay": "display",
    "answers": "sentences",
    "report_html": "page",
    "write_report": "page",
}
"""In which module each public name lives."""

__getattr__, __dir__, __all__ = attach(__name__, _HOME)
