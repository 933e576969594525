"""What a log says of a simulator's numbers beside its effects: values, errors, directions that it leaves open."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pandas as pd

from ..errors import ImplausibleParameterError, SimulatorRunError
from ..gap.residuals.ports import PortEvidence
from ..gap.simulated import evidence_of
from ..simulators import Simulator
from ..simulators.ports import ModelParameter

WIDE = 0.9
"""Tolerance under which a fitted number may move: between a tenth of it and nearly twice as much. It only has to be far
wider than what a log leaves open, and stay on the side of zero that is physical."""
_STEP, _NEAR = 0.02, 0.05
_STEPS = 8
_ROUND = 1e-13


class Open(NamedTuple):
    """A direction of the numbers that a log does not fix."""

    weights: dict[str, float]
    """Relative change of each number along it, the largest 1."""
    spread: float
    """Standard deviation along it, relative to the largest."""

    def __str__(self) -> str:
        """Return the combination and how far it is open."""
        first, *others = self.weights
        far = "unbounded" if self.spread > 10.0 else f"± {100 * 1.645 * self.spread:.0f} %"
        changes = ", ".join(f"{n} by {100 * w:+.0f} %" for n, w in self.weights.items())
        names = f"{', '.join([first, *others[:-1]])} and {others[-1]}" if others else first
        return f"{names}, which may change together ({changes}; {far} in {first})" if others else f"{first} ({far})"


class Estimates(NamedTuple):
    """Numbers as a log has them, about a simulator."""

    names: tuple[str, ...]
    """The numbers."""
    values: np.ndarray
    errors: np.ndarray
    """Estimates and standard errors, in the numbers' units. Shape (n,)."""
    alone: np.ndarray
    """Standard errors where the simulator's effects are taken as they are, shape (n,)."""
    flat: list[Open]
    """Directions that the log leaves as wide as they may be."""
    agreement: float
    """Probability of runs that differ as much by chance; NaN of a single run."""
    worst: str
    """Number in which runs differ most."""


def freed(simulator: Simulator, values: Mapping[str, float], tolerance: float = WIDE) -> Simulator:
    """Return a simulator with other values, which a fit may then change; those that are zero stay."""
    known = simulator.fit_numbers()
    return simulator.freed(
        {k: ModelParameter(v, tolerance, known[k].unit if k in known else "-") for k, v in values.items()}
    )


def estimates(log: pd.DataFrame, simulator: Simulator, names: Sequence[str], read: bool = True) -> Estimates:
    """Estimate some numbers from a log, in one Gauss–Newton step beside the simulator's effects.

    With ``read`` their errors include how the log is read: by how much they change where its settings are halved.
    """
    known, simulator = simulator.parameters, simulator.with_()
    simulator.parameters = {k: replace(p, tolerance=_NEAR) if k in names else p for k, p in known.items()}
    evidence = evidence_of(log, simulator)
    mine = [n for n in evidence.free if n in names]
    scale = np.array([simulator.tolerance[n] * simulator.get(n) for n in mine])
    weight = np.zeros(len(evidence.z0))
    for part, share in zip(evidence.parts, evidence.weights, strict=True):
        weight[part] = share
    order = [evidence.free.index(n) for n in mine] + [k for k, n in enumerate(evidence.free) if n not in names]
    own = evidence.J[:, order]
    J = np.column_stack([own, *_effect_columns(log, simulator, evidence)])
    others = len(order) - len(mine)
    prior = np.zeros(J.shape[1])
    prior[len(mine) : len(mine) + others] = 1.0  # tolerances that nobody fitted
    robust = np.minimum(1.0, 3.0 / np.maximum(np.abs(evidence.z0), 1e-12))
    w = weight * robust
    step, cov, spread = _solved(J, evidence.z0, w, prior)
    k = len(mine)
    values = np.array([simulator.get(n) for n in mine]) + scale * step[:k]
    C = cov[:k, :k] * spread
    alone = _solved(own, evidence.z0, w, prior[: own.shape[1]])[1][:k, :k] * spread
    more = np.zeros(k)
    for name in simulator.settings if read else ():
        half = max(0.5 * simulator.get(name), simulator.plausible(name)[0])
        more += np.square((estimates(log, simulator.with_({name: half}), names, False).values - values) / scale)
    agreement, worst = _agreement(J, evidence.z0, w, prior, evidence.block, mine, step, more)
    errors, fixed = (np.abs(scale) * np.sqrt(np.diag(c) + more) for c in (C, alone))
    return Estimates(tuple(mine), values, errors, fixed, _flat(_NEAR**2 * C, mine), agreement, worst)


