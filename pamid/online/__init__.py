"""Models that follow a stream: recursive estimates, drift alarms, and a monitor that names what appears."""

from .alarm import DriftAlarm, threshold
from .change import ChangeMonitor
from .memory import StreamedEffect
from .monitor import Finding, GapMonitor
from .recursive import RecursiveEstimate

__all__ = ["ChangeMonitor", "DriftAlarm", "Finding", "GapMonitor", "RecursiveEstimate", "StreamedEffect", "threshold"]
