"""Checks of parameters that many estimators share, worded alike."""

import warnings
from collections.abc import Sequence
from typing import Any

import numpy as np

from pamid.errors import ExcitationWarning, ParameterError, UnknownOptionError


def check_counts(estimator: Any, *names: str, least: int = 1) -> None:
    """Raise unless each named parameter is a whole number of at least 1, or of another bound."""
    for name in names:
        value = getattr(estimator, name)
        if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or value < least:
            raise ParameterError(f"{name} is {value!r}.", f"a whole number of at least {least}", f"Correct {name}.")


def check_sizes(estimator: Any, **least: float) -> None:
    """Raise unless each named parameter is a finite number of at least its bound."""
    for name, bound in least.items():
        value = getattr(estimator, name)
        if not np.isfinite(value) or value < bound:
            raise ParameterError(f"{name} is {value!r}.", f"a finite number of at least {bound:g}", f"Correct {name}.")


def check_option(estimator: Any, name: str, offered: tuple[str, ...]) -> None:
    """Raise unless a named parameter is one of the names offered."""
    value = getattr(estimator, name)
    if value not in offered:
        raise UnknownOptionError(f"{name} is {value!r}.", f"one of {', '.join(offered)}", "Choose one of them.")


def row_weights(sample_weight: Any, table: np.ndarray) -> np.ndarray:
    """Return the weight of each row of a table, one where none is given; a negative one is an error."""
    from sklearn.utils.validation import _check_sample_weight

    weight: np.ndarray = _check_sample_weight(sample_weight, table, dtype=np.float64, ensure_non_negative=True)
    return weight


def fit_arguments(model: Any, weight: np.ndarray | None, groups: np.ndarray | None) -> dict[str, Any]:
    """Return those of weights and runs that are given and that the fit of a model takes."""
    from sklearn.utils.validation import has_fit_parameter

    given = {"sample_weight": weight, "groups": groups}
    return {name: x for name, x in given.items() if x is not None and has_fit_parameter(model, name)}


def check_squares(y: Any) -> None:
    """Raise unless the squares of a target can be summed; NaN is passed over."""
    size = float(np.nanmax(np.abs(y), initial=0.0))
    if size > np.sqrt(np.finfo(np.float64).max / max(np.size(y), 1)):
        raise ParameterError(
            f"y reaches {size:.4g}, whose square overflows.",
            "a target in SI units, such as a force in N or a flow in kg/s",
            "Look for the damaged sample, or correct the unit.",
        )


def warn_of_still_columns(columns: np.ndarray, names: Sequence[str], who: str) -> None:
    """Warn, before a fit, of signals that do not vary: nothing about them can be learnt."""
    if len(columns) < 3:
        return
    span, size = np.ptp(columns, axis=0), np.abs(columns).max(axis=0)
    for name, s, m in zip(names, span, size, strict=True):
        if s <= 1e-9 * m:
            warnings.warn(
                f"The signal {name} does not vary (it stays at {m:.6g}). Expected an experiment that moves it. {who} "
                f"learns nothing about {name}; leave it out of the inputs, or record a run that excites it.",
                ExcitationWarning,
                stacklevel=4,
            )
