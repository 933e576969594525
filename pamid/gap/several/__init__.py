"""Several logs of one bench, one diagnosis: shared causes, nuisances of each log, and what changed between logs."""

from .conditions import Conditions, read_conditions
from .go_on import go_on
from .history import History, read_history
from .logs import diagnose as diagnose_logs
from .result import Change, LogFinding

__all__ = ["Change", "Conditions", "History", "LogFinding", "diagnose_logs", "go_on", "read_conditions", "read_history"]
