r"""A body that moves freely in a MuJoCo model, by six joints: three slides and the hinges of yaw, pitch and roll.

A free joint has a quaternion as its position, whose rate is no state. The same body on six massless joints moves alike,

.. math:: R = R_z(\psi)\,R_y(\theta)\,R_x(\varphi)

but for a pitch of ±90°, where yaw and roll are one. Its positions have rates that are states, and a force or a friction
along each of them has a name.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ..errors import SimulatorSyntaxError
from .mujoco_versions import spec_of, writes_free_bodies

WAYS = {"x": 0, "y": 1, "z": 2, "yaw": 2, "pitch": 1, "roll": 0}
"""The axis of each joint, from the world to the body: of slides along it and of hinges about it."""


def is_free(m: Any) -> bool:
    """Return whether a model has a body that moves freely."""
    import mujoco as mj

    return bool(np.any(m.jnt_type == int(mj.mjtJoint.mjJNT_FREE)))


def spec_with_joints(path: Path) -> Any:
    """Return a model as it is written, with hinges and slides for its free joints."""
    import mujoco as mj

    spec = spec_of(path)
    if not writes_free_bodies():
        return spec
    free = [joint for joint in spec.joints if joint.type == mj.mjtJoint.mjJNT_FREE]
    taken = {joint.name for joint in spec.joints}
    for joint in free:
        body, own = joint.parent, f"{joint.name or joint.parent.name or 'free'}_"
        prefix = own if len(free) > 1 or taken & set(WAYS) else ""
        spec.delete(joint)
        place = np.array(body.pos, dtype=float)
        body.quat = [1.0, 0.0, 0.0, 0.0]  # the angles count from the axes of the world
        for k, (way, axis) in enumerate(WAYS.items()):
            added = body.add_joint(name=f"{prefix}{way}", axis=np.eye(3)[axis])
            added.type = mj.mjtJoint.mjJNT_SLIDE if k < 3 else mj.mjtJoint.mjJNT_HINGE
            added.ref = place[axis] if k < 3 else 0.0
            for word in ("damping", "stiffness", "armature", "frictionloss"):  # defaults are for other joints
                setattr(added, word, np.zeros_like(getattr(added, word)))
            added.limited = added.actfrclimited = mj.mjtLimited.mjLIMITED_FALSE
    if free:
        for key in list(spec.keys):  # of quaternions
            spec.delete(key)
    return spec


def with_joints(path: Path, m: Any) -> Any:
    """Return a compiled model with hinges and slides for its free joints; as it is without any."""
    if not is_free(m):
        return m
    if not writes_free_bodies():
        raise SimulatorSyntaxError(
            f"{path} has a free joint, which this MuJoCo cannot replace.",
            "hinges and slides",
            "Install MuJoCo 3.3 or newer.",
        )
    return spec_with_joints(path).compile()
