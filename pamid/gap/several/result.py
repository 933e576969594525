"""Additional results of several logs: each log's own parameters, and what changed."""

from dataclasses import dataclass

from ..diagnosis.findings import ParameterEstimate


@dataclass(frozen=True)
class LogFinding:
    """One of several logs.

    Parameters
    ----------
    log : str
        Its name.
    day : str
        Logs of one day share what may change from day to day.
    rows, trajectories : int
        Its size.
    conditions : dict of str to float
        Numbers of the simulator that hold for this log alone.
    parameters : dict of str to dict of str to ParameterEstimate
        For each cause that acts in it the parameters fitted to this log alone.
    deviations : dict of str to float
        How far its parameters with a tolerance were refitted, in tolerances.

    Examples
    --------
    >>> from pamid.gap.several.result import LogFinding
    >>> LogFinding("monday", "monday", rows=8000, trajectories=4, conditions={}, parameters={}, deviations={}).rows
    8000
    """

    log: str
    day: str
    rows: int
    trajectories: int
    conditions: dict[str, float]
    parameters: dict[str, dict[str, ParameterEstimate]]
    deviations: dict[str, float]


@dataclass(frozen=True)
class Change:
    """A cause that differs between logs.

    Parameters
    ----------
    effect : str
        The cause.
    how : str
        ``"appears"``, ``"goes"``, ``"grows"`` or ``"shrinks"``; ``"differs"`` where no single parameter says how.
    log : str
        The log from which it differs.
    before, after : float
        Its main parameter before and after; NaN where it does not act.
    parameter, unit : str
        That parameter and its unit.
    evidence : float
        Logarithm of the likelihood ratio to a cause that does not change.
    where : str
        The port at which it acts, of a simulator with ports.

    Examples
    --------
    >>> from pamid.gap.several.result import Change
    >>> c = Change("leakage", "appears", "friday", float("nan"), 2e-10, "conductance", "m^3/(s Pa)", evidence=300.0)
    >>> f"{c.effect} {c.how} with {c.log}"
    'leakage appears with friday'
    """

    effect: str
    how: str
    log: str
    before: float
    after: float
    parameter: str
    unit: str
    evidence: float
    where: str = ""
