"""States of a MuJoCo model a sample later, from many states at once: by `mujoco.rollout`, in threads."""

from __future__ import annotations

import os
from typing import Any

import numpy as np

BEGIN = -1000.0
"""Time at which samples begin, s: a model that goes beyond all bounds begins anew at rest, at 0."""
CHUNK = 2**24
"""Memory for the inputs and states of the rows of one call, bytes."""


class SingleSteps:
    """Steps of a model over one sample after another, from where it was put; an answer that ran away is NaN."""

    def __init__(self, m: Any, d: Any, starts: np.ndarray, ends: np.ndarray, count: int) -> None:
        self._m, self._d, self._count = m, d, count
        self._starts, self._change, self._moves = starts, ends - starts, not np.array_equal(starts, ends)

    def advance(self, k: int) -> None:
        """Take the steps of a sample."""
        import mujoco as mj

        m, d, nu = self._m, self._d, self._m.nu
        d.time, d.qacc_warmstart[:] = BEGIN, 0.0  # rows do not depend on their neighbours
        for j in range(self._count):
            if self._moves:
                u = self._starts[:, k] + (j + 0.5) / self._count * self._change[:, k]
                d.ctrl[:], d.qfrc_applied[:] = u[:nu], u[nu:]
            mj.mj_step(m, d)

    def read(self) -> np.ndarray:
        """Return the state after the steps."""
        out = np.ravel(np.column_stack([self._d.qpos, self._d.qvel]))
        arrived = abs(self._d.time - BEGIN - self._count * self._m.opt.timestep) < 0.5 * self._m.opt.timestep
        return out if arrived else np.full_like(out, np.nan)


def rolled(m: Any, x: np.ndarray, starts: np.ndarray, ends: np.ndarray, count: int) -> np.ndarray:
    """Return the states after so many steps, shape (2 nv, n); NaN where a row got none.

    States are positions and speeds in turn; inputs, commands before forces at joints, go straight from start to end.
    """
    import mujoco as mj
    from mujoco import rollout

    kinds, nv = mj.mjtState, m.nv
    spec, whole = int(kinds.mjSTATE_CTRL | kinds.mjSTATE_QFRC_APPLIED), int(kinds.mjSTATE_FULLPHYSICS)
    first = np.empty(mj.mj_stateSize(m, whole))
    out, finite = np.full(x.shape, np.nan), np.isfinite(np.concatenate([x, starts, ends])).all(axis=0).nonzero()[0]
    share = ((np.arange(count) + 0.5) / count)[:, None]
    rows = max(CHUNK // (8 * count * (len(first) + 2 * len(starts))), 1)
    workers = [mj.MjData(m) for _ in range(min(threads_for(m), rows, x.shape[1]))]
    mj.mj_getState(m, workers[0], first, whole)
    first[0] = BEGIN
    for some in (finite[k : k + rows] for k in range(0, len(finite), rows)):
        state = np.tile(first, (len(some), 1))
        state[:, 1 : nv + 1], state[:, nv + 1 : 2 * nv + 1] = x[0::2, some].T, x[1::2, some].T
        given, rest = starts[:, some].T[:, None] + share * (ends - starts)[:, some].T[:, None], np.zeros((1, nv))
        # Rows do not depend on their neighbours: each begins without what the solver knew of another one.
        last = rollout.rollout(m, workers, state, given, control_spec=spec, initial_warmstart=rest)[0][:, -1]
        good = np.abs(last[:, 0] - BEGIN - count * m.opt.timestep) < 0.5 * m.opt.timestep
        out[0::2, some[good]], out[1::2, some[good]] = last[good, 1 : nv + 1].T, last[good, nv + 1 : 2 * nv + 1].T
    return out


def threads_for(m: Any) -> int:
    """Return the number of threads: those of this process, but one where an error of MuJoCo in another ends it.

    The only errors of a model that was loaded are contacts and constraints beyond its memory.
    """
    import joblib
    import mujoco as mj

    asked = os.environ.get("OMP_NUM_THREADS", "").partition(",")[0].strip()
    touching = m.npair or (np.any(m.geom_contype) and np.any(m.geom_conaffinity))
    constraints = 2 * m.njnt + m.nv + 6 * m.neq + 3 * m.ntendon
    roomy = m.narena > 16 * 8 * (constraints + m.nv) ** 2
    if not roomy or (touching and not m.opt.disableflags & int(mj.mjtDisableBit.mjDSBL_CONTACT)):
        return 1
    return max(int(asked), 1) if asked.isdigit() else int(joblib.cpu_count())
