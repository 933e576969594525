"""Rivals on the same logs: a fit of the simulator's own parameters, and boosted trees on its residual."""

from __future__ import annotations

from typing import Any

import numpy as np

from pamid.gap.residuals.ports import PortEvidence

ROUNDS = 6
CLEAR = 3.0
"""Standard errors by which held-out error must fall for a rival to see a gap."""


def parameter_fit(evidence: PortEvidence, future: PortEvidence) -> dict[str, Any]:
    """Fit the simulator's parameters without bounds, and name the one that leaves its tolerance furthest."""
    names = evidence.free
    x = np.zeros(len(names))

    def left(source: PortEvidence, x: np.ndarray) -> np.ndarray:
        return source.z({}, dict(zip(names, map(float, x), strict=True)))

    z = left(evidence, x)
    for _ in range(ROUNDS):
        J = np.column_stack([left(evidence, x + np.eye(len(x))[k]) - z for k in range(len(x))])
        step = np.linalg.lstsq(J, -z, rcond=None)[0]
        trial = np.clip(x + np.clip(step, -4.0, 4.0), -15.0, 15.0)
        found = left(evidence, trial)
        if float(found @ found) >= float(z @ z) * (1 - 1e-6):
            break
        x, z = trial, found
    far = int(np.argmax(np.abs(x)))
    gap = bool(np.abs(x[far]) > 1.0) and _t(evidence.z({}), z, evidence.run) > CLEAR
    effect, port = ("parameter_deviation", names[far]) if gap else ("none", "")
    return {
        "effect": effect,
        "port": port,
        "named": gap,
        "closed": _closed(left(future, np.zeros_like(x)), left(future, x)),
    }


def trees(evidence: PortEvidence, future: PortEvidence) -> dict[str, Any]:
    """Learn each equation's residual from all signals; the port is the signal that matters most."""
    from sklearn.ensemble import HistGradientBoostingRegressor

    signals, later = evidence.signals(), future.signals()
    names = sorted(n for n in signals if np.ptp(signals[n]) > 0.0 and n in later)
    weight = dict.fromkeys(names, 0.0)
    gap, before, after = False, 0.0, 0.0
    rng = np.random.default_rng(0)
    for part, then in zip(evidence.parts, future.parts, strict=True):
        X = np.column_stack([signals[n][evidence.centre[part]] for n in names])
        y, run = evidence.value[part] / evidence.noise[part], evidence.run[part]
        held = np.zeros_like(y)
        for k in np.unique(run):
            model = HistGradientBoostingRegressor(max_iter=60, max_leaf_nodes=15, random_state=0)
            model.fit(X[run != k], y[run != k])
            held[run == k] = model.predict(X[run == k])
        if _t(y, y - held, run) > CLEAR and np.mean(np.square(y - held)) < 0.95 * np.mean(np.square(y)):
            gap = True
        model = HistGradientBoostingRegressor(max_iter=60, max_leaf_nodes=15, random_state=0).fit(X, y)
        base = np.mean(np.square(y - model.predict(X)))
        for j, n in enumerate(names):
            moved = X.copy()
            moved[:, j] = rng.permutation(moved[:, j])
            weight[n] += float(np.mean(np.square(y - model.predict(moved))) - base)
        scale = np.mean(evidence.noise[part])
        z = future.value[then] / scale
        Xf = np.column_stack([later[n][future.centre[then]] for n in names])
        before += float(np.sum(np.square(z)))
        after += float(np.sum(np.square(z - model.predict(Xf))))
    port = max(weight, key=lambda n: weight[n]) if gap else ""
    closed = 1.0 - after / before if gap and before > 0 else 0.0
    return {"effect": "" if gap else "none", "port": port, "named": False, "gap": gap, "closed": closed}


def _t(before: np.ndarray, after: np.ndarray, run: np.ndarray) -> float:
    """Return by how many standard errors the squared error falls, over blocks of twenty windows."""
    gain = np.square(before) - np.square(after)
    n = len(gain) // 20 * 20
    blocks = gain[:n].reshape(-1, 20).mean(axis=1)
    return float(blocks.mean() / (blocks.std(ddof=1) / np.sqrt(len(blocks)) + 1e-300))


def _closed(before: np.ndarray, after: np.ndarray) -> float:
    return 1.0 - float(after @ after) / max(float(before @ before), 1e-300)
