"""The force equation: tension by Chou and Hannaford."""

from typing import ClassVar

import numpy as np

from .base import Equation, Residual, spread
from .run import SIGNS, Run
from .windows import kernel


class ForceEquation(Equation):
    r"""Measured tension minus that of the virtual work of the gas.

    .. math:: F - \frac{P - P_\mathrm{atm}}{L_0}\,\frac{\partial V}{\partial\varepsilon}
    """

    name: ClassVar[str] = "force"
    unit: ClassVar[str] = "N"
    channels: ClassVar[tuple[str, ...]] = ("q", "P", "F")
    order: ClassVar[int] = 1
    rank: ClassVar[int] = 0

    def residual(self, run: Run) -> Residual:
        """Return the residual tension of both muscles, N."""
        windows = run.windows(self)
        time = windows.time(run.time)
        key = (id(windows), run.model.params.gas.atmospheric_pressure, *run.shape)
        measured, nominal = run.kept(
            ("force", *key), lambda: np.stack([windows.mean(run.F), windows.mean(_nominal_tension(run))])
        )
        value = measured - nominal
        if (added := run.added_force()) is not None:
            value = value - windows.mean(np.broadcast_to(added, run.P.shape))
        if not run.model.noise:
            return Residual(time, value, measured, np.zeros_like(value))
        weights = kernel(run.n, 1)
        per_pressure, per_angle = tension_slopes(run)
        noise, _ = spread(
            (1.0, run.covariances(windows, "F", weights)),
            (windows.centre(per_pressure), run.covariances(windows, "P", weights)),
            (windows.centre(per_angle), run.covariances(windows, "q", weights)),
            n_windows=len(time),
        )
        return Residual(time, value, measured, noise)


def tension(run: Run) -> np.ndarray:
    """Return the modelled tension of both muscles, N."""
    added = run.added_force()
    return _nominal_tension(run) if added is None else np.asarray(_nominal_tension(run) + added)


def _nominal_tension(run: Run) -> np.ndarray:
    p = run.model.params
    gauge = run.P - p.gas.atmospheric_pressure
    return np.asarray(gauge / p.muscle.rest_length * run.volume_slope)


def tension_slopes(run: Run) -> tuple[np.ndarray, np.ndarray]:
    """Return the derivatives of that by pressure and angle, N/Pa and N/rad."""
    p, plant, h = run.model.params, run.model.plant, 1e-6
    L0 = p.muscle.rest_length
    curvature = (plant.volume_slope(run.eps + h) - plant.volume_slope(run.eps - h)) / (2 * h)
    turn = SIGNS * p.joint.pulley_radius / L0
    gauge = run.P - p.gas.atmospheric_pressure
    return np.asarray(run.volume_slope / L0 + run.added_stiffness()), np.asarray(gauge / L0 * curvature * turn)
