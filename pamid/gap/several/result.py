"""Additional results of several logs: each log's own parameters, and what changed."""

from dataclasses import dataclass
from typing import Annotated

from ...explained import explained_fields
from ..diagnosis.findings import ParameterEstimate


@explained_fields
@dataclass(frozen=True)
class LogFinding:
    """One of several logs.

    Examples
    --------
    >>> from pamid.gap.several.result import LogFinding
    >>> LogFinding("monday", "monday", rows=8000, trajectories=4, conditions={}, parameters={}, deviations={}).rows
    8000
    """

    log: Annotated[str, "Its name."]
    day: Annotated[str, "Logs of one day share what may change from day to day."]
    rows: Annotated[int, "Its size."]
    trajectories: Annotated[int, "Its size."]
    conditions: Annotated[dict[str, float], "Numbers of the simulator that hold for this log alone."]
    parameters: Annotated[
        dict[str, dict[str, ParameterEstimate]],
        "For each cause that acts in it the parameters fitted to this log alone.",
    ]
    deviations: Annotated[dict[str, float], "How far its parameters with a tolerance were refitted, in tolerances."]


@explained_fields
@dataclass(frozen=True)
class Change:
    """A cause that differs between logs.

    Examples
    --------
    >>> from pamid.gap.several.result import Change
    >>> c = Change("leakage", "appears", "friday", float("nan"), 2e-10, "conductance", "m^3/(s Pa)", evidence=300.0)
    >>> f"{c.effect} {c.how} with {c.log}"
    'leakage appears with friday'
    """

    effect: Annotated[str, "The cause."]
    how: Annotated[
        str,
        '``"appears"``, ``"goes"``, ``"grows"`` or ``"shrinks"``; ``"differs"`` where no single parameter says how.',
    ]
    log: Annotated[str, "The log from which it differs."]
    before: Annotated[float, "Its main parameter before and after; NaN where it does not act."]
    after: Annotated[float, "Its main parameter before and after; NaN where it does not act."]
    parameter: Annotated[str, "That parameter and its unit."]
    unit: Annotated[str, "That parameter and its unit."]
    evidence: Annotated[float, "Logarithm of the likelihood ratio to a cause that does not change."]
    where: Annotated[str, "The port at which it acts, of a simulator with ports."] = ""
