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
            out[rate] = np.zeros(len(out[of]))
            for a, b in equal_stretches(codes):
                # Never over so long that it would blur a short run.
                half = max(2, min(round(0.5 * RATE_WINDOW / dt), (b - a) // 200))
                out[rate][a:b] = rate_over(out[of][a:b], dt, half)
    return out
