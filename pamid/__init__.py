"""pamid: system identification of pneumatic artificial muscles.

The names below are the usual way in; each is imported when it is first used, so that ``import pamid`` stays quick and
loads none of numpy, pandas, scikit-learn or torch. Estimators are in `pamid.estimators`.
"""

from ._checkout import find_estimators
from ._lazy import attach, homes

find_estimators()

__version__ = "0.1.0"

_HOME = homes(
    bench="BenchParameters dataset simulate",
    any_simulator="diagnose read_simulator",
    gap="evaluate next_run",
    equations="evaluate_log",
    persistence="inspect load save",
    signals="read_log write_log",
    opinion="second_opinion",
)
"""In which room each public name lives."""

_ROOMS = (
    "bench", "compare", "effects", "equations", "errors", "estimators", "gap", "laws", "opinion", "persistence",
    "plots", "report", "signals", "training", "volume",
)  # fmt: skip
"""Rooms that ``import pamid`` alone makes reachable, such as ``pamid.estimators``."""

__getattr__, __dir__, _names = attach(__name__, {**_HOME, **{room: room for room in _ROOMS}})
__all__ = ["__version__", *sorted(_HOME)]
