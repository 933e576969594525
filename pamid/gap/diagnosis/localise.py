"""Where a gap lies: in which equations, regions of the state, bands of frequency and runs."""

from typing import Any

import numpy as np
import pandas as pd

from ...bench.parameters import BenchParameters
from ...equations.log import BenchLog
from ...equations.run import SIGNS, Model
from ..residuals.protocol import ResidualSource
from .findings import Band, Region, TrajectoryShare

BANDS = ((0.0, 1.0), (1.0, 5.0), (5.0, 25.0))
"""Bands of frequency, Hz; windows of 20 ms see no more than 25 Hz."""
_FEATURES = ("eps", "deps", "P", "dP", "u")
_JOINT_FEATURES = ("q", "dq", "P", "dP", "u")
ENERGY = 0.8
"""Share of a gap's energy that its regions are to hold."""
LEAVES = (4, 8, 16, 24)
"""Leaves of the tree that separates a muscle's regions; what comes after steps is a few windows in a corner."""
FINER = 0.02
"""By how much more leaves must agree better."""
LEAF = 4, 300
"""Windows in a leaf, at least so many or that part of all; fewer where the gap is in few, such as those after steps."""
PART = 4
"""Part of the windows sought that a leaf must be able to hold alone."""


def state_table(log: pd.DataFrame, params: BenchParameters) -> pd.DataFrame:
    """Return a log with columns of the state added, for the queries of a diagnosis.

    Parameters
    ----------
    log : DataFrame
        Log of the bench.
    params : BenchParameters
        The simulator.

    Returns
    -------
    DataFrame
        The log with ``dq`` (rad/s) and, for each muscle k, ``epsk``, ``depsk`` (1/s) and ``dPk`` (Pa/s).

    Examples
    --------
    >>> from pamid.bench import BenchParameters, simulate, sine
    >>> from pamid.gap import state_table
    >>> bench = BenchParameters.for_muscle("B")
    >>> table = state_table(simulate(bench, [sine(4, 15, 400)]), bench)
    >>> len(table.query("deps1 > 0 and P1 < 3e5")) > 0  # 1/s, Pa
    True
    """
    held = BenchLog.of(log)
    channels = ["P"] if held.holds("P") else []
    p = params
    turn = SIGNS * p.joint.pulley_radius / p.muscle.rest_length
    names = ["dq", *(f"{signal}{k}" for k in (1, 2) for signal in ("eps", "deps", *(["dP"] if channels else [])))]
    state = {name: np.full(len(log), np.nan) for name in names}
    time, rows_of = log["time"].to_numpy(dtype=float), dict(held.trajectories)
    for run in held.runs(Model(params), channels):
        rows = rows_of[run.trajectory]
        first, after = rows.start + np.searchsorted(time[rows], (run.time[0], run.time[-1] + 1e-3 * run.dt))
        dq = run.smooth("q", 1)
        part = {"dq": dq[:, 0]}
        for k in (0, 1):
            part[f"eps{k + 1}"], part[f"deps{k + 1}"] = run.eps[:, k], dq[:, 0] * turn[k]
            if "P" in run.channels:
                part[f"dP{k + 1}"] = run.smooth("P", 1)[:, k]
        for name, series in part.items():  # the steps of a run are even, those of a log need not be
            state[name][first:after] = np.interp(time[first:after], run.time, series)
    return log.assign(trajectory=log["trajectory"].astype(str), **state).reset_index(drop=True)


def shares(values: np.ndarray) -> np.ndarray:
    """Return values as shares of their sum; equal shares if all are zero."""
    values = np.maximum(np.asarray(values, dtype=float), 0.0)
    total = values.sum()
    return values / total if total > 0 else np.full(len(values), 1.0 / max(len(values), 1))


