"""Rivals on the same logs: ranking by held-out error, SINDy on the residual, a black-box learner of the residual.

All see the residuals of `pamid.equations` over windows of 20 ms and their noise, refit the numbers that have a
tolerance linearly, and hold out each trajectory once, in three folds. Held-out error is Student's, so that peaks at
steps do not decide alone.
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from pamid.bench import BenchParameters
from pamid.effects import all_effects
from pamid.equations import residuals

from .metrics import Answer

SCALES = (0.1, 1.0)
"""Shares of an effect's usual size at which its sensitivity is taken."""
_EDGE = 0.13  # s: windows at the ends of a run, which effects with memory leave out
_SURE = 3.0  # standard errors by which held-out error must fall for a gap


@dataclass
class View:
    """The residuals of one log.

    Parameters
    ----------
    value, weight : array, shape (n,)
        Residuals and one over their noise.
    equation, run : array of int, shape (n,)
        Equation and trajectory of each.
    time : array, shape (n,)
        Time in its trajectory, s.
    side : array of int, shape (n,)
        0 or 1 for the muscles; 0 for the joint.
    names : list of str
        Equations.
    runs : list of str
        Trajectories.
    """

    value: np.ndarray
    weight: np.ndarray
    equation: np.ndarray
    run: np.ndarray
    time: np.ndarray
    side: np.ndarray
    names: list[str]
    runs: list[str]


def view(log: pd.DataFrame, params: BenchParameters, equations: Sequence[str] | None = None) -> View:
    """Return the residuals of a log as one long vector."""
    ends = log.groupby("trajectory", sort=False)["time"].max()
    runs, names = list(ends.index), ["force", "flow", "valve", "joint"]
    parts = []
    for trajectory, name, r in residuals(log, params, equations):
        kept = (r.time >= _EDGE) & (r.time <= ends[trajectory] - _EDGE)
        value, noise = r.value[kept], r.noise[kept]
        shape = value.shape
        side = np.broadcast_to(np.arange(shape[1]), shape)
        when = np.broadcast_to(r.time[kept, None], shape)
        columns = (value, 1.0 / np.maximum(noise, 1e-300), when, side)
        where = (names.index(name), runs.index(trajectory))
        parts.append((*(c.ravel() for c in columns), np.full(value.size, where[0]), np.full(value.size, where[1])))
    value, weight, when, side, equation, run = (np.concatenate(c) for c in zip(*parts, strict=True))
    order = np.lexsort((side, when, run, equation))
    return View(*(x[order] for x in (value, weight, equation, run, when, side)), names=names, runs=runs)


def _tolerances(log: pd.DataFrame, params: BenchParameters, base: View) -> np.ndarray:
    columns = []
    for name, tolerance in params.tolerance.items():
        moved = view(log, params.replace(**{name: params.get(name) * (1 + 0.2 * tolerance)}))
        columns.append((moved.value - base.value) * base.weight / 0.2)
    return np.column_stack(columns)


def _solve(A: np.ndarray, b: np.ndarray, ridge: np.ndarray) -> np.ndarray:
    return np.linalg.solve(A.T @ A + np.diag(ridge), -A.T @ b)


def _softmax(score: dict[str, float]) -> dict[str, float]:
    x = np.array(list(score.values()))
    p = np.exp(np.clip(x - x.max(), -700, 0))
    return dict(zip(score, (p / p.sum()).tolist(), strict=True))


def loss(x: np.ndarray) -> np.ndarray:
    """Return minus twice the log-likelihood of whitened residuals under Student's t with four degrees of freedom."""
    return 5.0 * np.log1p(np.square(x) / 4.0)


def _t(before: np.ndarray, after: np.ndarray, blocks: np.ndarray) -> float:
    """Return by how many standard errors the held-out error falls, over blocks of neighbouring windows."""
    gain = np.bincount(blocks, loss(before) - loss(after))
    spread = gain.std(ddof=1) if len(gain) > 1 else 0.0
    return float(gain.mean() / spread * np.sqrt(len(gain))) if spread > 0 else 0.0


def _blocks(v: View) -> np.ndarray:
    return np.unique(np.stack([v.equation, v.run, (v.time / 0.4).astype(int)]), axis=1, return_inverse=True)[1].ravel()


def _bend(x: np.ndarray) -> np.ndarray:
    """Huber's weights on whitened residuals: peaks at steps must not decide a fit alone."""
    size = max(1.0, 1.4826 * float(np.median(np.abs(x))))
    return np.sqrt(np.minimum(1.0, 3.0 * size / np.maximum(np.abs(x), 1e-12)))


