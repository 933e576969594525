"""Two rivals for the open set: is the cause of a gap one that was seen before, told from what the residuals look like.

Both see a signature of each log: how large and how coloured the residuals of each equation are after a refit within the
tolerances, and how they go with terms of the state. They learn it from development logs of every effect of the library,
and a forest names the effect. The **autoencoder** calls a cause unknown where its error of reconstruction is above the
95th percentile of that on logs that it had not seen; the **conformal test** where the distance to the nearest logs of
any effect is among the largest twentieth of that of a calibration half.

References
----------
S. Bates, E. Candès, L. Lei, Y. Romano, M. Sesia, "Testing for outliers with conformal p-values", Annals of Statistics
51(1), 2023. https://doi.org/10.1214/22-AOS2244
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from .metrics import Answer
from .rivals import TERMS, HeldOut, _term, features

NOVEL = 0.05
"""Share of logs of known causes that may be called unknown."""
NEIGHBOURS = 3
"""Nearest logs whose mean distance says how strange one is."""
CODE = 8
"""Numbers that the autoencoder squeezes a signature into."""
METHODS = ("autoencoder", "conformal test")


def signature(log: Any, params: Any) -> list[float]:
    """Return what the residuals of a log look like, some forty numbers.

    Parameters
    ----------
    log : DataFrame
        The log.
    params : BenchParameters
        The nominal simulator.
    """
    shared = HeldOut(log, params)
    f = features(log, params, shared.base)
    found: list[float] = []
    for k, terms in enumerate(TERMS.values()):
        rows = np.flatnonzero(shared.base.equation == k)
        y = shared.nominal[rows]
        size = max(1.4826 * float(np.median(np.abs(y))), 1e-12) if len(y) else 1.0
        y = np.clip(y, -6.0 * size, 6.0 * size)
        power = max(float(np.sqrt(np.mean(np.square(y)))), 1e-12) if len(y) else 1.0
        found.append(float(np.log(power)) if len(y) else 0.0)
        # Windows of both muscles take turns.
        found += [float(np.mean(y[lag:] * y[:-lag])) / power**2 if len(y) > lag else 0.0 for lag in (2, 20)]
        for term in terms:
            x = _term(term, f)[rows]
            x = x - x.mean() if term != "1" and len(x) else x
            norm = float(np.sqrt(np.mean(np.square(x)))) if len(x) else 0.0
            found.append(float(np.mean(x * y)) / (norm * power) if norm > 0.0 else 0.0)
    return found


def known(results: Sequence[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    """Return the cases with one effect of the library whose signature was taken: what the rivals learn from."""
    from .catalogue import VOCABULARY

    return [
        r
        for r in results
        if r.get("signature") and len(r["key"]["effects"]) == 1 and set(r["key"]["effects"]) <= set(VOCABULARY)
    ]


def judged(
    learned: Sequence[Mapping[str, Any]], results: Sequence[Mapping[str, Any]], seed: int = 0
) -> dict[str, dict[str, Any]]:
    """Return what both rivals answer to each case with a gap, by name and method.

    Parameters
    ----------
    learned : sequence of mapping
        Development cases, see `known`.
    results : sequence of mapping
        Cases to answer; those without a signature are left out.
    seed : int, default=0
        Seed of forests, networks and the split.
    """
    groups: dict[tuple[str, ...], list[Mapping[str, Any]]] = {}
    for r in results:
        if r.get("signature") and r["key"]["effects"]:
            groups.setdefault(tuple(r["key"]["left_out"]), []).append(r)
    out: dict[str, dict[str, Any]] = {}
    for left_out, asked in groups.items():
        # A name taken out of the library is one that the rivals have not seen, either.
        seen = [r for r in learned if next(iter(r["key"]["effects"])) not in left_out]
        out |= _judged(seen, asked, seed)
    return out


def _judged(
    learned: Sequence[Mapping[str, Any]], asked: Sequence[Mapping[str, Any]], seed: int
) -> dict[str, dict[str, Any]]:
    from sklearn.ensemble import RandomForestClassifier
    from sklearn.neural_network import MLPRegressor
    from sklearn.preprocessing import StandardScaler

    from pamid.effects import all_effects

    scaler = StandardScaler().fit([r["signature"] for r in learned])
    X, Z = (np.clip(scaler.transform([r["signature"] for r in part]), -5.0, 5.0) for part in (learned, asked))
    label = np.array([next(iter(r["key"]["effects"])) for r in learned])
    forest = RandomForestClassifier(400, min_samples_leaf=2, class_weight="balanced", random_state=seed).fit(X, label)
    rng = np.random.default_rng(seed)
    half = rng.permutation(len(X)) < len(X) // 2
    network = MLPRegressor(
        hidden_layer_sizes=(24, CODE, 24), activation="tanh", alpha=1e-2, max_iter=3000, random_state=seed
    )
    network.fit(X[half], X[half])
    strange = {
        "autoencoder": [np.mean(np.square(network.predict(x) - x), axis=1) for x in (X[~half], Z)],
        "conformal test": [_distance(X[half], x) for x in (X[~half], Z)],
    }
    share = forest.predict_proba(Z)
    families = {n: c.family for n, c in all_effects().items()}
    out: dict[str, dict[str, Any]] = {}
    for i, r in enumerate(asked):
        belief = {str(n): float(p) for n, p in zip(forest.classes_, share[i], strict=True)}
        head = max(belief, key=lambda n: belief[n])
        for method, (calm, now) in strange.items():
            p = (1.0 + float(np.sum(calm >= now[i]))) / (1.0 + len(calm))
            novel = p <= NOVEL
            rest = 0.0 if novel else 1.0
            confidence = {n: rest * v for n, v in belief.items()} | {"none": 0.0, "unknown": 1.0 - rest}
            verdict, causes = ("unknown", ()) if novel else ("cause", ((head,),))
            answer = Answer(gap=True, verdict=verdict, confidence=confidence, causes=causes, families=families)
            out.setdefault(r["name"], {})[method] = asdict(answer)
    return out


def _distance(known: np.ndarray, asked: np.ndarray) -> np.ndarray:
    """Return the mean distance to the nearest of known points."""
    apart = np.sqrt(np.sum(np.square(asked[:, None, :] - known[None, :, :]), axis=2))
    return np.asarray(np.mean(np.sort(apart, axis=1)[:, :NEIGHBOURS], axis=1))
