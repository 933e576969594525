"""The digital controller of the bench: PD on the angle, pressure loops below it, both muscles always taut."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from ..explained import explained_fields
from .kinematics import contraction
from .parameters import BenchParameters
from .references import PERIOD, Trajectory


@explained_fields
@dataclass(frozen=True)
class Controller:
    r"""PD control at 1 kHz around a nominal pressure.

    The desired pressures are

    .. math:: P_{1,2} = P_\mathrm{atm} + p_0 \pm \left(f \Delta_\mathrm{ff}(q_\mathrm{ref}) + k_p\,(q_\mathrm{ref} - q)
        - k_d\,\dot q\right),

    kept between ``lowest`` above ambient and ``margin`` below supply; the valve command is the error of the pressure
    over the flow that the open valve would pass, saturated at ±1. The gains follow from the bench by pole placement,
    so that one setting serves all muscles.

    Examples
    --------
    >>> from pamid.bench import BenchParameters, Controller, simulate, sine
    >>> stiff = Controller(bandwidth=60.0)  # rad/s
    >>> log = simulate(BenchParameters.for_muscle("B"), [sine(4, 15, 200)], controller=stiff)
    >>> len(log)
    200
    """

    pressure: Annotated[float, "Nominal pressure p₀ of both muscles, Pa gauge."] = 200000.0
    bandwidth: Annotated[float, "Natural frequency of the controlled joint, rad/s."] = 42.0
    damping: Annotated[float, "Damping ratio of the controlled joint."] = 0.8
    pressure_time: Annotated[float, "Time constant of the pressure loops, s."] = 0.008
    lowest: Annotated[float, "Least desired pressure, Pa gauge: the muscles stay taut."] = 30000.0
    margin: Annotated[float, "Least distance of the desired pressure from supply, Pa."] = 50000.0
    forward: Annotated[float, "Share f of the pressure that holds the joint at the reference angle."] = 1.0


def joint_at_rest(params: BenchParameters, pressure: float) -> tuple[float, float]:
    """Return the torque per difference of pressure (N m/Pa) and the stiffness (N m/rad) of the joint at its middle."""
    plant, eps0, r, h = params.plant(), params.muscle.initial_contraction, params.joint.pulley_radius, 1e-5
    slope = (plant.volume_slope(eps0 + h) - plant.volume_slope(eps0 - h)) / (2.0 * h * plant.rest_length)
    return 2.0 * r * plant.volume_slope(eps0) / plant.rest_length, -2.0 * r * pressure * slope * r / plant.rest_length


class RunningController:
    """A `Controller` set up for a batch of runs."""

    def __init__(self, controller: Controller, params: BenchParameters, runs: Sequence[Trajectory]) -> None:
        plant = params.plant()
        q_ref = np.stack([run.q_ref for run in runs], axis=1)
        p0 = controller.pressure

        def per_pressure(muscle: int) -> np.ndarray:
            """Tension per gauge pressure at the reference angle, N/Pa."""
            return plant.volume_slope(contraction(q_ref, muscle, params)) / plant.rest_length

        f1, f2 = per_pressure(1), per_pressure(2)
        offsets = [np.zeros(len(q_ref)) if run.pressure_offset is None else run.pressure_offset for run in runs]
        gauge = p0 + np.stack(offsets, axis=1)
        # Holds the joint at the reference angle, by the nominal equations.
        self.feedforward = gauge * (f2 - f1) / (f1 + f2)
        eps0 = params.muscle.initial_contraction
        torque_per_pressure, stiffness = joint_at_rest(params, p0)
        J, w = params.joint.inertia, controller.bandwidth
        kp = max(J * w * w - stiffness, 0.0) / torque_per_pressure
        kd = max(2.0 * controller.damping * w * J - params.joint.viscous_damping, 0.0) / torque_per_pressure
        self._now, self._last = np.array(kp + kd / PERIOD), np.array(kd / PERIOD)
        self._wanted = controller.forward * self.feedforward + kp * q_ref
        ambient = params.gas.atmospheric_pressure
        self._base = ambient + gauge
        self._constant_base = not np.ptp(self._base)
        self._share = np.array([run.share for run in runs]).T * np.array([[1.0], [-1.0]])
        self._low = np.array(ambient + controller.lowest)
        self._high = np.array(params.gas.supply_pressure - controller.margin)
        # Flow that the fully open valve passes at the nominal pressure, choked both ways.
        C = params.valve.sonic_conductance * params.valve.reference_density
        needed = plant.volume(eps0) / (params.gas.heat_capacity_ratio * plant.RT) / controller.pressure_time
        self._fill = np.array(needed / (C * params.gas.supply_pressure))
        self._vent = np.array(needed / (C * (ambient + p0)))
        sealed = [np.zeros(len(q_ref), dtype=bool) if run.sealed is None else run.sealed for run in runs]
        self._sealed = np.stack(sealed, axis=1)
        self._zero, self._one, self._base_0 = np.array(0.0), np.array(1.0), np.array(self._base[0, 0])
        self._any_sealed = bool(self._sealed.any())
        self._q_before: np.ndarray | None = None

    def initial_pressure(self) -> np.ndarray:
        """Return the pressures that hold each run at its first reference angle, Pa, shape (2, n_runs)."""
        return np.clip(self._base[0] + self._share * self.feedforward[0], self._low, self._high)

    def command(self, k: int, q: np.ndarray, P: np.ndarray) -> np.ndarray:
        """Return the commands at sample ``k`` from the readings of angle (rad) and pressure (Pa)."""
        before = q if self._q_before is None else self._q_before
        self._q_before = q.copy()
        drive = self._wanted[k] - self._now * q
        drive += self._last * before
        u = self._share * drive
        u += self._base_0 if self._constant_base else self._base[k]
        np.maximum(u, self._low, out=u)
        np.minimum(u, self._high, out=u)
        u -= P
        vent = np.minimum(u, self._zero)
        np.maximum(u, self._zero, out=u)
        u *= self._fill
        vent *= self._vent
        u += vent
        np.maximum(u, -self._one, out=u)
        np.minimum(u, self._one, out=u)
        if self._any_sealed:
            u[:, self._sealed[k]] = 0.0
        return u
