"""Diagnose the gap between a simulator and a log: where it lies, which effect causes it, how far it closes."""

from .diagnosis import (
    Band,
    Candidate,
    Cause,
    Closure,
    Diagnosis,
    EquationFinding,
    NextExperiment,
    ParameterEstimate,
    Region,
    TrajectoryShare,
)
from .engine import diagnose
from .where import state_table

__all__ = [
    "Band",
    "Candidate",
    "Cause",
    "Closure",
    "Diagnosis",
    "EquationFinding",
    "NextExperiment",
    "ParameterEstimate",
    "Region",
    "TrajectoryShare",
    "diagnose",
    "state_table",
]
