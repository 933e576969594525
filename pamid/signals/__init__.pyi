# Written by python docs/tables.py.

from .log import find_logs as find_logs
from .log import read_log as read_log
from .log import write_log as write_log
from .mapping import FileConstants as FileConstants
from .mapping import LogMapping as LogMapping
from .mapping import SignalMapping as SignalMapping
from .noise import noise_level as noise_level
from .noise import quantisation_step as quantisation_step
from .pieces import read_log_part as read_log_part
from .pieces import read_log_pieces as read_log_pieces
from .plausibility import check_units as check_units
from .plausibility import implausible_units as implausible_units
from .rates import differentiate as differentiate
from .rates import tune_cutoff as tune_cutoff
from .resampling import merge_rates as merge_rates
from .resampling import resample as resample
from .splits import LeaveOneKindOut as LeaveOneKindOut
from .splits import LeaveOneMuscleOut as LeaveOneMuscleOut
from .splits import TrajectoryKFold as TrajectoryKFold
from .splits import kind_of as kind_of
from .splits import split_trajectories as split_trajectories
from .state import STATE_SIGNALS as STATE_SIGNALS
from .state import State as State
from .thinning import thin as thin
from .thinning import thinned_rows as thinned_rows
from .thinning import whole_trajectories as whole_trajectories
from .unit_names import parse_quantity as parse_quantity
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
    "find_logs",
    "implausible_units",
    "kind_of",
    "merge_rates",
    "noise_level",
    "parse_quantity",
    "quantisation_step",
    "read_log",
    "read_log_part",
    "read_log_pieces",
    "resample",
    "split_trajectories",
    "thin",
    "thinned_rows",
    "tune_cutoff",
    "whole_trajectories",
    "windows",
    "write_log",
]
