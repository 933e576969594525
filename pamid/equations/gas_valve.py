"""Gas against valve, where no flow is measured: pressure and volume take what the valve lets through."""

from typing import ClassVar

import numpy as np

from .base import Equation, Residual, spread
from .flow import gas_balance, gas_sensitivities
from .run import Run
from .valve import passed, passed_per_command, passed_slope
from .windows import kernel


class GasValveEquation(Equation):
    r"""Mass flow through the valve at its command minus the gas balance: flow and valve with the flow eliminated.

    .. math:: \frac{\mathrm{d}}{\mathrm{d}t}\left(P^{1/\gamma} V\right) =
        P^{1/\gamma-1} R T\,\dot m_\mathrm{valve}(u, P)
    """

    name: ClassVar[str] = "gas_valve"
    unit: ClassVar[str] = "kg/s"
    channels: ClassVar[tuple[str, ...]] = ("q", "P", "u")
    order: ClassVar[int] = 2
    rank: ClassVar[int] = 4
    combines: ClassVar[tuple[str, ...]] = ("flow", "valve")
    without: ClassVar[str] = "mdot"

    def residual(self, run: Run) -> Residual:
        """Return the residual flow of both muscles, kg/s."""
        windows, flow = run.windows(self), passed(run)
        # A command is held from sample to sample; what follows it with a lag of its own goes there gradually.
        value = gas_balance(run, windows, flow, share=1.0 if run.follows_gradually() else 0.0)
        time, modelled = windows.time(run.time[:-1]) + run.dt / 2, windows.mean(flow[:-1])
        if not run.model.noise:
            return Residual(time, value, modelled, np.zeros_like(value))
        noise, shared = spread(
            *gas_sensitivities(run, windows),
            (windows.centre(passed_slope(run)), run.covariances(windows, "P", kernel(run.n, 2))),
            (windows.centre(passed_per_command(run)), run.covariances(windows, "u", kernel(run.n, 2))),
            n_windows=len(time),
        )
        return Residual(time, value, modelled, noise, shared)
