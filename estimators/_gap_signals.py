"""What a diagnosis reads out of a table, and how a notebook shows what it found."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from typing import Any

import numpy as np

from pamid.errors import MissingColumnError, ShapeError, UnknownOptionError
from pamid.signals.roles import ROLES

from ._trajectories import has_trajectory_column

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


def values_of(causes: Sequence[Any]) -> dict[str, dict[str, float]]:
    """Return the causes, each by its first effect, with the values of their parameters."""
    return {c.effects[0]: {k: float(p.value) for k, p in c.parameters.items()} for c in causes}


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