def regions(evidence: ResidualSource, equation: str, power: np.ndarray, most: int = 24) -> list[Region]:
    """Return the regions of the state that hold most of an equation's gap in few samples, largest share first."""
    part = evidence.parts[evidence.equations.index(equation)]
    names = _JOINT_FEATURES if equation in ("joint", "joint_modelled") else _FEATURES
    told = evidence.told(equation) if evidence.one_sided else {}
    sides, total = np.unique(evidence.side[part]), float(power[part].sum())
    found: list[Region] = []
    for side in sides:
        mine = evidence.side[part] == side
        muscle = {} if told else {evidence.column(n, int(side)): evidence.state[n] for n in names}
        state = {n: x[part][mine] for n, x in (told or muscle).items()}
        state = {n: x for n, x in state.items() if np.all(np.isfinite(x))}
        found += _of_one_side(equation, state, power[part][mine], total, len(mine), most // len(sides))
    return sorted(found, key=lambda r: -r.share)


def _of_one_side(
    equation: str, state: dict[str, np.ndarray], y: np.ndarray, total: float, windows: int, most: int
) -> list[Region]:
    from sklearn.tree import DecisionTreeClassifier

    if not state or len(y) < 100 or not np.any(y > 0):
        return []
    X = np.column_stack(list(state.values()))
    order = np.argsort(-y)
    inside = np.zeros(len(y), dtype=bool)
    inside[order[: int(np.searchsorted(np.cumsum(y[order]), ENERGY * y.sum())) + 1]] = True
    if inside.mean() > 0.95:
        return []
    best: tuple[float, Any, set[int], np.ndarray] | None = None
    least = int(np.clip(inside.sum() // PART, 1, max(LEAF[0], len(y) // LEAF[1])))
    for leaves in LEAVES:
        fitted = DecisionTreeClassifier(max_leaf_nodes=leaves, min_samples_leaf=least, random_state=0)
        leaf = fitted.fit(X, inside).apply(X)
        f1, chosen = _agreeing(leaf, inside)
        if best is None or f1 > best[0] + FINER:
            best = f1, fitted.tree_, chosen, leaf
    assert best is not None
    _, tree, chosen, leaf = best
    found = []
    for node in _whole_branches(tree, chosen):
        mine = np.isin(leaf, _leaves_below(tree, node))
        found.append(
            Region(equation, _path(tree, node, list(state)), float(y[mine].sum() / total), float(mine.sum() / windows))
        )
    return sorted((r for r in found if r.query), key=lambda r: -r.share)[:most]


def _agreeing(leaf: np.ndarray, inside: np.ndarray) -> tuple[float, set[int]]:
    """Return the leaves whose union agrees best with a set of windows, and how well: F1, of precision and recall."""
    nodes, at, size = np.unique(leaf, return_inverse=True, return_counts=True)
    hits = np.bincount(at, inside)
    order = np.argsort(-hits / size, kind="stable")
    f1 = 2.0 * np.cumsum(hits[order]) / (np.cumsum(size[order]) + inside.sum())
    k = int(np.argmax(f1))
    return float(f1[k]), {int(n) for n in nodes[order[: k + 1]]}


def _leaves_below(tree: Any, node: int) -> list[int]:
    if tree.children_left[node] < 0:
        return [node]
    return [leaf for side in (tree.children_left, tree.children_right) for leaf in _leaves_below(tree, int(side[node]))]


def _whole_branches(tree: Any, chosen: set[int]) -> list[int]:
    """Return the fewest nodes whose leaves are the chosen ones."""

    def below(node: int) -> list[int]:
        if set(_leaves_below(tree, node)) <= chosen:
            return [node]
        if tree.children_left[node] < 0:
            return []
        return below(int(tree.children_left[node])) + below(int(tree.children_right[node]))

    return below(0)


def _path(tree: Any, node: int, columns: list[str]) -> str:
    """Return the conditions that lead to a leaf, one for each bound of each signal."""
    parent: dict[int, tuple[int, bool]] = {}
    for k in range(tree.node_count):
        for child, right in ((tree.children_left[k], False), (tree.children_right[k], True)):
            if child >= 0:
                parent[int(child)] = (k, right)
    low: dict[str, float] = {}
    high: dict[str, float] = {}
    while node in parent:
        node, right = parent[node]
        name, value = columns[tree.feature[node]], float(tree.threshold[node])
        if right:
            low[name] = max(low.get(name, -np.inf), value)
        else:
            high[name] = min(high.get(name, np.inf), value)
    terms = []
    for name in columns:
        if name in low:
            terms.append(f"{name} > {low[name]:.4g}")
        if name in high:
            terms.append(f"{name} <= {high[name]:.4g}")
    return " and ".join(terms)


def bands(evidence: ResidualSource, equation: str, gap: np.ndarray) -> list[Band]:
    """Return how the power of an equation's gap is spread over frequency."""
    part = evidence.parts[evidence.equations.index(equation)]
    g, run, side, time = gap[part], evidence.run[part], evidence.side[part], evidence.time[part]
    edges = np.array(BANDS) * evidence.pace
    power = np.zeros(len(BANDS))
    for key in np.unique(np.column_stack([run, side]), axis=0):
        mine = (run == key[0]) & (side == key[1])
        x, t = g[mine], time[mine]
        if len(x) < 8:
            continue
        spectrum = np.abs(np.fft.rfft(x)) ** 2
        spectrum[1:] *= 2.0
        f = np.fft.rfftfreq(len(x), float(np.median(np.diff(t))))
        for k, (low, high) in enumerate(edges):
            power[k] += float(spectrum[(f >= low) & (f < high + (1e-9 if k == len(BANDS) - 1 else 0.0))].sum()) / len(x)
    return [Band(equation, float(a), float(b), float(s)) for (a, b), s in zip(edges, shares(power), strict=True)]


def trajectories(evidence: ResidualSource, power: np.ndarray) -> list[TrajectoryShare]:
    """Return how a gap's power is spread over the runs, the largest share first."""
    sums = np.bincount(evidence.block, power, minlength=len(evidence.trajectories))
    found = [TrajectoryShare(n, float(s)) for n, s in zip(evidence.trajectories, shares(sums), strict=True)]
    return sorted(found, key=lambda t: -t.share)
