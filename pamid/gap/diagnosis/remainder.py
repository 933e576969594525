"""The residual where no effect of the library is the cause: its dependence, rhythm and closest formula."""

from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from ..residuals.protocol import ResidualSource
from ..settings import MATERIAL
from .localise import regions

_TERMS = 3
"""Terms of the closest formula."""
TOLD = 0.01
"""Share of a gap from which the remainder is described."""
_LEAST = 200
"""Number of windows below which nothing is reported."""
FINER, PERIODS = 4, 4
"""Frequencies searched for a rhythm per frequency resolution of the longest run, and its fewest periods."""


def leftover(evidence: ResidualSource, equation: str, z: np.ndarray) -> dict[str, Any]:
    """Describe the residual of one equation: its predictable share, and a sparse formula by matching pursuit.

    After S. L. Brunton, J. L. Proctor, J. N. Kutz, PNAS 113(15), 2016. https://doi.org/10.1073/pnas.1517384113
    """
    part = evidence.parts[evidence.equations.index(equation)]
    y = (z[part] * evidence.noise[part]).clip(*np.quantile(z[part] * evidence.noise[part], (0.001, 0.999)))
    state = {
        (name if evidence.one_sided else name.removesuffix("1")): values[part]
        for name, values in evidence.told(equation).items()
        if np.all(np.isfinite(values[part])) and np.ptp(values[part]) > 0
    }
    found: dict[str, Any] = {"equation": equation}
    if len(y) < _LEAST or not state:
        return found
    excess = max(float(np.mean(y**2)) - float(np.mean(np.square(evidence.noise[part]))), 1e-300)
    found |= _learned(state, y, evidence.block[part], excess)
    found |= _rhythm(y, evidence, part)
    found |= _formula(state, y, excess)
    return found


def remainder(evidence: ResidualSource, before: np.ndarray, after: np.ndarray) -> dict[str, Any]:
    """Describe what named causes leave in the equation where they leave most."""
    room = [max(float(np.sum(np.square(before[p]))) - (p.stop - p.start), 0.0) for p in evidence.parts]
    left = [max(float(np.sum(np.square(after[p]))) - (p.stop - p.start), 0.0) for p in evidence.parts]
    at = int(np.argmax(left))
    name, part = evidence.equations[at], evidence.parts[at]
    beyond = np.mean(np.square(evidence.noise[part])) * left[at] / max(part.stop - part.start, 1)
    found: dict[str, Any] = {
        "equation": name,
        "share": float(np.clip(sum(left) / sum(room), 0.0, 1.0)) if sum(room) > 0 else 0.0,
        "rmse": float(np.sqrt(beyond)),
        "unit": evidence.units[name],
        "regions": [],
        "depends_on": [],
    }
    if found["share"] > TOLD:
        power = np.maximum(np.square(after) - 1.0, 0.0) * np.square(evidence.noise)
        found["regions"] = [r.query for r in regions(evidence, name, power)[:3]]
        found["depends_on"] = leftover(evidence, name, after).get("depends_on", [])
    return found


def _learned(state: dict[str, np.ndarray], y: np.ndarray, block: np.ndarray, excess: float) -> dict[str, Any]:
    from sklearn.ensemble import HistGradientBoostingRegressor
    from sklearn.model_selection import GroupKFold, cross_val_predict

    groups = block if len(np.unique(block)) > 2 else (4 * np.arange(len(y))) // len(y)
    X = np.column_stack(list(state.values()))
    learner = HistGradientBoostingRegressor(max_iter=60, min_samples_leaf=30, random_state=0)
    with threadpool_limits(1, user_api="openmp"):  # as in `floor`: trees are small
        predicted = cross_val_predict(learner, X, y, groups=groups, cv=GroupKFold(min(4, len(np.unique(groups)))))
        share = (float(np.mean(y**2)) - float(np.mean((y - predicted) ** 2))) / excess
        learner.fit(X, y)
        whole = float(np.mean((y - learner.predict(X)) ** 2))
        rng, loss = np.random.RandomState(0), {}
        for k, name in enumerate(state):
            mixed = X.copy()
            mixed[:, k] = mixed[rng.permutation(len(X)), k]
            loss[name] = float(np.mean((y - learner.predict(mixed)) ** 2)) - whole
    names = [n for n in sorted(loss, key=lambda n: -loss[n]) if loss[n] > MATERIAL * max(loss.values())]
    return {"predictable_share": float(np.clip(share, 0.0, 1.0)), "depends_on": names if share > MATERIAL else []}


def _rhythm(y: np.ndarray, evidence: ResidualSource, part: slice) -> dict[str, Any]:
    """Return the frequency at which all runs together have a line, and its share of the power."""
    run, side, time = evidence.run[part], evidence.side[part], evidence.time[part]
    step = float(np.median(np.diff(time[(run == run[0]) & (side == side[0])])))
    pieces = [(run == r) & (side == s) for r, s in np.unique(np.column_stack([run, side]), axis=0)]
    pieces = [mine for mine in pieces if mine.sum() >= 50]
    spans = [np.round((time[mine] - time[mine][0]) / step).astype(int) for mine in pieces]
    if not spans:
        return {}
    size = 1 + max(int(at[-1]) for at in spans)
    whole = 1 << (FINER * size - 1).bit_length()
    grid = np.fft.rfftfreq(whole, step)
    power, total = np.zeros(len(grid)), 0.0
    for mine, at in zip(pieces, spans, strict=True):
        x = y[mine] - y[mine].mean()
        even = np.zeros(whole)
        np.add.at(even, at, x)  # what was lost in between is zero
        power += 2.0 * np.abs(np.fft.rfft(even)) ** 2 / len(x)
        total += float(x @ x)
    power[grid < PERIODS / (size * step)] = 0.0  # fewer periods are a drift
    if not total:
        return {}
    best = int(np.argmax(power))
    return {"peak_hz": float(grid[best]), "peak_share": float(min(power[best] / total, 1.0))}


def _formula(state: dict[str, np.ndarray], y: np.ndarray, excess: float) -> dict[str, Any]:
    from sklearn.linear_model import OrthogonalMatchingPursuit

    scales = {name: float(np.std(x)) for name, x in state.items()}
    centred = {name: (x - np.mean(x)) / scales[name] for name, x in state.items()}
    terms: dict[str, np.ndarray] = {"1": np.ones(len(y))}
    for name, x in centred.items():
        terms[f"{name}~"], terms[f"{name}~^2"] = x, x * x
        terms[f"sign({name}~)"] = np.tanh(5.0 * x)
    names = list(centred)
    for i, a in enumerate(names):
        for b in names[i + 1 :]:
            terms[f"{a}~*{b}~"] = centred[a] * centred[b]
    X = np.column_stack(list(terms.values()))
    fit = OrthogonalMatchingPursuit(n_nonzero_coefs=_TERMS, fit_intercept=False).fit(X, y)
    left = float(np.mean((y - fit.predict(X)) ** 2))
    chosen = [k for k in np.argsort(-np.abs(fit.coef_)) if fit.coef_[k]]
    text = " ".join(f"{fit.coef_[k]:+.3g} {list(terms)[k]}" for k in chosen)
    share = float(np.clip((float(np.mean(y**2)) - left) / excess, 0.0, 1.0))
    return {
        "formula": text,
        "formula_share": share,
        "standardised": "x~ is x less its mean, divided by its standard deviation",
    }
