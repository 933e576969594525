"""The force equation: tension by Chou and Hannaford."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from .base import Equation, Residual, spread
from .run import SIGNS, Run
from .windows import average, centre, kernel


class ForceEquation(Equation):
    r"""Measured tension minus that of the virtual work of the gas.

    .. math:: F - \frac{P - P_\mathrm{atm}}{L_0}\,\frac{\partial V}{\partial\varepsilon}

    Examples
    --------
    >>> from pamid.equations.force import ForceEquation
    >>> ForceEquation.name, ForceEquation.unit
    ('force', 'N')
    """

    name: ClassVar[str] = "force"
    unit: ClassVar[str] = "N"
    channels: ClassVar[tuple[str, ...]] = ("q", "P", "F")
    order: ClassVar[int] = 1
    rank: ClassVar[int] = 0

    def residual(self, run: Run) -> Residual:
        """Return the residual tension of both muscles, N."""
        p = run.model.params
        L0 = p.muscle.rest_length
        gauge = run.P - p.gas.atmospheric_pressure
        modelled = gauge / L0 * run.volume_slope + run.added_force()
        n, first = run.n, run.starts(len(run.q), 1)
        measured = average(run.F, n, 1, first)
        value, time = measured - average(np.asarray(modelled), n, 1, first), average(run.time, n, 1, first)
        if not run.model.noise:
            return Residual(time, value, measured, np.zeros_like(value))
        weights = kernel(n, 1)
        h = 1e-6
        plant = run.model.plant
        eps = centre(run.eps, n, 1, first)
        curvature = (plant.volume_slope(eps + h) - plant.volume_slope(eps - h)) / (2 * h)
        per_angle = centre(gauge, n, 1, first) / L0 * curvature * SIGNS * p.joint.pulley_radius / L0
        per_pressure = run.volume_slope / L0 + run.added_stiffness()
        noise, _ = spread(
            (1.0, run.noise("F"), run.weights("F", weights)),
            (centre(per_pressure, n, 1, first), run.noise("P"), run.weights("P", weights)),
            (per_angle, run.noise("q"), run.weights("q", weights)),
            n_windows=len(first),
            n=n,
        )
        return Residual(time, value, measured, noise)
