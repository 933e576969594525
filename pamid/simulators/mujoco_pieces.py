r"""Accelerations of a MuJoCo model under other forces than those of an evaluated motion.

At a given position and speed MuJoCo minimises, with H the inertia of the joints and of the constraints that yield,

.. math:: \tfrac12 (a - a_0)^\top M (a - a_0) + \sum_i s_i(J_i a - r_i), \qquad
    a(f + \Delta f) = a(f) + H^{-1} \Delta f, \quad H = M + \sum_{i \text{ quadratic}} D_i J_i^\top J_i

as long as each dry friction, limit and contact stays in its piece of :math:`s_i`. So the inertia is inverted once for
each instant, all inputs follow from it, and only instants at which a joint begins to slip or leaves a limit are
evaluated again.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from .mujoco_versions import limits_tendons, write_full_inertia, write_moments

LEAST_ROWS = 200
"""Fewer instants are evaluated one by one just as fast."""
WORTH = 5
"""Evaluations of a motion before its pieces are made, which costs about as much (SO-ARM100): never is more than twice
the least spent, however often the motion is asked for."""
MOST_BYTES = 128 * 2**20
"""Size of the cached pieces of one simulator."""
AGREES = 1e-6
"""Convergence of a model's solver at which its answers count as equal, as a share of their size."""
CHECKED = 32
"""Instants at which the pieces are checked against the model before they are used."""

Ask = Callable[[np.ndarray, np.ndarray, np.ndarray, int, Callable[[], np.ndarray]], np.ndarray]
"""What reads a model at many instants: states, inputs, parameters, number of values, and how they are read."""


