"""Signals: reading logs into tidy frames in SI, rates, resampling, windows and splits by run.

Everything is imported when it is first used, so that ``import pamid.signals`` stays light. No public name is also the
name of a module here: the module, once imported, would hide it.
"""

from .._lazy import attach, homes

_HOME = homes(
    log="read_log write_log",
    pieces="read_log_pieces read_log_part",
    mapping="LogMapping SignalMapping FileConstants",
    units="UNITS",
    plausibility="check_units",
    rates="differentiate tune_cutoff",
    noise="noise_level",
    resampling="resample merge_rates",
    thinning="thin thinned_rows",
    windowing="windows",
    splits="TrajectoryKFold LeaveOneKindOut LeaveOneMuscleOut split_trajectories",
    state="State STATE_SIGNALS",
)
"""In which module each public name lives."""

__getattr__, __dir__, __all__ = attach(__name__, _HOME)
