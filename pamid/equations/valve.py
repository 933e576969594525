"""The valve equation: mass flow through a servo valve after ISO 6358."""

from typing import ClassVar

import numpy as np

from .base import Equation, Residual, spread
from .run import Run, through_valves
from .timing import timed
from .windows import kernel


class ValveEquation(Equation):
    r"""Measured mass flow minus that through the valve at its command; where readings lag, fitted to within a sample.

    .. math:: \dot m - \begin{cases} C u \rho_0 P_s\,\psi(P/P_s) & u > 0 \\
        -C |u| \rho_0 P\,\psi(P_\mathrm{atm}/P) & u < 0 \end{cases}
    """

    name: ClassVar[str] = "valve"
    unit: ClassVar[str] = "kg/s"
    channels: ClassVar[tuple[str, ...]] = ("q", "P", "mdot", "u")
    order: ClassVar[int] = 1
    rank: ClassVar[int] = 2

    def residual(self, run: Run) -> Residual:
        """Return the residual flow through both valves, kg/s."""
        modelled = passed(run)
        windows = run.windows(self)
        measured, time = windows.mean(run.mdot), windows.time(run.time)
        value = measured - windows.mean(modelled)
        if "mdot" in run.remembered:
            late = windows.mean(np.diff(modelled, axis=0, prepend=modelled[:1]))
            value = timed(value, late, 1.0, windows.parts)
        if not run.model.noise:
            return Residual(time, value, measured, np.zeros_like(value))
        weights = kernel(run.n, 1)
        noise, _ = spread(
            (1.0, run.covariances(windows, "mdot", weights)),
            (windows.centre(passed_slope(run)), run.covariances(windows, "P", weights)),
            n_windows=len(time),
        )
        return Residual(time, value, measured, noise)


def passed(run: Run, shift: float = 0.0) -> np.ndarray:
    """Return the flow that both valves let through at their commands, kg/s, at pressures shifted by so many Pa."""
    p, command, inlet = run.model.params, run.followed_command(), run.inlet_pressure()

    def flow() -> np.ndarray:
        return through_valves(p, command, run.P + shift, inlet)

    nominal = command is run.u and np.ndim(inlet) == 0
    through = run.kept(("passed", shift, float(inlet), p.gas, p.valve), flow) if nominal else flow()
    return np.asarray(through + run.added_valve_flow())


def passed_slope(run: Run) -> np.ndarray:
    """Return the derivative of that by the muscle's pressure, kg/(s Pa)."""
    h = 50.0  # Pa: wide enough to step over the infinite slope where flow stops
    return (passed(run, h) - passed(run, -h)) / (2 * h)


def passed_per_command(run: Run) -> np.ndarray:
    """Return the flow through a fully open nominal valve, in the direction of its command, kg/s."""
    p = run.model.params
    way = np.where(run.u > 0, 1.0, -1.0)
    return np.asarray(way * through_valves(p, way, run.P, p.gas.supply_pressure))
