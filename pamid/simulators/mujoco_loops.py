"""States of a MuJoCo model that close its loops: joints in one move only together.

An equality constraint ties positions of joints to each other, and thereby their speeds. From a state that tears a loop
open, a model is thrown: MuJoCo closes it within a few steps by forces as large as that takes.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

_PARTS = 16
"""Parts of the way from where a model begins to the first state: of several ways to close a loop, it keeps its own."""
_ROUNDS = 8
_CLOSED = 1e-9
_RANK = 1e-6


class Loops:
    """Closes the loops of a model by joints that are not known."""

    def __init__(self, m: Any, d: Any) -> None:
        import mujoco

        self._mj, self._m, self._d = mujoco, m, d
        self._equality = int(mujoco.mjtConstraint.mjCNSTR_EQUALITY)

    def closed(self, x: np.ndarray, known: Sequence[bool], along: bool) -> np.ndarray:
        """Return states without a gap, shape (n_states, n); `along` a path each begins from the one before it."""
        d, out = self._d, np.empty_like(x)
        (q, v), (q_known, v_known) = ((one[0::2], one[1::2]) for one in (x, np.array(known)))
        at, first = np.array(self._m.qpos0), q[:, :1]
        before = at[:, None] + np.arange(1, _PARTS) / _PARTS * (first - at[:, None]) if along else q[:, :0]
        for k, given in enumerate(np.hstack([before, q]).T, start=-before.shape[1]):
            d.qpos[:], d.qvel[:] = np.where(q_known, given, at) if along else given, v[:, max(k, 0)]
            self._close(q_known, v_known)
            at = np.array(d.qpos)
            if k >= 0:
                out[0::2, k], out[1::2, k] = at, d.qvel
        return out

    def _close(self, q_known: np.ndarray, v_known: np.ndarray) -> None:
        """Move joints that are not known to where loops are closed as far as they can."""
        d, joints = self._d, ~q_known
        for _ in range(_ROUNDS if joints.any() else 0):
            gap, slopes = self._gap()
            if not np.max(np.abs(gap), initial=0.0) > _CLOSED:
                break
            d.qpos[joints] -= np.linalg.lstsq(slopes[:, joints], gap, rcond=_RANK)[0]
        if (joints := ~v_known).any():
            slopes = self._gap()[1]
            d.qvel[joints] -= np.linalg.lstsq(slopes[:, joints], slopes @ d.qvel, rcond=_RANK)[0]

    def _gap(self) -> tuple[np.ndarray, np.ndarray]:
        """Return by how much loops are open, and the slopes of that over the positions."""
        mj, m, d = self._mj, self._m, self._d
        mj.mj_fwdPosition(m, d)
        rows = d.efc_type[: d.nefc] == self._equality
        slopes, one = np.empty((d.nefc, m.nv)), np.zeros(d.nefc)
        for k, joint in enumerate(np.eye(m.nv)):
            mj.mj_mulJacVec(m, d, one, joint)
            slopes[:, k] = one
        return np.array(d.efc_pos[: d.nefc][rows]), slopes[rows]
