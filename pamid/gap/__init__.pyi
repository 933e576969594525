# Written by python docs/tables.py.

from .design.next_run import next_run as next_run
from .diagnosis.findings import Band as Band
from .diagnosis.findings import Candidate as Candidate
from .diagnosis.findings import Cause as Cause
from .diagnosis.findings import Closure as Closure
from .diagnosis.findings import EquationFinding as EquationFinding
from .diagnosis.findings import Event as Event
from .diagnosis.findings import NextExperiment as NextExperiment
from .diagnosis.findings import ParameterEstimate as ParameterEstimate
from .diagnosis.findings import Region as Region
from .diagnosis.findings import TrajectoryShare as TrajectoryShare
from .diagnosis.localise import state_table as state_table
from .diagnosis.result import Diagnosis as Diagnosis
from .evaluation import evaluate as evaluate
from .evaluation import evaluate_simulator as evaluate_simulator
from .instruments import InstrumentalRefit as InstrumentalRefit
from .instruments import Instrumented as Instrumented
from .instruments import refit_with_instruments as refit_with_instruments
from .refit import Refit as Refit
from .refit import refit_within_tolerance as refit_within_tolerance
from .several.logs import diagnose as diagnose
from .several.logs import diagnose_simulator as diagnose_simulator

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
