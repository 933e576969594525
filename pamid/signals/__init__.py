"""Signals: reading logs into tidy frames in SI, rates, resampling, windows and splits by trajectory.

Everything is imported when it is first used, so that ``import pamid.signals`` stays light. No public name is also the
name of a module here: the module, once imported, would hide it.
"""

from __future__ import annotations

import importlib
from typing import Any

_HOME = {
    "read_log": "log",
    "read_log_pieces": "pieces",
    "write_log": "log",
    "find_logs": "log",
    "LogMapping": "mapping",
    "SignalMapping": "mapping",
    "FileConstants": "mapping",
    "UNITS": "units",
    "parse_quantity": "units",
    "implausible_units": "plausibility",
    "check_units": "plausibility",
    "differentiate": "rates",
    "tune_cutoff": "rates",
    "noise_level": "noise",
    "quantisation_step": "noise",
    "resample": "resampling",
    "merge_rates": "resampling",
    "thin": "thinning",
    "thinned_rows": "thinning",
    "windows": "windowing",
    "TrajectoryKFold": "splits",
    "LeaveOneKindOut": "splits",
    "LeaveOneMuscleOut": "splits",
    "kind_of": "splits",
    "split_trajectories": "splits",
    "State": "state",
    "STATE_SIGNALS": "state",
}
"""In which module each public name lives."""

__all__ = sorted(_HOME)


def __getattr__(name: str) -> Any:
    if name in _HOME:
        return getattr(importlib.import_module(f"{__name__}.{_HOME[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *_HOME})
