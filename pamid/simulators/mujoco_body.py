r"""A body of a MuJoCo model with a payload: a point mass at a place in the body's frame.

With the body's own mass m and inertia I about its centre c, and the payload's mass w at r, both together have

.. math:: M = m + w, \qquad C = \frac{m c + w r}{M}, \qquad J = I + m\,S(c - C) + w\,S(r - C), \qquad
    S(d) = |d|^2 1 - d d^\top

References
----------
R. Featherstone, "Rigid Body Dynamics Algorithms", Springer, 2008, section 2.13.
https://doi.org/10.1007/978-1-4899-7560-7
"""

from __future__ import annotations

from typing import Any

import numpy as np

PLACE = ("payload_x", "payload_y", "payload_z")
"""Numbers of a payload's place, m."""
PAYLOAD = ("payload_mass", *PLACE)
NEAR = 0.1
"""Distance of a centre from an axis, as a share of that from the joint, up to which the body turns about itself."""


class Body:
    """A body whose numbers are read and written by name: its own mass, and those of `PAYLOAD`."""

    def __init__(self, m: Any, k: int) -> None:
        self._m, self._k = m, k
        self._own = tuple(np.array(a[k]) for a in (m.body_mass, m.body_ipos, m.body_iquat, m.body_inertia))
        self._numbers = {"body_mass": float(m.body_mass[k])} | dict.fromkeys(PAYLOAD, 0.0)

    def __getitem__(self, name: str) -> float:
        return self._numbers[name]

    def __setitem__(self, name: str, value: float) -> None:
        self._numbers[name] = float(value)
        self._write()

    def _write(self) -> None:
        m, k, numbers = self._m, self._k, self._numbers
        own, centre, turn, inertia = self._own
        mass, load = numbers["body_mass"], numbers["payload_mass"]
        inertia = inertia * mass / own if own > 0.0 else inertia  # a heavier body of the same shape
        if load > 0.0:
            place = np.array([numbers[name] for name in PLACE])
            both = (mass * centre + load * place) / (mass + load)
            J = _turned(turn, inertia) + mass * _spread(centre - both) + load * _spread(place - both)
            mass, centre, (inertia, turn) = mass + load, both, _principal(J)
            _complicate(m, k)
        m.body_mass[k], m.body_ipos[k], m.body_iquat[k], m.body_inertia[k] = mass, centre, turn, inertia


def _complicate(m: Any, k: int) -> None:
    """Take back that a body turns about its own centre, which MuJoCo notes at compilation to save work."""
    if m.body_simple[k]:
        dof = int(m.body_dofadr[k])
        m.body_simple[k] = m.body_sameframe[k] = 0
        # Each counts the simple ones from itself on.
        m.dof_simplenum[: dof + 1] = np.minimum(m.dof_simplenum[: dof + 1], dof - np.arange(dof + 1))


def hands(m: Any) -> list[int]:
    """Return the bodies that a payload is likely on: ends of chains and what holds a finger, not flanges."""
    ends = {k for k in range(1, m.nbody) if m.body_jntnum[k]}
    for k in list(ends):
        ends.discard(_holder(m, k))
    found = ends | {_holder(m, k) for k in ends if not _is_flange(m, k)} - {0}
    # The joints of a simple body are compiled as independent: what couples them could not be computed.
    return sorted(k for k in found if not (m.body_simple[k] and m.body_dofnum[k] > 1))


def _holder(m: Any, k: int) -> int:
    """Return the next body with a joint on the way to the world, which is 0."""
    k = int(m.body_parentid[k])
    while k and not m.body_jntnum[k]:
        k = int(m.body_parentid[k])
    return k


def _is_flange(m: Any, k: int) -> bool:
    import mujoco

    joint = int(m.body_jntadr[k]) + int(m.body_jntnum[k]) - 1
    off = m.body_ipos[k] - m.jnt_pos[joint]
    turns = int(m.jnt_type[joint]) == int(mujoco.mjtJoint.mjJNT_HINGE)
    return turns and bool(np.linalg.norm(np.cross(m.jnt_axis[joint], off)) <= NEAR * np.linalg.norm(off))


def _spread(d: np.ndarray) -> np.ndarray:
    return d @ d * np.eye(3) - np.outer(d, d)


def _turned(quaternion: np.ndarray, inertia: np.ndarray) -> np.ndarray:
    """Return a matrix of inertia from its principal values and their axes."""
    import mujoco

    axes = np.zeros(9)
    mujoco.mju_quat2Mat(axes, quaternion)
    R = axes.reshape(3, 3)
    return np.asarray(R @ np.diag(inertia) @ R.T)


def _principal(J: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the principal values of a matrix of inertia, and the quaternion of their axes."""
    import mujoco

    values, axes, quaternion = np.zeros(3), np.zeros(9), np.zeros(4)
    mujoco.mju_eig3(values, axes, quaternion, J.ravel())
    return values, quaternion
