"""Go on from an earlier diagnosis with further logs."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

from ...errors import ParameterError
from .conditions import Conditions, conditions_of
from .engine import diagnose_logs
from .history import History

if TYPE_CHECKING:
    import pandas as pd

    from ..diagnosis.result import Diagnosis


def go_on(
    history: History,
    logs: Mapping[str, pd.DataFrame],
    *,
    conditions: Mapping[str, Conditions] | None = None,
    seed: int = 0,
    progress: Callable[[str], None] | None = None,
) -> Diagnosis:
    """Diagnose further logs together with those of a history, to which they are then added.

    Parameters
    ----------
    history : History
        The logs so far; an empty one begins here.
    logs : mapping of str to DataFrame
        The logs that came, by name.
    conditions : mapping of str to Conditions, optional
        What held for each; a log without them belongs to the last day of the history.
    seed : int, default=0
        Seed of the draws behind p-values and intervals.
    progress : callable, optional
        Called with a short text at each step.

    Returns
    -------
    Diagnosis
        The answer of all logs together.

    Raises
    ------
    ParameterError
        A log is there already.
    IncompatibleError
        The logs cannot be of one bench.

    Examples
    --------
    >>> from pamid.bench import BenchParameters, sealed_hold, simulate, sine
    >>> from pamid.gap.several.go_on import go_on
    >>> from pamid.gap.several.history import History
    >>> bench = BenchParameters.for_muscle("B")
    >>> leak = [("leakage", {"conductance": 2e-10})]
    >>> history = History(bench, ["leakage", "flow_bias"])
    >>> _ = go_on(history, {"first": simulate(bench, [sine(2, 10, 1500)], effects=leak)})
    >>> found = go_on(history, {"second": simulate(bench, [sealed_hold(5, 1500)], effects=leak)})
    >>> found.causes[0].effects, len(history.rounds)
    (('leakage',), 2)
    """
    for name in logs:
        if name in history.logs:
            raise ParameterError(
                f"The log {name} is part of the earlier diagnosis already.",
                "logs that came since",
                "Name further logs only, or give another recording another name.",
            )
    held = conditions_of(list(logs), conditions)
    if history.held:
        last = list(history.held.values())[-1].day
        given = {**dict(conditions or {})}
        held = [c if c.day != name or given else c._replace(day=last) for name, c in zip(logs, held, strict=True)]
    found = diagnose_logs(
        {**history.logs, **logs},
        history.params,
        history.library,
        conditions={**history.held, **dict(zip(logs, held, strict=True))},
        seed=seed,
        progress=progress,
    )
    history.add(found, logs, held)
    return found