class HeldOut:
    """What the rivals share of one log: residuals, tolerances, the split.

    Parameters
    ----------
    log : DataFrame
        The log.
    params : BenchParameters
        The nominal simulator.
    """

    def __init__(self, log: pd.DataFrame, params: BenchParameters) -> None:
        self.log, self.params = log, params
        self.base = view(log, params)
        self.T = _tolerances(log, params, self.base)
        self.y = self.base.value * self.base.weight
        self.fold = self.base.run % min(3, len(self.base.runs))
        self.blocks = _blocks(self.base)
        self.ridge = np.ones(self.T.shape[1])
        self.nominal = self.left(np.zeros((len(self.y), 0)))[0]

    def left(self, extra: np.ndarray) -> tuple[np.ndarray, float]:
        """Return the whitened residuals of each fold under a fit to the others, and the fits' own error."""
        A = np.column_stack([self.T, extra])
        ridge = np.concatenate([self.ridge, np.full(extra.shape[1], 1e-9)])
        left, trained = np.empty_like(self.y), 0.0
        for k in np.unique(self.fold):
            test = self.fold == k
            train = ~test if not test.all() else test
            x = _solve(A[train], self.y[train], ridge)
            for _ in range(3):
                w = _bend(self.y[train] + A[train] @ x)
                x = _solve(A[train] * w[:, None], self.y[train] * w, ridge)
            left[test] = self.y[test] + A[test] @ x
            trained += float(np.sum(loss(self.y[train] + A[train] @ x)))
        return left, trained

    def folds(self) -> list[tuple[np.ndarray, np.ndarray]]:
        """Return the rows to fit and the rows held out, for each fold."""
        tests = [self.fold == k for k in np.unique(self.fold)]
        return [(~t if not t.all() else t, t) for t in tests]

    def closed(self, after: np.ndarray) -> float | None:
        """Return the share of the gap beyond the noise that is closed in held-out trajectories; None without a gap."""
        start, floor = float(np.sum(self.nominal**2)), float(len(self.y))
        return (start - float(np.sum(after**2))) / (start - floor) if start > 1.2 * floor else None

    def sensitivities(self, name: str) -> list[np.ndarray]:
        """Return what an effect at some sizes adds to the whitened residuals."""
        cls = all_effects()[name]
        first, out = cls.parameters[0], []
        neutral = {"polytropic_exponent": 1.4, "end_cap": 1.0, "valve_saturation": 1.0}.get(name, 0.0)
        touched = [e for e in cls.equations if e in self.base.names]
        rows = np.isin(self.base.equation, [self.base.names.index(e) for e in touched])
        for scale in SCALES:
            size = first.nominal * scale if name == "heat_transfer" else neutral + (first.nominal - neutral) * scale
            values = {p.name: p.nominal for p in cls.parameters} | {first.name: size}
            with np.errstate(all="ignore"):  # a usual size may be far too much for this bench
                with_it = view(self.log, self.params.replace(effects=((name, values),)), touched)
            column = np.zeros_like(self.y)
            if len(with_it.value) == rows.sum():
                column[rows] = (with_it.value - self.base.value[rows]) * self.base.weight[rows]
            if np.any(column) and np.all(np.isfinite(column)):
                out.append(column)
        return out


def ranking(shared: HeldOut, names: Sequence[str]) -> tuple[Answer, dict[str, float]]:
    """Rank the library by held-out error; also return the share of the gap that each effect closes there."""
    began = time.perf_counter()
    before = shared.nominal
    error, closed, best_left = {}, {}, before
    for name in names:
        best, trained = before, np.inf
        for column in shared.sensitivities(name):
            left, now = shared.left(column[:, None])
            if now < trained:
                best, trained = left, now
        error[name] = float(np.sum(loss(best)))
        closed[name] = shared.closed(best)
        if error[name] == min(error.values()):
            best_left = best
    gap = _t(before, best_left, shared.blocks) > _SURE
    score = {n: -0.5 * e for n, e in error.items()} | {"none": -0.5 * float(np.sum(loss(before))), "unknown": -np.inf}
    confidence = _softmax(score)
    if not gap:
        confidence = {"none": 1.0} | {n: 0.0 for n in confidence if n != "none"}
    head = max(confidence, key=lambda k: confidence[k])
    verdict = "cause" if gap and head != "none" else "none"
    answer = Answer(
        gap=verdict == "cause",
        verdict=verdict,
        confidence=confidence,
        causes=((head,),) if verdict == "cause" else (),
        families={n: all_effects()[n].family for n in names},
        equation=_where(shared, before) if gap else None,
        realised=closed.get(head),
        seconds=time.perf_counter() - began,
    )
    return answer, {n: c for n, c in closed.items() if c is not None}


