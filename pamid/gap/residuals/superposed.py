r"""Responses of a simulator that is run whole, superposed: what it does under a drive that others are sums of.

Near a drive :math:`u_0` outputs are linear in what a drive :math:`u` and numbers change,

.. math:: y(u) \approx y(u_0) + \sum_j a_j\,\big(y(u_j) - y(u_0)\big) \qquad\text{for}\qquad
    u - u_0 \approx \sum_j a_j\,(u_j - u_0),

so that only changes in a new direction need a run. The factors follow from a QR decomposition of the known changes,
which grows by a column with each run.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.linalg import solve_triangular

ALREADY = 0.03
"""Share of a change that may be new for its response to follow from those that are known."""


class Superposed:
    """Known responses over one stretch, by the changes that they are of."""

    def __init__(self) -> None:
        self._changes = np.zeros((0, 0))
        self._R = np.zeros((0, 0))
        self._sizes = np.zeros(0)
        self._which: list[int] = []

    def add(self, change: np.ndarray, number: int) -> None:
        """Know the response to a change, by its number."""
        n, size = len(self._which), float(np.linalg.norm(change))
        if not self._changes.size:
            self._changes = np.zeros((8, len(change)))
        along, own = self._apart(change)
        left = float(np.linalg.norm(own))
        if not left > float(np.sqrt(np.finfo(float).eps)) * size:  # no direction of its own
            return
        if n == len(self._changes):
            self._changes = np.vstack([self._changes, np.zeros_like(self._changes)])
        self._changes[n] = own / left
        self._R = np.block([[self._R, along[:, None]], [np.zeros((1, n)), np.full((1, 1), left)]])
        self._sizes = np.append(self._sizes, size)
        self._which.append(number)

    def shares(self, change: np.ndarray, wanted: float) -> tuple[np.ndarray, Sequence[int]] | None:
        """Return what of which responses adds up to that to a change; None where they do not tell it."""
        n = len(self._which)
        if not n:
            return None
        along, own = self._apart(change)
        share = solve_triangular(self._R, along, check_finite=False)
        # Known responses that nearly cancel would leave more of their errors than there is to know.
        cancelled = ALREADY * float(np.abs(share) @ self._sizes) > wanted
        if cancelled or float(np.linalg.norm(own)) > ALREADY * wanted:
            return None
        return share, self._which

    def _apart(self, change: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return how much of each direction a change has, and its part in a direction of its own."""
        known = self._changes[: len(self._which)]
        along, own = np.zeros(len(known)), change
        for _ in range(2):  # once more, since rounding leaves something
            part = known @ own
            along, own = along + part, own - part @ known
        return along, own
