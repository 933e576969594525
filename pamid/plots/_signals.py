"""What a plot reads of a user's table: columns, runs, units on axes."""

from typing import Any

import numpy as np
import pandas as pd

from ..errors import IncompatibleError, MissingColumnError, ShapeError
from ..requirements import WithVolume
from .style import SHOWN

_AXES = {
    "eps": (100.0, "contraction / %"),
    "deps": (100.0, "contraction rate / (%/s)"),
    "P": (1e-5, "pressure, absolute / bar"),
    "dP": (1e-5, "pressure rate / (bar/s)"),
    "q": (180 / np.pi, "joint angle / deg"),
    "x": (1e3, "stroke / mm"),
    "time": (1.0, "time / s"),
    "u": (1.0, "valve command"),
}
_TARGETS = {"N": "force", "kg/s": "mass flow", "Pa": "pressure", "-": "contraction"}


def axis_of(column: str) -> tuple[float, str]:
    """Return factor and label of a column; a column that pamid does not name is shown as it is."""
    return _AXES.get(column, (1.0, column))


def target_of(unit: str) -> tuple[float, str, str]:
    """Return factor, word and unit of a target given in an SI unit."""
    factor, shown = SHOWN.get(unit, (1.0, unit))
    return factor, _TARGETS.get(unit, "target"), shown


def column(X: Any, name: str) -> np.ndarray:
    """Return a column of a table by name."""
    if name not in getattr(X, "columns", ()):
        raise MissingColumnError(f"X has no {name}.", f"a DataFrame with {name}", "Add the column, or name another.")
    return np.asarray(X[name], dtype=float)


def with_volume(estimator: Any) -> WithVolume:
    """Return an estimator; raise where it identifies no volume."""
    if not isinstance(estimator, WithVolume):
        raise IncompatibleError(
            f"{type(estimator).__name__} identifies no volume.",
            "an estimator with a method volume",
            "Use a hybrid, geometric or polynomial model.",
        )
    return estimator


def resting(estimator: Any, eps: np.ndarray, P: np.ndarray) -> Any:
    """Return states at rest as the table that an estimator was fitted on; columns without a role in them are 0."""
    table = pd.DataFrame({"eps": eps, "deps": 0.0, "P": P, "dP": 0.0})
    names = list(getattr(estimator, "feature_names_in_", table.columns))
    return table.reindex(columns=names, fill_value=0.0)


def same_length(**arrays: np.ndarray) -> None:
    """Raise where arrays of samples differ in length."""
    lengths = {name: len(a) for name, a in arrays.items()}
    if len(set(lengths.values())) > 1:
        said = ", ".join(f"{name} {n}" for name, n in lengths.items())
        raise ShapeError(
            f"The numbers of samples differ: {said}.", "one of each a sample", "Pass rows that belong together."
        )


def predicted(estimator: Any, X: Any) -> np.ndarray:
    """Return the prediction of an estimator from the columns that it was fitted on."""
    names = [n for n in getattr(estimator, "feature_names_in_", ()) if n in getattr(X, "columns", ())]
    table = X[names] if names else X
    return np.asarray(estimator.predict(table), dtype=float).reshape(len(X), -1)[:, 0]