def _where(shared: HeldOut, left: np.ndarray) -> str:
    excess = np.bincount(shared.base.equation, left**2 - 1.0, minlength=4) / np.maximum(
        np.bincount(shared.base.equation, minlength=4), 1
    )
    return shared.base.names[int(np.argmax(excess))]


# --- features of the state, for the learners -------------------------------------------------------------------
def features(log: pd.DataFrame, params: BenchParameters, v: View) -> dict[str, np.ndarray]:
    """Return smoothed signals of each residual's muscle, scaled to about one."""
    from scipy.signal import savgol_filter

    ratio = params.joint.pulley_radius / params.muscle.rest_length
    out = {
        k: np.zeros(len(v.value)) for k in ("eps", "deps", "gauge", "dP", "u", "du", "mdot", "q", "dq", "ddq", "time")
    }
    for k, (_, run) in enumerate(log.groupby("trajectory", sort=False)):
        t = run["time"].to_numpy()
        at = v.run == k
        q = [savgol_filter(run["q"].to_numpy(float), 41, 3, deriv=d, delta=1e-3) for d in (0, 1, 2)]
        for name, x in zip(("q", "dq", "ddq"), q, strict=True):
            out[name][at] = np.interp(v.time[at], t, x)
        out["time"][at] = v.time[at]
        for side in (0, 1):
            rows = at & (v.side == side)
            sign = 1.0 - 2.0 * side
            P = run[f"P{side + 1}"].to_numpy(float)
            u = savgol_filter(run[f"u{side + 1}"].to_numpy(float), 21, 1)
            series = {
                "eps": params.muscle.initial_contraction + sign * ratio * q[0],
                "deps": sign * ratio * q[1],
                "gauge": savgol_filter(P, 41, 3) - params.gas.atmospheric_pressure,
                "dP": savgol_filter(P, 41, 3, deriv=1, delta=1e-3),
                "u": u,
                "du": np.gradient(u, 1e-3),
                "mdot": savgol_filter(run[f"mdot{side + 1}"].to_numpy(float), 21, 1),
            }
            for name, x in series.items():
                out[name][rows] = np.interp(v.time[rows], t, x)
    return {k: x / max(float(np.std(x)), 1e-12) for k, x in out.items()}


TERMS: dict[str, dict[str, str]] = {
    "force": {
        "1": "force_bias", "sign(deps)": "coulomb_friction",
        "deps": "viscous_friction", "deps*gauge": "viscous_friction",
        "sign(deps)*gauge": "coulomb_friction", "eps": "bladder_elasticity", "eps^2": "bladder_elasticity",
        "gauge": "pressure_gain", "gauge^2": "thread_extensibility", "gauge*eps": "end_cap", "gauge*eps^2": "diameter",
        "dP": "pressure_lag",
    },
    "flow": {
        "1": "flow_bias", "gauge": "leakage", "gauge^2": "leakage", "dP": "dead_volume", "gauge*deps": "diameter",
        "dP*eps": "polytropic_exponent", "mdot": "gas_temperature", "deps": "angle_gain",
    },
    "valve": {
        "1": "flow_bias", "u": "valve_conductance", "|u|": "valve_asymmetry", "du": "valve_lag",
        "u^3": "valve_saturation",
        "sign(u)": "valve_dead_zone", "u*gauge": "pressure_bias", "u|u|": "supply_droop",
    },
    "joint": {"1": "gravity", "q": "gravity", "dq": "joint_damping", "ddq": "inertia", "q^3": "gravity"},
}  # fmt: skip
"""Terms of the library that SINDy chooses from, and the effect that each stands for."""


def _term(name: str, f: dict[str, np.ndarray]) -> np.ndarray:
    out = np.ones_like(f["q"])
    if name == "1":
        return out
    if name == "u|u|":
        return f["u"] * np.abs(f["u"])
    for part in name.split("*"):
        base, _, power = part.partition("^")
        if base.startswith("sign("):
            x = np.tanh(8.0 * f[base[5:-1]])
        elif base.startswith("|"):
            x = np.abs(f[base[1:-1]])
        else:
            x = f[base]
        out = out * x ** int(power or 1)
    return out


