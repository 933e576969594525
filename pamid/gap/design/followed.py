r"""How the bench follows its reference: the gains of its controller, estimated from its logs.

A controller that is softer than the simulator's moves the joint less, and the information of a run grows with the
square of the motion. The difference of the two pressures is the controller's demand less what the valves have yet to
supply:

.. math:: \tfrac{1}{2}(P_1 - P_2) = f \Delta_\mathrm{ff}(q_\mathrm{ref}) + k_p (q_\mathrm{ref} - q) - k_d \dot q
    - \tfrac{1}{2} \big(c(u_1) - c(u_2)\big), \qquad c(u) = c_+ \max(u, 0) + c_- \min(u, 0)

which is linear in f, k_p, k_d and c; a prior about the simulator's own gains fixes what slow runs leave open.
"""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
import pandas as pd

from ...bench import Controller
from ...bench.controller import joint_at_rest
from ...bench.kinematics import contraction
from ...bench.parameters import BenchParameters

READ = ("q_ref", "q", "P1", "P2", "u1", "u2")
SMOOTH = 15
"""Samples over which the angle is smoothed before its rate is taken: the planned motion is the same with half and with
twice as many (``benchmarks/settings.py --computed``)."""
PRIOR = 0.001
"""Weight of the simulator's own gains, as a share of the logs' information on each: it decides what they leave open."""
SETTINGS = {"forward": (0.0, 1.5), "bandwidth": (4.0, 80.0), "damping": (0.1, 3.0), "pressure_time": (3e-3, 0.1)}
"""Settings that are fitted, and the range in which a bench can be controlled: a guard; ranges twice as wide give
the same motion."""


def controller_of(logs: Iterable[pd.DataFrame], params: BenchParameters) -> Controller:
    """Return the controller that moves the simulator as the bench is moved in its logs."""
    own = Controller()
    runs = [run for log in logs if set(READ) <= set(log.columns) for _, run in log.groupby("trajectory", sort=False)]
    told = [_told(run) for run in runs if len(run) > 4 * SMOOTH]
    if not told:
        return own
    x = np.concatenate(told)
    ambient, half = params.gas.atmospheric_pressure, 0.5 * (x[:, 2] - x[:, 3])
    p0 = float(np.median(0.5 * (x[:, 2] + x[:, 3])) - ambient)
    plant, J = params.plant(), params.joint.inertia
    f1, f2 = (plant.volume_slope(contraction(x[:, 0], m, params)) for m in (1, 2))
    torque, stiffness = joint_at_rest(params, p0)
    needed = plant.volume(params.muscle.initial_contraction) / (params.gas.heat_capacity_ratio * plant.RT)
    opened = params.valve.sonic_conductance * params.valve.reference_density * params.gas.supply_pressure / needed
    w = own.bandwidth
    usual = np.array(
        [
            own.forward,
            max(J * w * w - stiffness, 0.0) / torque,
            max(2.0 * own.damping * w * J - params.joint.viscous_damping, 0.0) / torque,
            own.pressure_time * opened,
            own.pressure_time * opened * (ambient + p0) / params.gas.supply_pressure,
        ]
    )
    fill, vent = np.maximum(x[:, 4:6], 0.0), np.minimum(x[:, 4:6], 0.0)
    columns = [p0 * (f2 - f1) / (f1 + f2), x[:, 0] - x[:, 1], -x[:, 6]]
    A = np.column_stack([*columns, *(-0.5 * (u[:, 0] - u[:, 1]) for u in (fill, vent))]) * usual
    prior = PRIOR * np.sum(np.square(A), axis=0)
    times = np.linalg.solve(A.T @ A + np.diag(prior), A.T @ half + prior)
    forward, kp, kd = (usual * times)[:3]
    bandwidth = float(np.sqrt(max(kp * torque + stiffness, 1e-9) / J))
    damping = float((kd * torque + params.joint.viscous_damping) / (2.0 * bandwidth * J))
    found = {
        "forward": forward,
        "bandwidth": bandwidth,
        "damping": damping,
        "pressure_time": own.pressure_time * times[3:].mean(),
    }
    return replace(own, pressure=p0, **{k: float(np.clip(v, *SETTINGS[k])) for k, v in found.items()})


def _told(run: pd.DataFrame) -> np.ndarray:
    """Return reference, angle, pressures, commands and the rate of the angle, without shut valves and the ends."""
    t = run["time"].to_numpy(dtype=float)
    x = run[list(READ)].to_numpy(dtype=float)
    box = np.ones(SMOOTH) / SMOOTH
    x = np.column_stack([np.convolve(column, box, "same") for column in x.T])
    x = np.column_stack([x, np.gradient(x[:, 1], t)])[SMOOTH:-SMOOTH]
    return np.asarray(x[np.any(x[:, 4:6] != 0.0, axis=1) & np.all(np.isfinite(x), axis=1)])
