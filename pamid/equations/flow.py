"""The flow equation: the first law for the gas in a muscle, in integral form."""

from typing import ClassVar

import numpy as np

from ..laws.gas import entropic_content
from ..laws.valve import flow_function
from .base import Equation, Residual, spread
from .run import SIGNS, Run
from .timing import timed
from .windows import Windows, kernel

_MOST = 2.0
"""Largest share of a ramp in the flow between two samples: that of a flow that changes right after the first."""


class FlowEquation(Equation):
    r"""Measured mass flow minus that of pressure and volume, integrated exactly: no rate of a noisy pressure, kg/s.

    .. math:: \frac{\mathrm{d}}{\mathrm{d}t}\left(P^{1/\gamma} V\right) = P^{1/\gamma-1} R T\,\dot m

    Whether the valve's flow is held, linear or late between samples is fitted to each run.
    """

    name: ClassVar[str] = "flow"
    unit: ClassVar[str] = "kg/s"
    channels: ClassVar[tuple[str, ...]] = ("q", "P", "mdot")
    order: ClassVar[int] = 2
    rank: ClassVar[int] = 1

    def residual(self, run: Run) -> Residual:
        """Return the residual flow of both muscles, kg/s."""
        windows = run.windows(self)
        value = gas_balance(run, windows, run.mdot)
        time, measured = windows.time(run.time[:-1]) + run.dt / 2, windows.mean(run.mdot[:-1])
        if not run.model.noise:
            return Residual(time, value, measured, np.zeros_like(value))
        noise, shared = spread(
            (1.0, run.covariances(windows, "mdot", kernel(run.n, 2))),
            *gas_sensitivities(run, windows),
            n_windows=len(time),
        )
        return Residual(time, value, measured, noise, shared)


def gas_balance(run: Run, windows: Windows, mdot: np.ndarray, share: float | None = None) -> np.ndarray:
    """Return flow minus gas balance over windows of order 2, kg/s.

    The flow is held between samples for a share of 0, linear for 1, the next sample's for 2; by default it is fitted.
    """
    per_flow, scale, stored = _stored(run, windows)
    if mdot is run.channels.get("mdot"):
        p = run.model.params
        key = ("supplied", id(windows), p.gas, p.valve.critical_pressure_ratio)
        supplied, ramp = run.kept(key, lambda: _supplied(run, windows, mdot, per_flow) / scale)
    else:
        supplied, ramp = _supplied(run, windows, mdot, per_flow) / scale
    held = supplied - stored
    if (added := run.added_flow()) is not None:
        held = held - windows.mean(added * (per_flow[1:] + per_flow[:-1]) / 2) / scale
    if share is not None:
        return np.asarray(held + share * ramp)
    return timed(held, ramp, _MOST, windows.parts)


def _stored(run: Run, windows: Windows) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the change of the gas's content by a flow, that over windows, and the flow that the nominal gas takes."""
    gas = run.model.params.gas
    gamma, RT = gas.heat_capacity_ratio, gas.gas_constant * gas.temperature
    per_flow = run.kept(("per flow", RT, gamma), lambda: RT * run.P ** (1.0 / gamma - 1.0))

    def windowed() -> np.ndarray:
        gain = np.diff(entropic_content(run.P, run.volume, heat_capacity_ratio=gamma), axis=0) / run.dt
        scale = windows.mean(per_flow[:-1])
        return np.stack([scale, windows.mean(gain) / scale])

    scale, stored = run.kept(("stored", id(windows), RT, gamma, *run.shape), windowed)
    return per_flow, scale, stored


def _supplied(run: Run, windows: Windows, mdot: np.ndarray, per_flow: np.ndarray) -> np.ndarray:
    """Return the content that a held flow adds over windows, and the rest if it is linear to its next sample."""
    supplied = per_flow * mdot
    growth = (1.0 + _opening(run, mdot)) * (per_flow[1:] / per_flow[:-1])
    drift = supplied[:-1] * (growth - 1.0) / 2
    return np.stack([windows.mean(supplied[:-1] + drift), windows.mean(np.diff(supplied, axis=0) / 2 - drift)])


def gas_sensitivities(run: Run, windows: Windows) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return the influence of the noise of pressure and angle on that, as `spread` takes it."""
    p = run.model.params
    RT = p.gas.gas_constant * p.gas.temperature
    change = np.convolve(kernel(run.n, 2), [1.0, -1.0]) / run.dt
    turn = SIGNS * p.joint.pulley_radius / p.muscle.rest_length
    capacity = run.volume / (p.gas.heat_capacity_ratio * RT) + run.added_capacity()
    return [
        (windows.centre(capacity), run.covariances(windows, "P", change)),
        (windows.centre(run.P * run.volume_slope) * turn / RT, run.covariances(windows, "q", change)),
    ]


def _opening(run: Run, mdot: np.ndarray) -> np.ndarray:
    """Return the relative growth of the flow at a held command to the next sample, by the flow's sign."""
    gas, b = run.model.params.gas, run.model.params.valve.critical_pressure_ratio
    key = ("opening", gas.supply_pressure, gas.atmospheric_pressure, b)
    if key not in run.smoothed:
        least = 0.05 * gas.supply_pressure  # near balance the flow is too small to matter
        filling = np.maximum(gas.supply_pressure * flow_function(run.P / gas.supply_pressure, b), least)
        venting = np.maximum(run.P * flow_function(gas.atmospheric_pressure / run.P, b), least)
        run.smoothed[key] = np.stack([filling[1:] / filling[:-1], venting[1:] / venting[:-1]]) - 1.0
    filling, venting = run.smoothed[key]
    return np.where(mdot[:-1] > 0, filling, venting)