def sindy(shared: HeldOut, f: dict[str, np.ndarray]) -> Answer:
    """Sparse regression of what a refit leaves, by PySINDy's STLSQ; its dominant term names the effect."""
    began = time.perf_counter()
    from pysindy import STLSQ

    v, y = shared.base, shared.nominal
    score: dict[str, float] = {}
    after = y.copy()
    for k, (_, terms) in enumerate(TERMS.items()):
        rows = v.equation == k
        if not rows.any():
            continue
        A = np.column_stack([_term(t, f) for t in terms])
        A = A / np.maximum(np.sqrt(np.mean(A[rows] ** 2, axis=0)), 1e-12)
        # The threshold that predicts best is taken, which is in the rival's favour.
        tried = [_chosen_terms(STLSQ, A, y, rows, shared, threshold) for threshold in (0.05, 0.15, 0.4)]
        left, sizes = min(tried, key=lambda result: float(np.sum(loss(result[0]))))
        after[rows] = left
        for name, size in zip(terms.values(), sizes, strict=True):
            score[name] = score.get(name, 0.0) + size * float(rows.sum())
    gap = _t(y, after, shared.blocks) > _SURE and any(score.values())
    total = sum(score.values())
    confidence = {n: s / total for n, s in score.items()} if gap else {}
    confidence |= {"none": 0.0 if gap else 1.0, "unknown": 0.0}
    head = max(confidence, key=lambda n: confidence[n])
    return Answer(
        gap=bool(gap),
        verdict="cause" if gap else "none",
        confidence=confidence,
        causes=((head,),) if gap else (),
        families={n: c.family for n, c in all_effects().items()},
        equation=_where(shared, y) if gap else None,
        realised=shared.closed(after),
        seconds=time.perf_counter() - began,
    )


def _chosen_terms(
    optimizer: Any, A: np.ndarray, y: np.ndarray, rows: np.ndarray, shared: HeldOut, threshold: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return the held-out residuals of an equation, and the squared coefficients summed over the folds."""
    left, sizes = y.copy(), np.zeros(A.shape[1])
    for train, test in shared.folds():
        B, z = A[rows & train], y[rows & train]
        w = _bend(z)  # peaks are bent in first, as for every rival
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            limit = threshold * max(1.0, float(np.std(z * w)))
            fit = optimizer(threshold=limit, alpha=0.01 * len(z)).fit(B * w[:, None], (z * w)[:, None])
        coefficient = np.ravel(fit.coef_)
        left[rows & test] -= A[rows & test] @ coefficient
        sizes += coefficient**2
    return left[rows], sizes


def black_box(shared: HeldOut, f: dict[str, np.ndarray], seed: int = 0) -> Answer:
    """Gradient-boosted trees on the state and its recent past: finds a gap and closes it, names nothing."""
    began = time.perf_counter()
    from sklearn.ensemble import HistGradientBoostingRegressor

    v, y = shared.base, shared.nominal
    X = np.column_stack([*f.values(), *(_past(x, v, n) for x in (f["eps"], f["gauge"], f["u"]) for n in (2, 8))])
    after = y.copy()
    for k in range(4):
        rows = v.equation == k
        if not rows.any():
            continue
        limit = 30.0 * max(1.0, float(np.median(np.abs(y[rows]))))
        for train, test in shared.folds():
            model = HistGradientBoostingRegressor(max_iter=60, learning_rate=0.1, max_leaf_nodes=15, random_state=seed)
            model.fit(X[rows & train], np.clip(y[rows & train], -limit, limit))
            after[rows & test] -= model.predict(X[rows & test])
    gap = _t(y, after, shared.blocks) > _SURE
    return Answer(
        gap=bool(gap),
        verdict="unknown" if gap else "none",
        equation=_where(shared, y) if gap else None,
        realised=shared.closed(after),
        seconds=time.perf_counter() - began,
    )


def _past(x: np.ndarray, v: View, windows: int) -> np.ndarray:
    """Return a feature some windows before, within its run and side; the first ones repeat."""
    out = np.empty_like(x)
    for key in np.unique(np.stack([v.equation, v.run, v.side]), axis=1).T:
        rows = np.flatnonzero((v.equation == key[0]) & (v.run == key[1]) & (v.side == key[2]))
        out[rows] = x[rows[np.maximum(np.arange(len(rows)) - windows, 0)]]
    return out
