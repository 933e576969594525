"""One measured equation of a simulator on a log, where the simulator states it itself."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..equations.noise import channel_noise

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

    def noise(self, rows: np.ndarray, n: int) -> float:
        r"""Return the standard deviation that the channels' noise leaves in a mean of n samples of the residual.

        It is :math:`\sigma^2 = \sigma_y^2 + \sum_s (\partial f/\partial s)^2 \sigma_s^2` in a mean over a window, with
        the noise of a filter's output for a rate that it took.
        """
        box, X = np.full(n, 1.0 / n), self.X.iloc[rows]
        variance = channel_noise(self.y[rows], n).variance(box)
        for column in X.columns.drop("time"):
            values = X[column].to_numpy(dtype=float)
            noise = channel_noise(values, n)
            if (step := max(noise.white, 1e-6 * float(np.std(values)))) == 0.0:
                continue
            ahead, behind = (self.nominal(X.assign(**{column: values + s})) for s in (step, -step))
            variance += float(np.mean(np.square((ahead - behind) / (2 * step)))) * noise.variance(box)
        return float(np.sqrt(variance))


def joined(problems: list[Problem]) -> Problem:
    """Return the equation of several logs as one, each with its own nominal model and runs of its own."""
    import pandas as pd

    first, *others = problems
    if not others:
        return first
    X = pd.concat([p.X for p in problems], keys=range(len(problems)))

    def nominal(T: pd.DataFrame) -> np.ndarray:
        if T.index.nlevels == 1:
            return first.nominal(T)
        out, owner = np.empty(len(T)), T.index.get_level_values(0).to_numpy()
        for k in np.unique(owner).tolist():
            out[owner == k] = problems[k].nominal(T[owner == k].droplevel(0))
        return out

    counts = [np.ones(len(p.y), dtype=bool) if p.counts is None else p.counts for p in problems]
    return first._replace(
        X=X, y=np.concatenate([p.y for p in problems]), nominal=nominal, counts=np.concatenate(counts),
        groups=np.concatenate([p.groups for p in problems]),
        notes=list(dict.fromkeys(text for p in problems for text in p.notes)),
    )  # fmt: skip
