"""One equation of a system on a log."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    import numpy as np
    import pandas as pd


class Problem(NamedTuple):
    """One equation of a system on a log.

    Parameters
    ----------
    X : DataFrame
        Signals, with ``time``.
    y : array, shape (n_samples,)
        What was measured.
    nominal : callable
        Takes X, with signals that a fault of a sensor may have changed; returns what the nominal model says.
    groups : array of str, shape (n_samples,)
        Run of each row.
    roles : dict of str to str
        Column of X for each role of `pamid.estimators.GapDiagnoser`.
    equation : str
        ``"force"``, ``"torque"`` or ``"flow"``.
    unit : str
        Unit of y.
    plant : pamid.effects.Plant or None
        Numbers for effects of geometry, gas or valve.
    notes : list of str
        Notes for the reader.
    units : dict of str to str
        Units of ``target``, ``position`` and ``pressure`` as `pamid.estimators.GapDiagnoser` takes them.
    """

    X: pd.DataFrame
    y: np.ndarray
    nominal: Callable[[pd.DataFrame], np.ndarray]
    groups: np.ndarray
    roles: Mapping[str, str]
    equation: str
    unit: str
    plant: Any
    notes: list[str]
    units: Mapping[str, str]


def with_rates(log: pd.DataFrame, columns: Mapping[str, str]) -> pd.DataFrame:
    """Return time and signals with their rates, taken within each run."""
    import numpy as np

    from ..signals import differentiate

    X = log[["time", *columns]].copy()
    for signal, rate in columns.items():
        parts = []
        for _, run in log.groupby("trajectory", sort=False):
            y, t = run[signal].to_numpy(dtype=float), run["time"].to_numpy(dtype=float)
            parts.append(differentiate(y, t, warn=False)[1] if len(run) > 10 else np.zeros(len(run)))
        X[rate] = np.concatenate(parts)
    return X
