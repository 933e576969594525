"""A diagnosis of a whole simulator with ports, behind the face of an estimator."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from sklearn.utils import check_random_state
from sklearn.utils.validation import column_or_1d

from pamid.errors import MissingColumnError

if TYPE_CHECKING:
    import pandas as pd

    from pamid.gap import Diagnosis
    from pamid.simulators import Simulator


def is_simulator(nominal: Any) -> bool:
    """Return whether a nominal model is a simulator with ports, without loading any."""
    return "pamid.simulators.base" in {c.__module__ for c in type(nominal).__mro__}


def diagnosis_of(
    simulator: Simulator, effects: Any, random_state: Any, X: Any, y: Any, groups: Any
) -> tuple[Diagnosis, str]:
    """Diagnose a simulator: X holds the columns that its ports name, y one of its states or outputs, which is named."""
    from pamid.gap import diagnose_simulator

    log, target = _log(X, y, groups, simulator)
    rng = check_random_state(random_state)
    seed = int(rng.randint(2**31 - 1))
    return diagnose_simulator(log, simulator, effects, seed=seed), target


def predict_simulator(simulator: Simulator, target: str, X: Any, groups: Any) -> np.ndarray:
    """Return the target as a simulator has it: a free run of the inputs in X from the states that X shows."""
    from pamid.gap.simulated import free_run

    log, _ = _log(X, None, groups, simulator)
    return free_run(log, simulator, target)[target].to_numpy()


def _log(X: Any, y: Any, groups: Any, simulator: Any) -> tuple[pd.DataFrame, str]:
    """Return a log of X and y, and the port that y is of."""
    if not hasattr(X, "columns"):
        raise MissingColumnError("X has no names.", "a DataFrame with the columns of the ports", "Name its columns.")
    log = X.copy()
    if groups is not None:
        log["trajectory"] = np.asarray(groups)
    if y is None:
        return log, ""
    shown = [p for p in simulator.ports if p.kind in ("output", "state")]
    name = getattr(y, "name", None)
    mine = [p for p in shown if name in (p.name, p.source)] or [p for p in shown if p.source not in X.columns]
    if len(mine) != 1:
        raise MissingColumnError(
            f"y is {name!r}, which is neither an output nor a state of the simulator.",
            f"one of {', '.join(p.source for p in shown)}",
            "Give y as a Series of that name.",
        )
    log[mine[0].source] = column_or_1d(np.asarray(y, dtype=float))
    return log, mine[0].name
