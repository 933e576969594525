"""pamid: system identification of pneumatic artificial muscles.

The names below are the usual way in; each is imported when it is first used, so that ``import pamid`` stays quick and
loads none of numpy, pandas, scikit-learn or torch. Estimators are in `pamid.estimators`.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .bench import BenchParameters, dataset, simulate
    from .equations import evaluate_log
    from .persistence import inspect, load, save
    from .signals.log import read_log, write_log

__version__ = "0.1.0"

_HOME = {
    "BenchParameters": "bench",
    "dataset": "bench",
    "evaluate_log": "equations",
    "inspect": "persistence",
    "load": "persistence",
    "read_log": "signals",
    "save": "persistence",
    "simulate": "bench",
    "write_log": "signals",
}
"""In which room each public name lives."""

_ROOMS = (
    "bench", "compare", "effects", "equations", "errors", "estimators", "gap", "laws", "persistence", "plots",
    "report", "signals", "training", "volume",
)  # fmt: skip
"""Rooms that ``import pamid`` alone makes reachable, such as ``pamid.estimators``."""

__all__ = [
    "BenchParameters",
    "__version__",
    "dataset",
    "evaluate_log",
    "inspect",
    "load",
    "read_log",
    "save",
    "simulate",
    "write_log",
]


def __getattr__(name: str) -> Any:
    if name in _HOME:
        return getattr(importlib.import_module(f"{__name__}.{_HOME[name]}"), name)
    if name in _ROOMS:
        return importlib.import_module(f"{__name__}.{name}")
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *_HOME, *_ROOMS})
