"""One measured equation of a simulator on a log, where the simulator states it itself."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

if TYPE_CHECKING:
    import pandas as pd

COUNTS = "counts"
"""Column of a log that says which rows count; windows with any other are left out, while effects remember all rows."""


class Problem(NamedTuple):
    """One equation on a log."""

    X: pd.DataFrame
    """Signals, with ``time``."""
    y: np.ndarray
    """What was measured."""
    nominal: Callable[[pd.DataFrame], np.ndarray]
    """Takes X, with signals that a fault of a sensor may have changed; returns what the nominal model says."""
    groups: np.ndarray
    """Run of each row."""
    roles: Mapping[str, str]
    """Column of X for each role of `pamid.estimators.GapDiagnoser`."""
    equation: str
    """``"force"``, ``"torque"`` or ``"flow"``."""
    unit: str
    """Unit of y."""
    plant: Any
    """Numbers for effects of geometry, gas or valve, a `pamid.effects.Plant`; or None."""
    notes: list[str]
    units: Mapping[str, str]
    """Units of ``target``, ``position`` and ``pressure`` as `pamid.estimators.GapDiagnoser` takes them."""
    counts: np.ndarray | None = None
    """Rows that count."""
    fitted: Any = None
    """The simulator with the numbers that were fitted to the log, where there are such."""

    @property
    def codes(self) -> np.ndarray:
        """Run of each row, from 0 in their order."""
        return np.cumsum(np.append(False, self.groups[1:] != self.groups[:-1]))