class Pieces:
    """Accelerations of a model at many instants (a column each), as functions of its inputs, see `Ask`."""

    def __init__(self, m: Any, d: Any, ask: Ask, x: np.ndarray, u: np.ndarray, p: np.ndarray) -> None:
        import mujoco as mj

        self._ask, self._m, self._d = ask, m, d
        nv, nu = m.nv, m.nu
        most = int(2 * nv + 6 * m.neq + 2 * m.ntendon + 8)  # dry friction and limits, equations, some contacts
        self.x, self.p = x.copy(), p[:, 0].copy()
        read = _Reader(m, d, most)
        found = ask(x, u, p, read.size, read)
        cuts = np.cumsum([nv, nv * nv, nu, nu, nu * nv, most * nv, most, most, most])
        self._a, M, length, speed, moment, J, at, stiff, reach, one_sided = np.split(found, cuts)
        used = np.flatnonzero(np.any(np.nan_to_num(stiff) > 0.0, axis=1))
        J, self._at, reach, one = J.reshape(most, nv, x.shape[1])[used], at[used], reach[used], one_sided[used] > 0.0
        # Below, between and above the limits of a constraint force; the solver's own state may be outdated.
        with np.errstate(invalid="ignore"):
            below, above = (self._at <= -reach) & ~one, self._at >= np.where(one, 0.0, reach)
        D = np.where(below | above, 0.0, stiff[used])
        self._low = np.where(below | one & ~above, -np.inf, np.where(above, np.where(one, 0.0, reach), -reach))
        self._high = np.where(below, -reach, np.where(above, np.inf, np.where(one, 0.0, reach)))
        A = np.moveaxis(_inverted(M.reshape(nv, nv, -1) + np.einsum("cin,cn,cjn->ijn", J, D, J)), 0, -1)
        # By input, so that a force at one joint costs one column.
        self._answers = np.concatenate([A, np.einsum("cin,ijn->cjn", J, A)]).transpose(1, 0, 2).copy()
        self._moment = moment.reshape(nu, nv, x.shape[1])  # a model may have no actuator
        self._drives = np.argwhere(np.any(np.nan_to_num(self._moment) != 0.0, axis=2)).tolist()
        gain, bias = m.actuator_gainprm, m.actuator_biasprm
        affine = (m.actuator_gaintype == int(mj.mjtGain.mjGAIN_AFFINE))[:, None]
        biased = (m.actuator_biastype == int(mj.mjtBias.mjBIAS_AFFINE))[:, None]
        self._gain = gain[:, :1] + affine * (gain[:, 1:2] * length + gain[:, 2:3] * speed)
        self._bias = biased * (bias[:, :1] + bias[:, 1:2] * length + bias[:, 2:3] * speed)
        self._clamps = not m.opt.disableflags & int(mj.mjtDisableBit.mjDSBL_CLAMPCTRL)
        # The model is lent: by the next call it may have other limits.
        self._limits = m.actuator_forcelimited.copy(), m.actuator_forcerange.copy()
        self._force = self._forces(u)
        self.agrees = self._agrees(u)

    @property
    def nbytes(self) -> int:
        """Size of the cache."""
        return int(self._answers.nbytes + self._moment.nbytes + 8 * self.x.size)

    def _agrees(self, u: np.ndarray) -> bool:
        """Return whether pieces and model agree under other inputs, including actuators and solver."""
        n = self.x.shape[1]
        some = np.unique(np.linspace(0, n - 1, CHECKED).astype(int))
        steps = np.ptp(u, axis=1, keepdims=True)
        steps[steps == 0.0] = 1.0
        for share in (1e-3, -0.1):
            other = u + share * steps * np.cos(np.arange(len(u)))[:, None]
            found, straight = self._moved(other)
            kept = some[straight[some]]
            exact = self._exact(other, kept)
            size = np.max(np.abs(exact), axis=1, keepdims=True, initial=0.0)
            if not np.all(np.abs(found[:, kept] - exact) <= AGREES * size):
                return False
        return True

    def __call__(self, u: np.ndarray) -> np.ndarray:
        """Return the accelerations under inputs, shape (n_joints, n_instants)."""
        out, straight = self._moved(u)
        others = np.flatnonzero(~straight)
        if len(others):
            out[:, others] = self._exact(u, others)
        return out

    def _moved(self, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the accelerations assuming unchanged pieces, and the instants at which that holds."""
        change, nv = self._forces(u) - self._force, len(self._a)
        moved = np.zeros(self._answers.shape[1:])
        for column, df in zip(self._answers, change, strict=True):
            if np.any(df):  # values that are not finite are requested, too
                moved += column * df
        reached = self._at + moved[nv:]
        straight = np.all((reached >= self._low) & (reached <= self._high), axis=0)
        out = self._a + moved[:nv]
        return out, straight & np.all(np.isfinite(out), axis=0)

    def _forces(self, u: np.ndarray) -> np.ndarray:
        """Return the forces of the actuators and those applied, at the joints."""
        m, nu = self._m, self._m.nu
        if not nu:
            return u
        ctrl = u[:nu]
        if self._clamps:
            ctrl = _clipped(ctrl, m.actuator_ctrllimited, m.actuator_ctrlrange)
        force = _clipped(self._gain * ctrl + self._bias, *self._limits)
        at_joints = np.zeros((m.nv, u.shape[1]))
        for k, j in self._drives:
            at_joints[j] += force[k] * self._moment[k, j]
        return _clipped(at_joints, m.jnt_actfrclimited, m.jnt_actfrcrange) + u[nu:]

    def _exact(self, u: np.ndarray, rows: np.ndarray) -> np.ndarray:
        p = np.repeat(self.p[:, None], len(rows), axis=1)
        return self._ask(self.x[:, rows], u[:, rows], p, len(self._a), lambda: self._d.qacc)


class KeptPieces:
    """Cache of the pieces of repeatedly evaluated motions."""

    def __init__(self, m: Any, d: Any, ask: Ask) -> None:
        self._model, self._ask = (m, d), ask
        self._usable = _has_pieces(m)
        self._kept: list[Pieces] = []
        self._seen: list[tuple[np.ndarray, np.ndarray, int]] = []

    def find(self, x: np.ndarray, u: np.ndarray, p: np.ndarray) -> Pieces | None:
        """Return the pieces of a motion; None where they do not pay, or the model has none."""
        if not self._usable or x.shape[1] < LEAST_ROWS or np.any(p != p[:, :1]):
            return None
        for k, kept in enumerate(self._kept):
            if _same(kept.x, kept.p, x, p):
                self._kept.append(self._kept.pop(k))
                return kept
        return self._made(x, u, p) if self._asked(x, p) >= WORTH else None

    def _asked(self, x: np.ndarray, p: np.ndarray) -> int:
        """Return how often a motion has been evaluated."""
        for k, (its_x, its_p, times) in enumerate(self._seen):
            if _same(its_x, its_p, x, p):
                self._seen[k] = its_x, its_p, times + 1
                return times + 1
        self._seen = [*self._seen[-3:], (x.copy(), p[:, 0].copy(), 1)]
        return 1

    def _made(self, x: np.ndarray, u: np.ndarray, p: np.ndarray) -> Pieces | None:
        self._seen = [s for s in self._seen if not _same(s[0], s[1], x, p)]
        made = Pieces(*self._model, self._ask, x, u, p)
        if not made.agrees:
            self._usable = False
            return None
        self._kept.append(made)
        while sum(k.nbytes for k in self._kept) > MOST_BYTES and len(self._kept) > 1:
            self._kept.pop(0)
        return made


class _Reader:
    """Reads from a model at an instant what `Pieces` needs."""

    def __init__(self, m: Any, d: Any, most: int) -> None:
        import mujoco as mj

        self._m, self._d, self._most = m, d, most
        self.size = m.nv + m.nv**2 + 2 * m.nu + m.nu * m.nv + most * (m.nv + 4)
        self._M, self._moment = np.zeros((m.nv, m.nv)), np.zeros((m.nu, m.nv))
        kinds = mj.mjtConstraint
        self._equal, self._cone = int(kinds.mjCNSTR_EQUALITY), int(kinds.mjCNSTR_CONTACT_ELLIPTIC)
        self._dry = int(kinds.mjCNSTR_FRICTION_DOF), int(kinds.mjCNSTR_FRICTION_TENDON)

    def __call__(self) -> np.ndarray:
        m, d, n = self._m, self._d, self._d.nefc
        kinds = d.efc_type[:n]
        if n > self._most or self._cone in kinds:  # pieces of a cone are not linear
            return np.full(self.size, np.nan)
        write_full_inertia(m, d, self._M)
        J, (at, stiff, reach, one_sided) = np.zeros((self._most, m.nv)), np.zeros((4, self._most))
        if n:
            J[:n] = d.efc_J[: n * m.nv].reshape(n, m.nv)
            at[:n] = J[:n] @ d.qacc - d.efc_aref[:n]
            dry, equal = (kinds == self._dry[0]) | (kinds == self._dry[1]), kinds == self._equal
            stiff[:n], reach[:n] = d.efc_D[:n], np.where(equal, np.inf, d.efc_R[:n] * d.efc_frictionloss[:n])
            one_sided[:n] = ~(dry | equal)
        if m.nu:
            write_moments(m, d, self._moment)
        return np.concatenate([
            d.qacc, self._M.ravel(), d.actuator_length, d.actuator_velocity, self._moment.ravel(), J.ravel(), at,
            stiff, reach, one_sided,
        ])  # fmt: skip


def _inverted(H: np.ndarray) -> np.ndarray:
    """Return the inverses of matrices; the instant is the last axis of the input and the first of the result."""
    out = np.full((H.shape[2], *H.shape[:2]), np.nan)
    good = np.isfinite(H).all(axis=(0, 1))
    out[good] = np.linalg.inv(np.moveaxis(H[:, :, good], -1, 0))
    return out


def _has_pieces(m: Any) -> bool:
    """Return whether inputs of a model act piecewise linearly."""
    import mujoco as mj

    gains = (int(mj.mjtGain.mjGAIN_FIXED), int(mj.mjtGain.mjGAIN_AFFINE))
    biases = (int(mj.mjtBias.mjBIAS_NONE), int(mj.mjtBias.mjBIAS_AFFINE))
    plain = np.isin(m.actuator_gaintype, gains).all() and np.isin(m.actuator_biastype, biases).all()
    clamped = limits_tendons(m) or np.any(m.jnt_actfrclimited & m.jnt_actgravcomp)
    return bool(plain and not clamped and len(m.actuator_gaintype) == m.nu and not mj.mj_isSparse(m))


def _same(x: np.ndarray, p: np.ndarray, other: np.ndarray, numbers: np.ndarray) -> bool:
    if x.shape != other.shape or not np.array_equal(p, numbers[:, 0]):
        return False
    middle = x.shape[1] // 2  # most motions differ there, which saves a full comparison
    return np.array_equal(x[:, middle], other[:, middle]) and np.array_equal(x, other)


def _clipped(values: np.ndarray, limited: np.ndarray, ranges: np.ndarray) -> np.ndarray:
    """Return values clipped to their active ranges."""
    if not np.any(limited):
        return values
    on = np.asarray(limited, dtype=bool)
    low, high = np.where(on, ranges[:, 0], -np.inf), np.where(on, ranges[:, 1], np.inf)
    clipped: np.ndarray = np.clip(values, low[:, None], high[:, None])
    return clipped
