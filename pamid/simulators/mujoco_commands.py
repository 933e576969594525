"""The way of a command in MuJoCo: callbacks, the actuator's delay, its range, its gain, and effects in these terms."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from .mujoco_versions import keeps_commands

_STAGES = {True: ((0.0, 0.5, 1.0), (1 / 6, 2 / 3, 1 / 6)), False: ((0.0,), (1.0,))}
"""Where in a step commands are read, and how much each reading counts: by Runge and Kutta, or else."""
_ROUND = 1e-9
_MOST = 100_000
"""Commands that a model that is written may keep: more would take much memory."""
_PASSED = ("actuator_delay", "actuator_lag", "actuator_gain", "actuator_saturation")
"""Effects on a command after which a gain may act as well: of a saturation it changes the limit."""


def _of_fourth_order(integrator: Any) -> bool:
    import mujoco

    return int(integrator) == int(mujoco.mjtIntegrator.mjINT_RK4)


def taken_delays(m: Any) -> dict[int, float]:
    """Return how much a model delays each command, s, and remove the delays, which pamid treats as effects."""
    if not keeps_commands():
        return {}
    delays, step = m.actuator_delay, float(m.opt.timestep)
    places, counts = _STAGES[_of_fourth_order(m.opt.integrator)]
    found = {}
    for k in np.flatnonzero(delays > 0.0).tolist():
        kept, lines = (int(v) for v in m.actuator_history[k])
        read = np.array([delays[k] / step - c for c in places])
        read = np.clip(read if lines else np.ceil(read - _ROUND), 1.0, kept)
        found[k] = round(step * float(read @ counts), 12)
    delays[:] = 0.0
    return found


def put_delay(actuator: Any, seconds: float, option: Any) -> bool:
    """Write a delay into an actuator, half a step longer for Runge–Kutta; return whether MuJoCo can express it."""
    step, fourth_order = float(option.timestep), _of_fourth_order(option.integrator)
    ahead = 0.5 * step if fourth_order else 0.0
    long = step + ahead <= seconds + _ROUND * step < _MOST * step
    if not (keeps_commands() and long):
        return False
    actuator.delay, actuator.interp = seconds + ahead, 1
    actuator.nsample = math.ceil((seconds + ahead) / step - _ROUND)
    return True


def put_range(actuator: Any, limit: float, m: Any, k: int, gain: float) -> bool:
    """Write a command's saturation within an actuator's own range, also past a gain; return whether MuJoCo has one."""
    import mujoco

    if m.opt.disableflags & int(mujoco.mjtDisableBit.mjDSBL_CLAMPCTRL) or len(m.actuator_gaintype) != m.nu:
        return False
    low, high = (float(v) for v in m.actuator_ctrlrange[k]) if m.actuator_ctrllimited[k] else (-np.inf, np.inf)
    if gain != 1.0 and max(1.0, abs(gain)) * limit > min(high, -low):
        return False
    low, high = max(low, -limit), min(high, limit)
    if not low < high:
        return False
    if getattr(actuator, "inheritrange", 0.0):
        actuator.inheritrange = 0.0
    actuator.ctrllimited, actuator.ctrlrange = 1, [low, high]
    return True


def gains_last(
    effects: Iterable[tuple[str, str, Mapping[str, float]]],
) -> list[tuple[str, str, dict[str, float], bool]]:
    """Return effects with those gains of commands at the end, marked, that may act after all else at their input."""
    out = [(name, where, dict(values)) for name, where, values in effects]
    rest, gains = [], []
    for k, (name, where, values) in enumerate(out):
        later = [e for e in out[k + 1 :] if e[1] == where]
        gain = abs(1.0 + values["deviation"]) if name == "actuator_gain" else 0.0
        if gain > 0.0 and all(e[0] in _PASSED for e in later):
            gains.append((name, where, values, True))
            for other, _, changed in later:
                if other == "actuator_saturation":
                    changed["limit"] /= gain
        else:
            rest.append((name, where, values, False))
    return rest + gains
