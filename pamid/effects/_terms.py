r"""Effects as terms of a regression: linear in some parameters, with a shape set by the others.

.. math:: \Delta y = \phi_0(\theta) + \sum_k w_k\,\phi_k(\theta)

For given widths, lags and relaxation times θ the weights w follow from linear least squares (variable projection), so
that a search goes over the few θ alone.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import least_squares, lsq_linear

from .base import Effect, Signals
from .plant import Plant
from .registry import make_effect
from .values import Parameter

ROWS = 20_000
"""Samples of the search for the shapes: a longer log is thinned evenly."""

EVALUATIONS = 12
"""Steps of the search for the shapes; each costs one pass per shape."""


class WholeLog(NamedTuple):
    """Signals of runs in order of time: roles, sampling interval (s), first row of each run."""

    signals: Signals
    dt: float
    starts: np.ndarray

    def thinned(self, step: int) -> tuple[WholeLog, np.ndarray]:
        """Return every ``step``-th row of each run, and which rows these are."""
        n = len(np.asarray(self.signals.pressure))
        ends = [*self.starts[1:].tolist(), n]
        kept = [np.arange(a, b, step) for a, b in zip(self.starts.tolist(), ends, strict=True)]
        starts = np.concatenate([[0], np.cumsum([len(rows) for rows in kept])[:-1]])
        rows = np.concatenate(kept)
        return WholeLog(self.signals.at(rows), self.dt * step, starts), rows


class Terms(NamedTuple):
    """What effects add to an equation: an ``offset`` and, for each weight, a column, its effect and its parameter."""

    offset: np.ndarray
    columns: np.ndarray
    of: list[tuple[int, Parameter]]
    memory: np.ndarray


def acts_on(effect: Effect, equations: Collection[str]) -> bool:
    """Return whether a model of force or flow can include an effect: as a term, or as a fault of its pressure."""
    sensor = effect.channel == "P" and "measure" in effect.hooks()
    return sensor or bool(set(equations) & set(effect.hooks()) & {"force", "flow"})


def of_causes(
    causes: Iterable[tuple[Sequence[str], Sequence[Mapping[str, float]]]], equations: Collection[str]
) -> tuple[list[Effect], list[str]]:
    """Return the likeliest effects that models of these equations can hold, and the causes that they cannot."""
    held: list[Effect] = []
    left: list[str] = []
    for names, values in causes:
        for k, name in enumerate(names):
            if name not in Effect.registry or any(e.name == name for e in held):
                continue
            kind = type(make_effect(name))
            given = values[k] if k < len(values) else {}
            bounded = {
                p.name: float(np.clip(given[p.name], p.lower, p.upper)) for p in kind.parameters if p.name in given
            }
            effect = kind(**bounded)
            if acts_on(effect, equations):
                held.append(effect)
                break
        else:
            left.append(" or ".join(names))
    return held, left


def restored(effects: Sequence[Effect], log: WholeLog) -> WholeLog:
    """Return the log with the muscle's pressure and its rate in place of the sensor's readings."""
    s = log.signals
    for effect in effects:
        if effect.channel == "P" and "measure" in effect.hooks():
            P, rate = np.asarray(s.pressure, dtype=float), np.asarray(s.pressure_rate, dtype=float)
            still = effect.restore(0.0 * rate, log.dt, log.starts)  # the value of a constant reading of zero
            s = s.with_(
                pressure=effect.restore(P, log.dt, log.starts),
                pressure_rate=effect.restore(rate, log.dt, log.starts) - still,
            )
    return WholeLog(s, log.dt, log.starts)


def terms_of(effects: Sequence[Effect], equation: str, log: WholeLog, plant: Plant) -> Terms:
    """Return the sum of the effects in the force (N) or the flow (kg/s), on the log of the muscle itself."""
    n = len(np.asarray(log.signals.pressure))
    offset, columns, of, memory = np.zeros(n), [], [], []
    for i, effect in enumerate(effects):
        if equation not in effect.hooks():
            continue
        linear = [p for p in effect.parameters if p.linear]
        none = effect.unchecked(**{p.name: 0.0 for p in linear})
        x = effect.trace(log.signals, plant, log.dt, log.starts) if effect.n_states else np.zeros((0,))
        base = added(none, equation, log.signals, x, plant)
        offset = offset + base
        for p in linear:
            unit = p.nominal or 1e-3 * p.upper
            one = added(none.unchecked(**{p.name: unit}), equation, log.signals, x, plant)
            columns.append((one - base) / unit + np.zeros(n))
            of.append((i, p))
            memory.append(bool(effect.n_states) and p.position == 0)
    stacked = np.column_stack(columns) if columns else np.zeros((n, 0))
    return Terms(offset, stacked, of, np.array(memory, dtype=bool))


def added(effect: Effect, equation: str, s: Signals, x: Any, plant: Plant) -> Any:
    """Return what an effect adds to the force (N) or the flow (kg/s), from signals and states."""
    if equation not in effect.hooks():
        return 0.0
    if equation == "force":
        return effect.force(s, x, plant)
    step = effect.flow(s, x, plant)
    return step.a + step.b * s.pressure_rate


def fit_effects(
    effects: Sequence[Effect],
    log: WholeLog,
    plant: Plant,
    shares: Sequence[tuple[str, Callable[[WholeLog], np.ndarray], np.ndarray, np.ndarray]],
) -> list[Effect]:
    """Fit all parameters of the effects to the residual of a base model."""
    some, rows = log.thinned(max(1, round(len(np.asarray(log.signals.pressure)) / ROWS)))
    free = [(i, p) for i, e in enumerate(effects) for p in e.parameters if not p.linear]
    scale = [p.upper - p.lower if p.lower <= 0 else np.log(p.upper / p.lower) for _, p in free]

    def shaped(u: np.ndarray) -> list[Effect]:
        out = list(effects)
        for v, (i, p), width in zip(u, free, scale, strict=True):
            value = p.lower + v * width if p.lower <= 0 else p.lower * np.exp(v * width)
            out[i] = out[i].unchecked(**{p.name: float(np.clip(value, p.lower, p.upper))})
        return out

    def solved(now: list[Effect]) -> tuple[list[Effect], np.ndarray]:
        inside = restored(now, some)
        parts = []
        for equation, base, y, root in shares:
            left = y[rows] - base(inside)
            terms = terms_of(now, equation, inside, plant)
            parts.append((root[rows], left - terms.offset, terms))
        return _weighted(now, parts)

    def residual(u: np.ndarray) -> np.ndarray:
        return solved(shaped(u))[1]

    if not free:
        return solved(list(effects))[0]
    start = [
        (effects[i].values[p.name] - p.lower) / width
        if p.lower <= 0
        else np.log(effects[i].values[p.name] / p.lower) / width
        for (i, p), width in zip(free, scale, strict=True)
    ]
    found = least_squares(
        residual, np.clip(start, 1e-3, 1.0 - 1e-3), bounds=(0.0, 1.0), diff_step=1e-3, max_nfev=EVALUATIONS
    )
    return solved(shaped(found.x))[0]


def _weighted(
    effects: list[Effect], parts: Sequence[tuple[np.ndarray, np.ndarray, Terms]]
) -> tuple[list[Effect], np.ndarray]:
    """Solve for the weights of all equations together; return the effects with them, and the residual."""
    names = list(dict.fromkeys((i, p.name) for _, _, terms in parts for i, p in terms.of))
    known = {(i, p.name): p for _, _, terms in parts for i, p in terms.of}
    target = np.concatenate([root * left for root, left, _ in parts])
    if not names:
        return effects, target
    A = np.zeros((len(target), len(names)))
    begin = 0
    for root, left, terms in parts:
        for column, (i, p) in zip(terms.columns.T, terms.of, strict=True):
            A[begin : begin + len(left), names.index((i, p.name))] += root * column
        begin += len(left)
    size = np.sqrt((A**2).sum(axis=0))
    size[size == 0] = 1.0
    counted = np.any(A, axis=1) | (target != 0)
    lower, upper = (np.array([getattr(known[name], bound) for name in names]) * size for bound in ("lower", "upper"))
    # A small ridge keeps indistinguishable terms from growing against each other.
    ridge = 1e-3 * float(np.linalg.norm(target)) / max(np.sqrt(counted.sum()), 1.0) * np.eye(len(names))
    stacked = np.vstack([A[counted] / size, ridge])
    w = lsq_linear(stacked, np.append(target[counted], np.zeros(len(names))), bounds=(lower, upper)).x / size
    out = list(effects)
    for (i, name), value in zip(names, w, strict=True):
        out[i] = out[i].unchecked(**{name: float(np.clip(value, known[i, name].lower, known[i, name].upper))})
    return out, target - A @ w
