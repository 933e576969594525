"""Diagnose the gap between a simulator and a log: where it lies, which effect causes it, how far it closes."""

from .design.next_run import next_run
from .diagnosis.findings import (
    Band,
    Candidate,
    Cause,
    Closure,
    EquationFinding,
    Event,
    NextExperiment,
    ParameterEstimate,
    Region,
    TrajectoryShare,
)
from .diagnosis.localise import state_table
from .diagnosis.result import Diagnosis
from .evaluation import evaluate
from .instruments import InstrumentalRefit, Instrumented, refit_with_instruments
from .refit import Refit, refit_within_tolerance
from .several.logs import diagnose

diagnose_simulator, evaluate_simulator = diagnose, evaluate

__all__ = [
    "Band",
    "Candidate",
    "Cause",
    "Closure",
    "Diagnosis",
    "EquationFinding",
    "Event",
    "InstrumentalRefit",
    "Instrumented",
    "NextExperiment",
    "ParameterEstimate",
    "Refit",
    "Region",
    "TrajectoryShare",
    "diagnose",
    "diagnose_simulator",
    "evaluate",
    "evaluate_simulator",
    "next_run",
    "refit_with_instruments",
    "refit_within_tolerance",
    "state_table",
]
