"""Fits of the SO-101 arm beside pamid's: parameters as PACE has them, as MuJoCo's sysid has them, and boosted trees.

Each fits free runs of the training motions by least squares from the public model's numbers. Joints are perturbed
together: what one servo's numbers do to another joint is left out of the slopes, not of the runs.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from benchmarks._so101 import VENDOR, model_text

JOINTS = list(VENDOR)
BOUNDS = {"kp": (1.0, 5e3), "kv": (1e-3, 5e2), "armature": (1e-4, 2.0), "frictionloss": (1e-4, 1e2),
          "damping": (1e-3, 5e2), "offset": (-0.15, 0.15), "delay": (0.0, 0.2)}  # fmt: skip
"""N m/rad, N m s/rad, kg m^2, N m, N m s/rad, rad, s."""
TOOLS = {
    "PACE's parameters": ("armature", "damping", "frictionloss", "offset", "delay"),
    "MuJoCo sysid's parameters": ("kp", "kv", "armature", "damping", "frictionloss"),
}
"""What a tool fits, of each servo."""
SOFT = {"kp": 20.0, "kv": 0.5, "frictionloss": 0.3, "damping": 1.0, "delay": 0.03}
"""A second start of fits: a soft servo with friction."""
LAGS = (0, 1, 2, 3, 4, 5, 6, 8, 10, 15, 20, 30, 50, 100, 200)
"""Samples back at which trees see commands."""
Motions = Mapping[str, pd.DataFrame]
Numbers = dict[str, np.ndarray]
"""Numbers of the six servos, by name."""


def loaded(folder: Path, step: float = 0.002, implicit: bool = False) -> Any:
    """Return the public model, with MuJoCo's usual step and integrator or with a longer one."""
    import mujoco

    model = mujoco.MjModel.from_xml_string(model_text(folder, vendor=False))
    model.opt.timestep = step
    if implicit:
        model.opt.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    return model


def public(model: Any) -> Numbers:
    """Return the public numbers."""
    m, none = model, np.zeros(len(JOINTS))
    at = [m.joint(n).dofadr[0] for n in JOINTS]
    return {"kp": m.actuator_gainprm[:, 0].copy(), "kv": -m.actuator_biasprm[:, 2].copy(),
            "armature": m.dof_armature[at].copy(), "frictionloss": m.dof_frictionloss[at].copy(),
            "damping": m.dof_damping[at].copy(), "offset": none.copy(), "delay": none.copy()}  # fmt: skip


def vendors(model: Any) -> Numbers:
    """Return the vendor's numbers, a fit on another arm of the type."""
    table = np.array(list(VENDOR.values())).T
    return public(model) | dict(zip(("kp", "kv", "armature", "frictionloss", "damping"), table, strict=True))


def free_runs(model: Any, numbers: Numbers, motions: Motions, threads: int = 2) -> dict[str, np.ndarray]:
    """Return the readings of free runs, shape (rows, joints): from the first reading, commands held."""
    import copy

    import mujoco
    from mujoco import rollout

    m = copy.copy(model)
    at = [m.joint(n).dofadr[0] for n in JOINTS]
    m.actuator_gainprm[:, 0], m.actuator_biasprm[:, 1], m.actuator_biasprm[:, 2] = (
        numbers["kp"], -numbers["kp"], -numbers["kv"])  # fmt: skip
    m.dof_armature[at], m.dof_frictionloss[at] = numbers["armature"], numbers["frictionloss"]
    m.dof_damping[at] = numbers["damping"]
    mujoco.mj_setConst(m, mujoco.MjData(m))
    step, full = float(m.opt.timestep), mujoco.mjtState.mjSTATE_FULLPHYSICS

    def one(log: pd.DataFrame) -> np.ndarray:
        t, commands = log["time"].to_numpy(), log[[f"{n}_ctrl" for n in JOINTS]].to_numpy()
        when = np.arange(round(t[-1] / step) + 1) * step + 1e-6
        given = np.empty((len(when), len(JOINTS)))
        for k, late in enumerate(numbers["delay"]):
            given[:, k] = _held(when - late, t, commands[:, k]) + numbers["offset"][k]
        data, begin = mujoco.MjData(m), np.empty(mujoco.mj_stateSize(m, full))
        data.qpos[:] = log[JOINTS].to_numpy()[0]
        mujoco.mj_getState(m, data, begin, full)
        states, _ = rollout.rollout(m, data, begin[None], given[None])
        q = np.vstack([log[JOINTS].to_numpy()[:1], states[0][:, 1 : 1 + len(JOINTS)]])
        return np.asarray(q[np.clip(np.round(t / step).astype(int), 0, len(q) - 1)])

    with ThreadPoolExecutor(threads) as pool:
        return dict(zip(motions, pool.map(one, motions.values()), strict=True))


def _held(when: np.ndarray, t: np.ndarray, command: np.ndarray) -> np.ndarray:
    """Return a command that is held until the next; between shifts of whole samples slopes exist, too."""
    return np.asarray(command[np.clip(np.searchsorted(t, when, side="right") - 1, 0, None)])


def errors_of(runs: Mapping[str, np.ndarray], motions: Motions) -> dict[str, list[float]]:
    """Return mean squares by motion and joint, rad^2."""
    return {n: list(np.mean(np.square(y - motions[n][JOINTS].to_numpy()), axis=0)) for n, y in runs.items()}


