"""Diagnose the gap between a simulator and a log: where it lies, which effect causes it, how far it closes."""

from .._lazy import attach, homes

_HOME = homes(
    **{
        "design.next_run": "next_run",
        "diagnosis.findings": "Band Candidate Cause Closure EquationFinding Event NextExperiment ParameterEstimate "
        "Region TrajectoryShare",
        "diagnosis.localise": "state_table",
        "diagnosis.result": "Diagnosis",
        "evaluation": "evaluate evaluate_simulator",
        "instruments": "InstrumentalRefit Instrumented refit_with_instruments",
        "refit": "Refit refit_within_tolerance",
        "several.logs": "diagnose diagnose_simulator",
    }
)
"""In which module each public name lives."""

__getattr__, __dir__, __all__ = attach(__name__, _HOME)
