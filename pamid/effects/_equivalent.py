"""Memories of the pressure: lags, relaxations and plays, as differences from it."""

from __future__ import annotations

import numpy as np

from ..signals.paths import play
from ..signals.state import Array
from ._memory import relax_along

TUBE = (0.02, 0.06)
"""Time constants of a tube or a sensor, s; two of them in a weighted sum make a lag of second order."""
RELAXATION = (0.2, 0.6, 2.0, 6.0)
"""Time constants of bladder and braid, s."""
HYSTERESIS = (1e4, 3e4, 1e5)
"""Plays in the pressure, Pa."""

MEMORIES = (
    *(f"tube_{1e3 * tau:g}ms" for tau in TUBE),
    *(f"relaxation_{1e3 * tau:g}ms" for tau in RELAXATION),
    *(f"hysteresis_{1e-3 * width:g}kPa" for width in HYSTERESIS),
)
"""Names of the columns of `pasts`."""
ROUGH = MEMORIES.index("tube_60ms")
"""Column that tells how fast the pressure changes."""


def pasts(P: Array, dt: float, starts: Array) -> np.ndarray:
    """Return each pressure memory less the pressure, Pa, shape (n_samples, n_memories), at rest at each start."""
    behind = relax_along(P, dt, TUBE[0], starts)
    lags = [relax_along(P, dt, tau, starts) for tau in (*TUBE, *RELAXATION)]
    plays = [play(behind, width, starts) for width in HYSTERESIS]
    return np.column_stack([*lags, *plays]) - np.asarray(P, dtype=float)[:, None]
