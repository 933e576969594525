"""Go on from an earlier diagnosis with further logs."""

from collections.abc import Callable, Mapping
from typing import Any

import pandas as pd

from ...errors import ParameterError
from ...explained import explained_by
from ..diagnosis.result import Diagnosis
from .conditions import Conditions, conditions_of
from .history import History
from .logs import diagnose, diagnosed


@explained_by(diagnose)
def go_on(
    history: History,
    logs: Mapping[str, pd.DataFrame],
    *,
    conditions: Mapping[str, Conditions] | None = None,
    alone: bool = False,
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
        Conditions of each. Without them a log of a bench belongs to the last day of the history, so that valves and
        gas are those of its logs; one of any other simulator is a day of its own.
    alone : bool, default=False
        Whether a first log by itself is diagnosed as one log, without findings log by log.

    Returns
    -------
    Diagnosis
        The answer of all logs together.

    Raises
    ------
    ParameterError
        A log of that name exists already.
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
                "new logs only",
                "Name only the new logs; a different recording needs a different name.",
            )
    held = conditions_of(list(logs), conditions)
    if history.held and history.simulator.day_lasts:
        last = list(history.held.values())[-1].day
        held = [c if c.day != name or conditions else c._replace(day=last) for name, c in zip(logs, held, strict=True)]
    every, those = {**history.logs, **logs}, {**history.held, **dict(zip(logs, held, strict=True))}
    asked: Any = next(iter(every.values())) if alone and len(every) == 1 and not conditions else every
    held_by = those if asked is every else None
    say = progress or (lambda _: None)
    found, parts = diagnosed(asked, history.simulator, history.library, held_by, seed, say)
    if parts:
        logs, held = parts, conditions_of(list(parts), None)
    history.add(found, logs, held)
    return found
