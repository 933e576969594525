"""What one unit of a flow between two ports does to each of them, evaluated once and scaled as parameters change it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ..remembered import Remembered
from .base import Simulator
from .reciprocity import SAME
from .structure import some_instants, spread_numbers

Shares = Callable[[np.ndarray, np.ndarray, np.ndarray, np.ndarray], tuple[Any, Any]]
"""Of times, states, inputs and parameters: rates at both ends of one unit of what flows through."""
_KEPT = 4


def scaled_shares(simulator: Simulator, exact: Shares) -> Shares:
    """Return shares that cost several runs of the rates, at the parameters as they are given and scaled to others.

    Most parameters, such as a bulk modulus, change them by a factor, which some instants show. Where it differs between
    these, shares are evaluated everywhere.
    """
    kept: Remembered[tuple[Any, Any]] = Remembered(_KEPT)

    def shares(t: np.ndarray, x: np.ndarray, u: np.ndarray, p: np.ndarray) -> tuple[Any, Any]:
        n = x.shape[1]
        some = some_instants(n)
        if len(some) == n:  # as few as a step of several runs side by side asks for
            return exact(t, x, u, p)
        whole = kept.get(hash((x.tobytes(), u.tobytes())), lambda: exact(t, x, u, spread_numbers(simulator, n)))
        with np.errstate(all="ignore"):
            here = exact(np.broadcast_to(t, n)[some], x[:, some], u[:, some], p[:, some])
            ratios = [now / given[some] for now, given in zip(here, whole, strict=True)]
        factors = [float(np.median(ratio)) for ratio in ratios]
        if all(np.ptp(ratio) <= SAME * abs(f) for ratio, f in zip(ratios, factors, strict=True)):
            return whole[0] * factors[0], whole[1] * factors[1]
        return kept.get(hash((x.tobytes(), u.tobytes(), p.tobytes())), lambda: exact(t, x, u, p))

    return shares
