"""What `GapDiagnoser` asks others: a table's signals, a simulator's diagnosis, a hybrid model with the causes."""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from sklearn.utils import check_random_state
from sklearn.utils.validation import column_or_1d

from pamid.effects._terms import of_causes
from pamid.effects.plant import Plant
from pamid.errors import EffectsWarning, IncompatibleError, MissingColumnError, ShapeError, UnknownOptionError
from pamid.signals.state import ROLES

from ._trajectories import has_trajectory_column

if TYPE_CHECKING:
    from pamid.gap import Diagnosis
    from pamid.simulators import Simulator

    from ._pihm import HybridModel

NAMES = ("time", "position", "velocity", "pressure", "pressure_rate", "command", "flow", "force")
EQUATIONS = ("force", "torque", "flow")


def read_by(nominal: Any, X: Any) -> Any:
    """Return the columns of a table that a nominal model was fitted on."""
    own = getattr(nominal, "feature_names_in_", None)
    if own is None:
        count = getattr(nominal, "n_features_in_", X.shape[1])
        if count != X.shape[1]:
            raise ShapeError(
                f"The nominal {type(nominal).__name__} was fitted on {count} columns without names; X has "
                f"{X.shape[1]}.",
                "the columns of the model's fit, or a model that was fitted on names",
                "Fit the model on a DataFrame, or pass as nominal a function of X that picks its columns.",
            )
        return X
    names = [str(name) for name in own]
    if missing := [name for name in names if name not in getattr(X, "columns", ())]:
        raise MissingColumnError(
            f"The nominal {type(nominal).__name__} reads {', '.join(missing)}, which X does not have.",
            f"the columns of the model's fit: {', '.join(names)}",
            "Pass a DataFrame with these columns besides those that have a role.",
        )
    return X[names]


def spoken(verdict: str, causes: Sequence[Any]) -> str:
    """Return the verdict with its causes, as HTML."""
    named = "; ".join(f"{' or '.join(c.effects)}, {c.share:.0%} of the gap" for c in causes)
    return f"<p><strong>{escape(f'Verdict: {verdict}' + (f' ({named})' if named else ''))}</strong></p>"


def run_names(X: Any, groups: Any, codes: np.ndarray) -> list[str]:
    """Return the name of each run, by code."""
    first = np.concatenate([[0], np.flatnonzero(np.diff(codes)) + 1])
    named = np.asarray(groups).ravel() if groups is not None else None
    if named is None and has_trajectory_column(X):
        named = X["trajectory"].to_numpy()
    names = [str(named[k]) if named is not None else "0" for k in first]
    return names if len(set(names)) == len(names) else [str(k) for k in range(len(names))]


def located(estimator: Any, n_columns: int) -> dict[str, int]:
    """Return the column of each role, as an estimator's ``signals`` or the names of the columns tell."""
    names = [str(n) for n in getattr(estimator, "feature_names_in_", ())]
    given = dict(estimator.signals or {})
    if unknown := sorted(set(given) - set(NAMES)):
        raise UnknownOptionError(
            f"signals maps {', '.join(unknown)}.", f"roles: {', '.join(NAMES)}", "Name the role of each column."
        )
    found: dict[str, int] = {}
    for k, name in enumerate(names):
        role = ROLES.get(name, name if name in NAMES else "")
        if role and role not in found and not given:
            found[role] = k
    for role, column in given.items():
        at = names.index(column) if isinstance(column, str) and column in names else column
        if isinstance(at, str) or not 0 <= int(at) < n_columns:
            raise MissingColumnError(
                f"X has no column {column!r} for {role}; it has {', '.join(names) or f'{n_columns} columns'}.",
                "a name or position of a column",
                "Correct signals=.",
            )
        found[role] = int(at)
    if not set(found) - {"time"}:
        raise MissingColumnError(
            f"No column of X has a role; it has {', '.join(names) or f'{n_columns} without names'}.",
            "position, velocity, pressure, ...",
            "Map them, for instance signals={'position': 'stroke', 'velocity': 'speed', 'time': 't'}.",
        )
    return found


def hybrid_with(causes: Sequence[Any], equation: str, plant: Plant | None) -> HybridModel:
    """Return an unfitted hybrid model of a muscle's force or flow that holds the causes which it can."""
    from .static_pihm import StaticPIHM
    from .thermodynamic_pihm import ThermodynamicPIHM

    kinds: dict[str, type[HybridModel]] = {"force": StaticPIHM, "flow": ThermodynamicPIHM}
    if plant is None or equation not in kinds:
        raise IncompatibleError(
            f"The diagnosis is of {equation}{'' if plant else ' without a plant'}.",
            "force or flow of a muscle, whose length and diameter plant= gives",
            "Pass plant= before the fit, or predict with the diagnoser itself.",
        )
    values = [
        (c.effects, [{k: p.value for k, p in found.items()} for found in (c.parameters, *c.others)]) for c in causes
    ]
    held, left = of_causes(values, {equation})
    if left:
        warnings.warn(
            f"{', '.join(left)}: a hybrid model cannot hold it as an effect. Expected terms of the force or flow, or "
            "faults of the pressure's sensor. Its network takes what depends on the state; the rest stays.",
            EffectsWarning,
            stacklevel=3,
        )
    around = math.sqrt(max(plant.thread_length**2 - plant.rest_length**2, 0.0))
    model: Any = kinds[equation]
    return model(
        plant.rest_length,
        around / (math.pi * plant.turns),
        atmospheric_pressure=plant.atmospheric_pressure,
        effects={e.name: dict(e.values) for e in held} or None,
    )


def is_simulator(nominal: Any) -> bool:
    """Return whether a nominal model is a simulator with ports, without loading any."""
    return "pamid.simulators.base" in {c.__module__ for c in type(nominal).__mro__}


def diagnosis_of(
    simulator: Simulator, effects: Any, random_state: Any, X: Any, y: Any, groups: Any
) -> tuple[Diagnosis, str]:
    """Diagnose a simulator: X holds the columns that its ports name, y one of its states or outputs, which is named."""
    from pamid.gap import diagnose_simulator

    log, target = _log(X, y, groups, simulator)
    seed = int(check_random_state(random_state).randint(2**31 - 1))
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
