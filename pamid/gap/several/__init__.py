"""Several logs of one bench, one diagnosis: shared causes, nuisances of each log, and what changed between logs."""

from .conditions import Conditions, read_conditions
from .engine import diagnose_logs
from .result import Change, LogFinding

__all__ = ["Change", "Conditions", "LogFinding", "diagnose_logs", "read_conditions"]
