"""How strong an effect is: what it leaves in each equation over windows of 20 ms, over what the noise leaves.

Residuals are taken from readings without noise, with the true numbers; the floor from the same readings with noise.
What a refit of the numbers within their tolerances would absorb is taken off first, since that is no gap.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import lsq_linear

from .excitation import DT
from .quantities import TOLERANCE, Numbers, braid

WINDOW = 20
"""Samples in a window."""
EQUATIONS = ("force", "flow", "valve", "joint")


@dataclass(frozen=True)
class Readings:
    """Sensors of one run: q (n,), P, F, mdot, u, mdot_end (n, 2)."""

    q: np.ndarray
    P: np.ndarray
    F: np.ndarray
    mdot: np.ndarray
    u: np.ndarray
    mdot_end: np.ndarray


def _box(x: np.ndarray) -> np.ndarray:
    sums = np.concatenate([np.zeros((1, *x.shape[1:])), np.cumsum(x - x[:1], axis=0)])
    return (sums[WINDOW:] - sums[:-WINDOW]) / WINDOW + x[:1]


def residuals(n: Numbers, s: Readings) -> dict[str, np.ndarray]:
    """Return the residual of each equation over the windows of a run, shape (windows, sides)."""
    b2, k = braid(n)
    eps = n.eps0 + n.r / n.L0 * s.q[:, None] * np.array([1.0, -1.0])
    L = n.L0 * (1 - eps)
    V, force = k * (b2 * L - L**3), (s.P - n.Pa) * k * (3 * L * L - b2)

    # Flow: gain of P^(1/γ) V between the means of two windows against what flowed in, by the trapezium per interval.
    per_flow = n.R * n.T * s.P ** (1 / n.gamma - 1)
    content = s.P ** (1 / n.gamma) * V
    rate = 0.5 * (per_flow[:-1] * s.mdot[:-1] + per_flow[1:] * s.mdot_end[:-1])
    flown = np.concatenate([np.zeros((1, 2)), np.cumsum(rate, axis=0)]) * DT
    balance = _box(flown - content)[::WINDOW]
    scale = _box(per_flow)[::WINDOW]
    flow = np.diff(balance, axis=0) / (WINDOW * DT) / scale[1:]

    def psi(x: np.ndarray) -> np.ndarray:
        y = np.maximum((x - n.bc) / (1 - n.bc), 0.0)
        return np.sqrt(np.maximum(1 - y * y, 0.0))

    opened = np.where(s.u > 0, n.Ps * psi(s.P / n.Ps), s.P * psi(n.Pa / s.P))
    valve = s.mdot - n.C * n.rho0 * s.u * opened

    pull = n.r * (s.F[:, 0] - s.F[:, 1])
    moved = n.bq * (s.q[2:] - s.q[:-2]) / (2 * DT) + n.J * (s.q[2:] - 2 * s.q[1:-1] + s.q[:-2]) / DT**2
    # A command held over a sample bends the torque at samples: between them it is straight, and so averaged here.
    held = (pull[:-2] + 4 * pull[1:-1] + pull[2:]) / 6
    torque = _box(_box(_box((held - moved)[:, None])))
    return {
        "force": _box(s.F - force)[::WINDOW],
        "flow": flow,
        "valve": _box(valve)[::WINDOW],
        "joint": torque[::WINDOW],
    }


def stacked(n: Numbers, runs: list[Readings]) -> dict[str, np.ndarray]:
    """Return the residuals of all runs of a log, one after the other."""
    parts = [residuals(n, s) for s in runs]
    return {e: np.concatenate([p[e] for p in parts]) for e in EQUATIONS}


@dataclass(frozen=True)
class Strength:
    """What an effect leaves in a log.

    Parameters
    ----------
    floors : dict of str to float
        Root mean square that the noise leaves in each equation.
    raw, net : dict of str to float
        Root mean square of the effect over the floor, before and after a refit within tolerances.
    contribution : dict of str to array
        What is left after the refit, over the windows of all runs.
    """

    floors: dict[str, float]
    raw: dict[str, float]
    net: dict[str, float]
    contribution: dict[str, np.ndarray]

    @property
    def total(self) -> float:
        """Strength in the equation where it is largest."""
        return max(self.net.values())

    @property
    def equation(self) -> str:
        """Equation where it is largest."""
        return max(self.net, key=lambda e: self.net[e])


def rms(x: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.square(x))))


def strength(nominal: Numbers, truth: dict[str, float], clean: list[Readings], noisy: list[Readings]) -> Strength:
    """Measure how much stands out of the noise of a log.

    Parameters
    ----------
    nominal : Numbers
        The simulator.
    truth : dict of str to float
        Relative offsets of the true numbers within their tolerances.
    clean, noisy : list of Readings
        Each run without and with noise.
    """
    raw, with_noise = stacked(nominal.changed(**truth), clean), stacked(nominal.changed(**truth), noisy)
    floors = {e: rms(with_noise[e] - raw[e]) for e in EQUATIONS}
    base = _whitened(raw, floors)
    J = _columns(nominal, truth, clean, raw, floors)
    left, net, at = base + J @ _bounded(J, base, _offsets(truth)), {}, 0
    contribution = {}
    for e in EQUATIONS:
        size = raw[e].size
        contribution[e] = left[at : at + size].reshape(raw[e].shape) * floors[e]
        net[e] = rms(left[at : at + size])
        at += size
    return Strength(floors, {e: rms(raw[e]) / floors[e] for e in EQUATIONS}, net, contribution)


def refit(nominal: Numbers, runs: list[Readings], rounds: int = 3) -> dict[str, float]:
    """Return the relative changes of the numbers that fit a log best, each within its tolerance.

    Residuals are weighed by their own median size in each equation, so that an equation with a gap counts less.
    """
    changes = dict.fromkeys(TOLERANCE, 0.0)
    for _ in range(rounds):
        raw = stacked(nominal.changed(**changes), runs)
        sizes = {e: 1.4826 * float(np.median(np.abs(raw[e]))) or 1.0 for e in EQUATIONS}
        J = _columns(nominal, changes, runs, raw, sizes)
        x = _bounded(J, _whitened(raw, sizes), _offsets(changes))
        changes = {k: changes[k] + t * float(v) for (k, t), v in zip(TOLERANCE.items(), x, strict=True)}
    return changes


def _whitened(raw: dict[str, np.ndarray], sizes: dict[str, float]) -> np.ndarray:
    return np.concatenate([(raw[e] / sizes[e]).ravel() for e in EQUATIONS])


def _offsets(changes: dict[str, float]) -> np.ndarray:
    """Return the changes in units of the tolerances."""
    return np.array([changes.get(k, 0.0) / t for k, t in TOLERANCE.items()])


def _columns(
    nominal: Numbers,
    changes: dict[str, float],
    runs: list[Readings],
    raw: dict[str, np.ndarray],
    sizes: dict[str, float],
) -> np.ndarray:
    """Return the whitened residuals' derivatives with respect to the numbers, a column a tolerance."""
    columns = []
    for key, tolerance in TOLERANCE.items():
        step = 0.2 * tolerance
        moved = stacked(nominal.changed(**{**changes, key: changes.get(key, 0.0) + step}), runs)
        columns.append(_whitened({e: moved[e] - raw[e] for e in EQUATIONS}, sizes) / 0.2)
    return np.column_stack(columns)


def _bounded(J: np.ndarray, base: np.ndarray, offsets: np.ndarray) -> np.ndarray:
    """Solve for the change of the numbers, now at ``offsets``, that leaves least within their tolerances."""
    gram, right = J.T @ J, J.T @ base  # five columns, thousands of rows
    root = np.linalg.cholesky(gram + 1e-9 * np.trace(gram) * np.eye(len(gram)))
    lower = np.minimum(-1.0 - offsets, -1e-9)
    upper = np.maximum(1.0 - offsets, 1e-9)
    return lsq_linear(root.T, np.linalg.solve(root, -right), bounds=(lower, upper)).x
