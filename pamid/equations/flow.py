"""The flow equation: the first law for the gas in a muscle, in integral form."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from ..laws.gas import entropic_content, entropic_supply
from .base import Equation, Residual, spread
from .run import SIGNS, Run
from .windows import average, centre, kernel, starts


class FlowEquation(Equation):
    r"""Measured mass flow minus what pressure and volume say.

    Instead of :math:`\dot m - \dot P V/(\gamma R T) - P\dot V/(R T)`, which needs the rate of a noisy pressure, its
    exact integral is tested,

    .. math:: \frac{\mathrm{d}}{\mathrm{d}t}\left(P^{1/\gamma} V\right) = P^{1/\gamma-1} R T\,\dot m

    divided by the window's :math:`P^{1/\gamma-1} R T`, so that the residual is a flow in kg/s. The flow of a sample
    counts until the next sample: a valve follows commands that are held in between.
    """

    name: ClassVar[str] = "flow"
    unit: ClassVar[str] = "kg/s"
    channels: ClassVar[tuple[str, ...]] = ("q", "P", "mdot")
    order: ClassVar[int] = 2
    rank: ClassVar[int] = 1

    def residual(self, run: Run) -> Residual:
        """Return the residual flow of both muscles, kg/s."""
        gas = run.model.params.gas
        gamma, RT = gas.heat_capacity_ratio, gas.gas_constant * gas.temperature
        supplied = entropic_supply(
            run.P,
            run.mdot - run.added_flow(),
            heat_capacity_ratio=gamma,
            gas_constant=gas.gas_constant,
            temperature=gas.temperature,
        )
        content = entropic_content(run.P, run.volume, heat_capacity_ratio=gamma)
        gain = np.diff(content, axis=0) / run.dt
        n, first = run.n, starts(len(gain), run.n, 2)
        scale = RT * average(run.P[:-1] ** (1.0 / gamma - 1.0), n, 2, first)
        weights = kernel(n, 2)
        change = np.convolve(weights, [1.0, -1.0]) / run.dt
        joint, muscle = run.model.params.joint, run.model.params.muscle
        turn = SIGNS * joint.pulley_radius / muscle.rest_length
        noise = spread(
            (1.0, run.noise("mdot"), weights),
            (centre(run.volume, n, 2, first) / (gamma * RT), run.noise("P"), change),
            (centre(run.P * run.volume_slope, n, 2, first) * turn / RT, run.noise("q"), change),
            n_windows=len(first),
        )
        return Residual(
            average(run.time[:-1], n, 2, first) + run.dt / 2,
            average(supplied[:-1] - gain, n, 2, first) / scale,
            average(run.mdot[:-1], n, 2, first),
            noise,
        )
