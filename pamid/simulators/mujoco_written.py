"""A MuJoCo model with its numbers and effects as MJCF; effects without an MJCF element are named."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from .mujoco_actuators import FED_BACK, FORCE, put_force_range, put_gain
from .mujoco_body import PAYLOAD
from .mujoco_commands import gains_last, put_delay, put_range
from .mujoco_free import spec_with_joints
from .mujoco_versions import geoms_of, spec_item, spec_text

CALLBACKS = '''"""corrected.xml with what MJCF has no element for, as callbacks of MuJoCo. Written by pamid.

model, acting = load()
data = mujoco.MjData(model)
with acting:
    mujoco.mj_step(model, data)
"""

from pathlib import Path

from pamid.simulators.mujoco_callback import corrected


def load():
    """Return the model, and the effects of corrected.toml that act while they are a context."""
    return corrected(Path(__file__).with_name("corrected.toml"))
'''
"""corrected.py, where MJCF has no element for an effect."""

NUMBERS = {
    "body_mass": "body", "dof_damping": "joint", "dof_armature": "joint", "dof_frictionloss": "joint",
    "jnt_stiffness": "joint", "actuator_gear": "actuator", "actuator_kp": "actuator", "actuator_kv": "actuator",
    FORCE: "actuator", **dict.fromkeys(PAYLOAD, "body"),
}  # fmt: skip
"""What has a number of each kind."""
Found = tuple[str, str, dict[str, float]]


def written(simulator: Any, actuators: Mapping[str, str]) -> tuple[str, list[Found]]:
    """Return a MuJoCo model as MJCF with `actuators` renamed, and the effects that MJCF has no element for."""
    spec, shown, m = spec_with_joints(simulator.path), simulator.in_elements(), simulator.compiled()
    for name, parameter in shown.parameters.items():
        kind, _, thing = name.partition(".")
        if kind in PAYLOAD:
            continue
        item = spec_item(spec, m, NUMBERS[kind], thing)
        if kind == "body_mass":
            _scale_mass(item, m, parameter.value / shown.own(name))
        elif kind in FED_BACK:
            put_gain(item, FED_BACK[kind], parameter.value)
        elif kind == FORCE:
            put_force_range(item, m, list(actuators.values()).index(thing))
        else:
            _put(item, kind.partition("_")[2], parameter.value)
    for body, load in simulator.carried().items():
        mass, *place = (simulator.get(load.numbers[word]) for word in ("value", "x", "y", "z"))
        if mass > 0.0:
            _add_payload(spec_item(spec, m, "body", body), f"{body}_payload", mass, place)
    rest = list[Found]()
    for name, where, values, last in gains_last(shown.effects):
        if last and where in actuators:
            actuator = spec_item(spec, m, "actuator", actuators[where])
            _put(actuator, "gainprm", float(actuator.gainprm[0]) * (1.0 + values["deviation"]))
        else:
            rest.append((name, where, values))
    gains = [(where, 1.0 + values["deviation"]) for _, where, values, last in gains_last(simulator.effects) if last]
    for k, (where, name) in enumerate(actuators.items()):
        if mine := [e for e in rest if e[1] == where]:
            gain = math.prod(g for at, g in gains if at == where)
            put = _put_command(spec_item(spec, m, "actuator", name), mine, m, k, gain)
            rest = [e for e in rest if not any(e is p for p in put)]
    return spec_text(spec), rest


def _put_command(actuator: Any, mine: Sequence[Found], m: Any, k: int, gain: float) -> list[Found]:
    """Write the effects on a command into its actuator and return them: delays, and a saturation that acts last."""
    delays, limits, put = [e for e in mine if e[0] == "actuator_delay"], list[Found](), list[Found]()
    if delays and put_delay(actuator, sum(e[2]["delay"] for e in delays), m.opt):
        put += delays
    for e in reversed([e for e in mine if e[0] != "actuator_delay"]):
        if e[0] != "actuator_saturation":
            break
        limits.append(e)
    if limits and put_range(actuator, min(e[2]["limit"] for e in limits), m, k, gain):
        put += limits
    return put


def _scale_mass(body: Any, m: Any, ratio: float) -> None:
    """Make a body as it is written heavier, its shape kept."""
    if getattr(body, "explicitinertial", False):
        body.mass *= ratio
        body.inertia = np.array(body.inertia) * ratio
        body.fullinertia = np.array(body.fullinertia) * ratio  # NaN where it is not given
        return
    for geom in geoms_of(body, m):
        if not np.isnan(geom.mass):
            geom.mass *= ratio
        else:
            geom.density *= ratio


def _add_payload(body: Any, name: str, mass: float, place: Sequence[float]) -> None:
    """Put a point mass on a body as it is written."""
    load = body.add_body()
    load.name, load.explicitinertial = name, True
    load.mass, load.ipos, load.inertia = mass, list(place), [0.0] * 3


def _put(item: Any, word: str, value: float) -> None:
    now = np.array(getattr(item, word), dtype=float)
    if now.ndim and now.size > 1:
        now[0] = value
        setattr(item, word, now)
    else:
        setattr(item, word, value)
