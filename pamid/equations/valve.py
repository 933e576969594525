"""The valve equation: mass flow through a servo valve after ISO 6358."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from ..laws.valve import valve_flow
from .base import Equation, Residual, spread
from .run import Run
from .windows import kernel


class ValveEquation(Equation):
    r"""Measured mass flow minus what the valve lets through at its command.

    .. math:: \dot m - \begin{cases} C u \rho_0 P_s\,\psi(P/P_s) & u > 0 \\
        -C |u| \rho_0 P\,\psi(P_\mathrm{atm}/P) & u < 0 \end{cases}

    Examples
    --------
    >>> from pamid.equations.valve import ValveEquation
    >>> ValveEquation.name, ValveEquation.unit
    ('valve', 'kg/s')
    """

    name: ClassVar[str] = "valve"
    unit: ClassVar[str] = "kg/s"
    channels: ClassVar[tuple[str, ...]] = ("q", "P", "mdot", "u")
    order: ClassVar[int] = 1
    rank: ClassVar[int] = 2

    def residual(self, run: Run) -> Residual:
        """Return the residual flow through both valves, kg/s."""
        p = run.model.params
        supply = run.inlet_pressure()
        u = run.followed_command()

        def passed(P: np.ndarray, u: np.ndarray, supply: Any) -> np.ndarray:
            return valve_flow(
                u,
                P,
                supply,
                p.gas.atmospheric_pressure,
                sonic_conductance=p.valve.sonic_conductance,
                critical_pressure_ratio=p.valve.critical_pressure_ratio,
                reference_density=p.valve.reference_density,
            )

        modelled = np.asarray(passed(run.P, u, supply) + run.added_valve_flow())
        windows = run.windows(self)
        measured, time = windows.mean(run.mdot), windows.time(run.time)
        value = measured - windows.mean(modelled)
        if not run.model.noise:
            return Residual(time, value, measured, np.zeros_like(value))
        weights = kernel(run.n, 1)
        h = 50.0  # Pa: wide enough to step over the infinite slope where flow stops
        slope = (passed(run.P + h, u, supply) - passed(run.P - h, u, supply)) / (2 * h)
        noise, _ = spread(
            (1.0, run.covariances(windows, "mdot", weights)),
            (windows.centre(slope), run.covariances(windows, "P", weights)),
            n_windows=len(time),
        )
        return Residual(time, value, measured, noise)