def settled(log: pd.DataFrame, simulator: Simulator, names: Sequence[str]) -> Estimates:
    """Estimate some numbers, which may be far from the simulator's, from a log: iterate until they converge."""
    for _ in range(_STEPS):
        found = estimates(log, simulator, names)
        there = dict(zip(found.names, map(float, found.values), strict=True))
        there = {n: max(v, 0.2 * simulator.get(n), key=abs) for n, v in there.items()}
        if all(abs(v - simulator.get(n)) < 0.3 * e for (n, v), e in zip(there.items(), found.errors, strict=True)):
            break
        simulator = freed(simulator, there)
    return found


def _solved(J: np.ndarray, z: np.ndarray, w: np.ndarray, prior: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """Return the step, the covariance for unit noise, and the residual variance."""
    A = J.T @ (w[:, None] * J) + np.diag(prior)
    size = np.sqrt(np.where(np.diag(A) > _ROUND, np.diag(A), 1.0))
    cov = np.linalg.pinv(A / np.outer(size, size) + _ROUND * np.eye(len(size)), hermitian=True) / np.outer(size, size)
    step = -cov @ (J.T @ (w * z))
    left = z + J @ step
    return step, cov, max(1.0, float(np.sum(w * left**2) / max(np.sum(w), 1e-12)))


def _effect_columns(log: pd.DataFrame, simulator: Simulator, evidence: PortEvidence) -> list[np.ndarray]:
    """Return the change of the residuals by a small relative change of each number of the simulator's effects."""
    found = []
    for k, (*place, values) in enumerate(simulator.effects):
        for key, value in values.items():
            for step in (_STEP, -_STEP):  # a number at its bound has one way to go
                changed = {**values, key: value * (1.0 + step) if value else step}
                effects = [*simulator.effects[:k], (*place, changed), *simulator.effects[k + 1 :]]
                try:
                    there = evidence_of(log, simulator.with_({}, effects)).value
                except (ImplausibleParameterError, SimulatorRunError):
                    continue
                if there.shape == evidence.value.shape:
                    found.append(evidence.white((there - evidence.value) / evidence.noise) / step)
                break
    return [c for c in found if np.all(np.isfinite(c)) and np.any(c)]


def _flat(C: np.ndarray, names: Sequence[str]) -> list[Open]:
    """Return the directions along which a log says less than `WIDE` does, of the covariance of relative changes."""
    if not len(C):
        return []
    sizes, directions = np.linalg.eigh(C)
    found = []
    for variance, v in zip(sizes[::-1], directions.T[::-1], strict=True):
        if 1.645 * np.sqrt(max(variance, 0.0)) < WIDE:
            break
        first = int(np.argmax(np.abs(v)))
        change = v / v[first]
        some = [j for j in np.argsort(-np.abs(change)) if abs(change[j]) > 0.1]
        found.append(Open({names[j]: float(change[j]) for j in some}, float(np.sqrt(variance) * abs(v[first]))))
    return found


def _agreement(
    J: np.ndarray, z: np.ndarray, w: np.ndarray, prior: np.ndarray, block: np.ndarray, names: Sequence[str],
    step: np.ndarray, more: np.ndarray,
) -> tuple[float, str]:  # fmt: skip
    """Return how likely runs differ as much by chance, and the number in which they differ most."""
    from scipy.stats import chi2

    total, count, worst = np.zeros(len(names)), 0, ""
    for run in np.unique(block):
        mine = block == run
        if mine.sum() < 4 * len(step):
            continue
        own, cov, spread = _solved(J[mine], z[mine], w[mine], prior + _ROUND)
        error = np.sqrt(np.diag(cov)[: len(names)] * spread + more)
        total += np.minimum(np.square((own - step)[: len(names)] / np.maximum(error, _ROUND)), 1e6)
        count += 1
    if count < 2 or not len(names):
        return float("nan"), ""
    worst = names[int(np.argmax(total))]
    return float(min(1.0, len(names) * chi2.sf(total.max(), count - 1))), worst