class Fit:
    """Least squares over the training motions: some numbers of each servo."""

    def __init__(self, model: Any, motions: Motions, free: Sequence[str], every: int = 5) -> None:
        self.model, self.motions, self.free, self.every = model, motions, free, every
        self.own = public(model)
        self.low, self.high = (np.array([self._in(w, BOUNDS[w][k]) for w in free for _ in JOINTS]) for k in (0, 1))

    @staticmethod
    def _in(word: str, value: float) -> float:
        """Return a number as it is fitted: sizes by their logarithm."""
        return value if word in ("offset", "delay") else float(np.log(value))

    def numbers(self, z: np.ndarray) -> Numbers:
        """Return the numbers of all servos."""
        rows = np.reshape(z, (len(self.free), len(JOINTS)))
        made = {w: row if w in ("offset", "delay") else np.exp(row) for w, row in zip(self.free, rows, strict=True)}
        return self.own | made

    def residuals(self, z: np.ndarray) -> np.ndarray:
        """Return the error of each row, shape (rows, joints), mrad; every motion weighs the same."""
        runs = free_runs(self.model, self.numbers(z), self.motions)
        left = []
        for n, y in runs.items():
            own = (y - self.motions[n][JOINTS].to_numpy())[:: self.every]
            left.append(1e3 * own / np.sqrt(len(own)))
        return np.nan_to_num(np.vstack(left), nan=1e3)

    def slopes(self, z: np.ndarray) -> np.ndarray:
        """Return the Jacobian; one run perturbs a number of all six servos."""
        here, many = self.residuals(z), len(JOINTS)
        out = np.zeros((here.size, z.size))
        for k, word in enumerate(self.free):
            step = {"offset": 1e-3, "delay": 2e-2}.get(word, 0.05)
            moved = z.copy()
            part = slice(k * many, (k + 1) * many)
            moved[part] = np.where(z[part] + step > self.high[part], z[part] - step, z[part] + step)
            change = (self.residuals(moved) - here) / (moved - z)[part]
            for j in range(many):
                out[j::many, k * many + j] = change[:, j]
        return out

    def run(self, start: Mapping[str, float], rounds: int = 8) -> tuple[Numbers, np.ndarray]:
        """Return the numbers that fit best from a start, and the slopes of the residuals there."""
        from scipy.optimize import least_squares

        begin = np.concatenate([
            np.full(len(JOINTS), self._in(w, start[w])) if w in start else [self._in(w, x) for x in self.own[w]]
            for w in self.free])  # fmt: skip
        inside = np.clip(begin, self.low + 1e-6, self.high - 1e-6)
        found = least_squares(lambda z: self.residuals(z).ravel(), inside, self.slopes, (self.low, self.high),
                              x_scale="jac", max_nfev=rounds, ftol=1e-3, xtol=1e-4)  # fmt: skip
        return self.numbers(found.x), np.asarray(found.jac)


def directions(fit: Fit, slopes: np.ndarray) -> dict[str, list[tuple[float, str]]]:
    """Return by joint by how much its free runs change, mrad, along products of powers of its numbers.

    From the largest change to the smallest: along the last the motions hardly tell the numbers apart.
    """
    many, found = len(JOINTS), {}
    for j, joint in enumerate(JOINTS):
        _, sizes, ways = np.linalg.svd(slopes[j::many, j::many] / np.sqrt(len(fit.motions)), full_matrices=False)
        words = [
            " ".join(f"{w}^{x:+.1f}" for w, x in zip(fit.free, way, strict=True) if abs(x) >= 0.15) for way in ways
        ]
        found[joint] = list(zip(map(float, sizes), words, strict=True))
    return found


def columns(log: pd.DataFrame, run: np.ndarray) -> np.ndarray:
    """Return what trees see: the free run, its changes, commands now and before, and where the run began."""
    n, found = len(log), [run]
    commands = log[[f"{j}_ctrl" for j in JOINTS]].to_numpy()
    for back in LAGS:
        rows = np.clip(np.arange(n) - back, 0, None)
        found.append(commands[rows])
    begin = log[JOINTS].to_numpy()[0] - commands[0]
    return np.column_stack([*found, np.tile(begin, (n, 1))])


def trees(model: Any, train: Motions, motions: Motions) -> dict[str, np.ndarray]:
    """Return free runs of the public model, corrected by boosted trees on what it leaves in the training motions."""
    from sklearn.ensemble import HistGradientBoostingRegressor

    runs = free_runs(model, public(model), motions)
    X = np.vstack([columns(train[n], runs[n]) for n in train])
    out = {n: y.copy() for n, y in runs.items()}
    for k, joint in enumerate(JOINTS):
        y = np.concatenate([train[n][joint].to_numpy() - runs[n][:, k] for n in train])
        weights = np.concatenate([np.full(len(log), 1.0 / len(log)) for log in train.values()])
        own = [c for c in range(X.shape[1]) if c % len(JOINTS) == k or c < len(JOINTS)]
        learner = HistGradientBoostingRegressor(random_state=0, max_iter=150, learning_rate=0.1)
        learner.fit(X[:, own], y, sample_weight=weights / weights.mean())
        for n, log in motions.items():
            out[n][:, k] += learner.predict(columns(log, runs[n])[:, own])
    return out
