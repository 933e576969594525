"""When, within a sampling period, a logged flow flows."""

import numpy as np
import pandas as pd

from ..constants import HEAT_CAPACITY_RATIO
from ..laws.thermodynamic import ThermodynamicFlow
from ..signals.state import STATE_SIGNALS, State

POWERS = [(i, j) for i in range(4) for j in range(3)]
"""Powers of contraction and pressure in the volume beside which the timing is found."""

ROWS = 100
"""Fewer rows tell nothing of a timing."""


def flow_steps(table: pd.DataFrame, column: str = "mdot") -> np.ndarray:
    """Return by how much a signal has changed since the sample before, zero where a run begins."""
    step = table.groupby("trajectory", sort=False)[column].diff()
    return np.asarray(step.fillna(0.0), dtype=float)


def held_share(table: pd.DataFrame, flow: np.ndarray, step: np.ndarray) -> float:
    r"""Return the share s of the step for which a valve's flow is held, by least squares, V polynomial in (ε, P).

    .. math:: \dot m = \dot m_V(\varepsilon, \dot\varepsilon, P, \dot P) + \frac{s}{2}\, \Delta\dot m
    """
    if len(flow) < ROWS:
        return 0.0
    state = State(*(table[name].to_numpy(dtype=float) for name in STATE_SIGNALS))
    law = ThermodynamicFlow(HEAT_CAPACITY_RATIO)
    eps, P = float(np.abs(state.eps).max()) or 1.0, float(np.abs(state.P).max()) or 1.0
    x, z = state.eps / eps, state.P / P
    columns = [step]
    for i, j in POWERS:
        V_eps = i * x ** max(i - 1, 0) * z**j / eps
        V_P = j * z ** max(j - 1, 0) * x**i / P
        columns.append(np.asarray(law.predict(x**i * z**j, V_eps, V_P, state)))
    A = np.column_stack(columns)
    size = np.linalg.norm(A, axis=0)
    if not size[0] > 0:
        return 0.0
    size[size == 0] = 1.0
    found = np.linalg.lstsq(A / size, flow, rcond=None)[0][0] / size[0]
    return float(np.clip(2.0 * found, 0.0, 1.0))
