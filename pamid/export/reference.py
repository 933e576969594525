"""Reference values: states around the data of a fit and at its edges, with what the model answers to them in Python."""

from typing import NamedTuple

import numpy as np

from ..constants import ATMOSPHERIC_PRESSURE
from .plan import STEP, ExportPlan

TOLERANCES = {"float64": 1e-11, "float32": 2e-5}
"""Largest deviation from ``predict`` that an export may show, as a share of the largest magnitude of each output."""

SERIES_BELOW = {"float64": 0.05, "float32": 0.3}
"""Gauge pressure, in widths of the contact, below which its factor is a series; the quotient loses digits there."""


class Reference(NamedTuple):
    """Inputs and expected outputs."""

    inputs: np.ndarray
    """States, exactly representable in single precision. Shape (n_rows, n_inputs)."""
    expected: np.ndarray
    """Predictions, then of a model with a volume V, ∂V/∂ε and ∂V/∂P. Shape (n_rows, n_outputs + 3)."""

    def tolerance(self, dtype: str) -> np.ndarray:
        """Return the largest deviation of each column that passes."""
        largest = np.max(np.abs(self.expected), axis=0)
        return TOLERANCES[dtype] * np.where(largest > 0, largest, 1.0)


def reference_of(plan: ExportPlan, n_rows: int = 64, seed: int = 0) -> Reference:
    """Evaluate a plan in Python at states inside its data, outside, at standstill and at ambient pressure."""
    rng = np.random.default_rng(seed)
    if plan.memory is not None:
        x = _path(plan, n_rows, rng).astype(np.float32).astype(float)
        return Reference(x, np.column_stack([plan.predict(x), *plan.volume(x)]))
    x = plan.centre + plan.width * rng.uniform(-2.5, 2.5, (n_rows, 4))
    ambient = plan.anchor.atmospheric_pressure if plan.anchor else ATMOSPHERIC_PRESSURE
    x[:, 2] = np.maximum(x[:, 2], 0.5 * ambient)
    x[0] = plan.centre
    x[1] = [0.0, 0.0, ambient, 0.0]
    x[2] = [plan.centre[0], 0.0, ambient + 10.0, 0.0]
    x[3] = plan.centre + 20.0 * plan.width
    x[4, [1, 3]] = 0.0
    x[5, 0] = -0.02
    x = x.astype(np.float32).astype(float)
    return Reference(x, np.column_stack([plan.predict(x), *plan.volume(x)]))


def _path(plan: ExportPlan, n_rows: int, rng: np.random.Generator) -> np.ndarray:
    """Return readings along a path that turns back several times, with their rates."""
    t = STEP * np.arange(n_rows)[:, None]
    size, phase = plan.width[[0, 2]] * rng.uniform(0.5, 1.5, 2), rng.uniform(0.0, 6.0, 2)
    speed = np.array([37.0, 53.0])  # rad/s: four turns and six in 64 readings
    moved, rate = size * np.sin(speed * t + phase), size * speed * np.cos(speed * t + phase)
    eps, P = (plan.centre[[0, 2]] + moved).T
    return np.column_stack([eps, rate[:, 0], P, rate[:, 1]])
