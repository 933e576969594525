"""Rates of the signals of one equation, where the log lacks them."""

from __future__ import annotations

import numpy as np

from ...signals.savgol import rate_over
from ...signals.stretches import equal_stretches

RATE_WINDOW = 0.04
"""Seconds over which the rate of a signal of unknown noise is taken: fast beside an arm, slow beside its samples."""


def with_rates(signals: dict[str, np.ndarray], codes: np.ndarray, dt: float) -> dict[str, np.ndarray]:
    """Return signals by role, with the rates of position and pressure taken within each run where they are missing."""
    out = dict(signals)
    for rate, of in (("velocity", "position"), ("pressure_rate", "pressure")):
        if rate not in out and of in out:
            out[rate] = rate_along(out[of], codes, dt)
    return out


def rate_along(x: np.ndarray, codes: np.ndarray, dt: float) -> np.ndarray:
    """Return the rate of a signal within each run, over `RATE_WINDOW`."""
    out = np.zeros(len(x))
    for a, b in equal_stretches(codes):
        # Never so long that it would blur a short run.
        out[a:b] = rate_over(x[a:b], dt, max(2, min(round(0.5 * RATE_WINDOW / dt), (b - a) // 200)))
    return out
