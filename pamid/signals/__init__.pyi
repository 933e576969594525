# Written by python docs/tables.py.

from .log import read_log as read_log
from .log import write_log as write_log
from .mapping import FileConstants as FileConstants
from .mapping import LogMapping as LogMapping
from .mapping import SignalMapping as SignalMapping
from .noise import noise_level as noise_level
from .pieces import read_log_part as read_log_part
from .pieces import read_log_pieces as read_log_pieces
from .plausibility import check_units as check_units
from .rates import differentiate as differentiate
from .rates import tune_cutoff as tune_cutoff
from .resampling import merge_rates as merge_rates
from .resampling import resample as resample
from .splits import LeaveOneKindOut as LeaveOneKindOut
from .splits import LeaveOneMuscleOut as LeaveOneMuscleOut
from .splits import TrajectoryKFold as TrajectoryKFold
from .splits import split_trajectories as split_trajectories
from .state import STATE_SIGNALS as STATE_SIGNALS
from .state import State as State
from .thinning import thin as thin
from .thinning import thinned_rows as thinned_rows
from .units import UNITS as UNITS
from .windowing import windows as windows

__all__ = [
    "STATE_SIGNALS",
    "UNITS",
    "FileConstants",
    "LeaveOneKindOut",
    "LeaveOneMuscleOut",
    "LogMapping",
    "SignalMapping",
    "State",
    "TrajectoryKFold",
    "check_units",
    "differentiate",
    "merge_rates",
    "noise_level",
    "read_log",
    "read_log_part",
    "read_log_pieces",
    "resample",
    "split_trajectories",
    "thin",
    "thinned_rows",
    "tune_cutoff",
    "windows",
    "write_log",
]
