r"""Drift alarms: has one of several parameters moved, and which, at a stated rate of false alarms.

For each parameter the stream's residuals are compared with what a change of this one parameter would add to them,

.. math:: T_j = \frac{\sum_i \lambda^{n-i} h_{ij} r_i/\sigma^2}{\sqrt{\sum_i \lambda^{2(n-i)} h_{ij}^2/\sigma^2}},

which has unit variance while the residuals are white. They are not quite: models leave structure. On a healthy stretch
the size κ_j that T_j really has is measured, and an alarm means that |T_j| stays above u κ_j, with u from the false
alarms allowed. What it is takes longer to tell than that it is: from the moment at which a sum first leaves its band,
fresh sums are taken, and the parameter is named that explains most of the residuals since.
"""

from statistics import NormalDist
from typing import Any

import numpy as np

LOOKS = 4.0
"""Effective number of independent tests of an exponentially weighted sum per memory length."""


NAMING = 8.0
"""Memory of the sums by which a parameter is named, in memories of those that raise the alarm."""


def threshold(false_alarms_per_hour: float, memory_seconds: float, n_tests: int) -> float:
    """Return the deviation u, in standard deviations, that Gaussian sums exceed at a rate.

    Parameters
    ----------
    false_alarms_per_hour : float
        Allowed rate, 1/h.
    memory_seconds : float
        Memory of the sums, s.
    n_tests : int
        Sums that are watched, each to both sides.

    Returns
    -------
    float
        u, dimensionless.

    Examples
    --------
    >>> from pamid.online import threshold
    >>> round(threshold(1.0, 1.0, 3), 1)
    4.2
    """
    looks = LOOKS * 3600.0 / memory_seconds
    share = min(false_alarms_per_hour / (2.0 * n_tests * looks), 0.25)
    return -NormalDist().inv_cdf(share)


_SUMS = ("sums", "squares", "since_sums", "since_information")


class DriftAlarm:
    """Watch the residuals of a stream for a change of one of several parameters.

    Parameters
    ----------
    one_sided : array of bool, shape (n_parameters,)
        Which parameters can only grow, such as friction from nothing.
    memory : float
        Samples after which a residual counts 1/e.
    hold : int
        Samples for which a sum must stay beyond its threshold.
    limit : float
        Threshold u, see `threshold`.
    groups : array of int, shape (n_parameters,), optional
        Parameters that explain jointly, such as those of one effect; each separately by default.

    Examples
    --------
    >>> from pamid.online import DriftAlarm
    >>> alarm = DriftAlarm(one_sided=[False], memory=25.0, hold=60, limit=5.0)  # memory and hold in blocks
    >>> alarm.scale
    array([1.])
    """

    def __init__(self, one_sided: Any, memory: float, hold: int, limit: float, groups: Any = None) -> None:
        self.one_sided = np.asarray(one_sided, dtype=bool)
        n = len(self.one_sided)
        self.groups = np.arange(n) if groups is None else np.asarray(groups)
        self.memory = float(memory)
        self.hold = int(hold)
        self.limit = float(limit)
        self.scale = np.ones(n)
        self.restart()

    def restart(self) -> None:
        """Forget the sums, not the calibration."""
        n = len(self.one_sided)
        self.sums = np.zeros(n)
        self.squares = np.zeros(n)
        self.since_sums = np.zeros(n)
        self.since_information = np.zeros((n, n))
        self.beyond = 0

    @property
    def state(self) -> dict[str, Any]:
        """The sums, from which another alarm can continue."""
        return {name: np.copy(getattr(self, name)) for name in _SUMS} | {"beyond": self.beyond}

    @state.setter
    def state(self, state: dict[str, Any]) -> None:
        for name in _SUMS:
            setattr(self, name, np.array(state[name], dtype=float))
        self.beyond = int(state["beyond"])

    def statistic(self, H: np.ndarray, residual: np.ndarray, noise: float) -> np.ndarray:
        """Take a block and return T, shape (n_parameters,)."""
        fade = float(np.exp(-len(residual) / self.memory))
        known = np.isfinite(residual) & np.isfinite(H).all(axis=1)
        rows = H[known] / noise
        news, information = rows.T @ (residual[known] / noise), rows.T @ rows
        self.sums = fade * self.sums + news
        self.squares = fade**2 * self.squares + np.diag(information)
        slow = float(np.exp(-len(residual) / (NAMING * self.memory))) if self.beyond else 0.0
        self.since_sums = slow * self.since_sums + news
        self.since_information = slow * self.since_information + information
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.where(self.squares > 0, self.sums / np.sqrt(self.squares), 0.0)

    def calibrate(self, statistics: np.ndarray) -> None:
        """Measure the size of T on a healthy stretch, from what `statistic` returned along it, shape (n_blocks,
        n_parameters).
        """
        settled = statistics[min(len(statistics) // 10, 20) :]
        if len(settled):
            rms = np.sqrt(np.mean(settled**2, axis=0))
            tail = np.quantile(np.abs(settled), 0.99, axis=0) / 2.576
            self.scale = np.maximum(np.maximum(rms, tail), 1.0)

    def update(self, H: np.ndarray, residual: np.ndarray, noise: float) -> tuple[int, float] | None:
        """Take a block; return the parameter that has drifted and how far beyond its threshold, or None."""
        ratio = self.ratio(self.statistic(H, residual, noise))
        most = float(np.max(ratio))
        self.beyond = self.beyond + len(residual) if most > 1.0 else 0
        return (self.named(), most) if self.beyond >= self.hold > 0 else None

    def named(self) -> int:
        """Return the parameter that explains most of the residuals since the alarm began, alone or with its group."""
        alone = [self._gain(np.array([k])) for k in range(len(self.groups))]
        gains = {g: self._gain(np.flatnonzero(self.groups == g)) for g in np.unique(self.groups)}
        best = max(gains, key=lambda g: gains[g])
        inside = np.flatnonzero(self.groups == best)
        return int(inside[np.argmax([alone[k] for k in inside])])

    def _gain(self, which: np.ndarray) -> float:
        """Return by how much some parameters lower the squared residuals, within the sides that they can go to."""
        b, A = self.since_sums[which], self.since_information[np.ix_(which, which)]
        size = np.sqrt(np.diag(A))
        if not (size > 0).all():
            return 0.0
        step = np.linalg.lstsq(A / np.outer(size, size), b / size, rcond=1e-9)[0] / size
        if (self.one_sided[which] & (step < 0)).any():
            return max((self._gain(which[[k]]) for k in range(len(which))), default=0.0) if len(which) > 1 else 0.0
        return float(step @ b)

    def estimate(self, which: int) -> float:
        """Return how far a parameter alone has moved since the alarm began, in its unit."""
        information = self.since_information[which, which]
        return float(self.since_sums[which] / information) if information > 0 else float("nan")

    def ratio(self, statistic: np.ndarray) -> np.ndarray:
        """Return T over its threshold, without directions in which a parameter cannot move."""
        size = np.where(self.one_sided, statistic, np.abs(statistic))
        return size / (self.limit * self.scale)
