"""Signals: reading logs into tidy frames in SI, rates, resampling, windows and splits by run.

Everything is imported when it is first used, so that ``import pamid.signals`` stays light. No public name is also the
name of a module here: the module, once imported, would hide it.
"""

from __future__ import annotations

from .._lazy import attach

_HOME = {
    "read_log": "log",
    "read_log_pieces": "pieces",
    "read_log_part": "pieces",
    "write_log": "log",
    "LogMapping": "mapping",
    "SignalMapping": "mapping",
    "FileConstants": "mapping",
    "UNITS": "units",
    "check_units": "plausibility",
    "differentiate": "rates",
    "tune_cutoff": "rates",
    "noise_level": "noise",
    "resample": "resampling",
    "merge_rates": "resampling",
    "thin": "thinning",
    "thinned_rows": "thinning",
    "windows": "windowing",
    "TrajectoryKFold": "splits",
    "LeaveOneKindOut": "splits",
    "LeaveOneMuscleOut": "splits",
    "split_trajectories": "splits",
    "State": "state",
    "STATE_SIGNALS": "state",
}
"""In which module each public name lives."""

__getattr__, __dir__, __all__ = attach(__name__, _HOME)
