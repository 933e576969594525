"""Which effects of the library a log of the bench would show, and which it could not distinguish, by its simulator."""

from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np

from ..bench import simulate
from ..bench.parameters import BenchParameters
from ..effects import all_effects
from ..effects.registry import chosen_effects
from ..equations.log import BenchLog
from ..explained import explained_fields
from ..gap.design.family import STANDARD
from ..gap.residuals.bench import Evidence

SEEN = 5.0
"""Standard deviations of the noise that an effect must stand out by."""
ALIKE = 0.15
"""Share of an effect that another one must leave unexplained; with less the two are alike. A form known only to within
some ten per cent allows no finer distinction."""
_MOST_ROWS = 60_000


@explained_fields
@dataclass(frozen=True)
class Separation:
    """How well a log shows one effect of typical size.

    Examples
    --------
    >>> from pamid.survey import Separation
    >>> Separation("leakage", "gas", signal=12.0, alike=("flow_bias",), seen=True).alike
    ('flow_bias',)
    """

    effect: Annotated[str, "Its name."]
    family: Annotated[str, "Its family."]
    signal: Annotated[
        float, "Its size in standard deviations of the noise, after removing what the tolerances explain."
    ]
    alike: Annotated[tuple[str, ...], "Effects that would explain it as well."]
    seen: Annotated[bool, "Whether it would be seen at all."]


def separation(log: BenchLog, params: BenchParameters) -> tuple[list[Separation], dict[str, Any] | None]:
    """Return how separable each effect of typical size is on a log, and the run that would distinguish most others."""
    evidence = Evidence(log.whole(_MOST_ROWS), params)
    names, D = _responses(evidence)
    gram = _products(D, evidence.J)
    found = _told(names, gram)
    return found, _best_run(evidence, params, names, gram)


def _responses(evidence: Evidence) -> tuple[list[str], np.ndarray]:
    """Return the effects that change the residuals, and their changes, a column each."""
    names, columns = [], []
    known = all_effects()
    for name in chosen_effects("all", "bench"):
        if not known[name].__module__.startswith("pamid.") or not evidence.touched([name]):
            continue
        try:
            d = evidence.z({name: {p.name: p.nominal for p in known[name].parameters}}) - evidence.z0
        except (ValueError, ArithmeticError):
            continue
        if np.all(np.isfinite(d)) and np.any(d):
            names.append(name)
            columns.append(d)
    return names, np.column_stack(columns) if columns else np.zeros((len(evidence.z0), 0))


def _products(D: np.ndarray, J: np.ndarray) -> np.ndarray:
    """Return the products of columns with the tolerances projected out, at the price of their priors."""
    gram = D.T @ D
    if J.shape[1]:
        cross = J.T @ D
        gram = gram - cross.T @ np.linalg.solve(J.T @ J + np.eye(J.shape[1]), cross)
    return np.asarray(gram)


def _left(gram: np.ndarray) -> np.ndarray:
    """Return the part of effect i that effect j cannot explain, in standard deviations, for all pairs."""
    own = np.maximum(np.diag(gram), 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        taken = np.where((gram > 0) & (own[None, :] > 0), np.square(gram) / own[None, :], 0.0)
    left = np.sqrt(np.maximum(own[:, None] - taken, 0.0))
    np.fill_diagonal(left, np.inf)
    return left


def _alike(gram: np.ndarray) -> np.ndarray:
    return np.asarray(_left(gram) < np.maximum(SEEN, ALIKE * _sizes(gram))[:, None])


def _undecided(gram: np.ndarray) -> np.ndarray:
    """Return which effects, on the diagonal, are not seen and which pairs are not told apart."""
    return np.asarray(_alike(gram) | np.diag(_sizes(gram) < SEEN))


def _sizes(gram: np.ndarray) -> np.ndarray:
    return np.sqrt(np.maximum(np.diag(gram), 0.0))


def _told(names: list[str], gram: np.ndarray) -> list[Separation]:
    known, own, alike = all_effects(), _sizes(gram), _alike(gram)
    found = []
    for k, name in enumerate(names):
        seen = bool(own[k] >= SEEN)
        others = tuple(names[j] for j in np.flatnonzero(alike[k]) if own[j] >= SEEN) if seen else ()
        found.append(Separation(name, known[name].family, float(own[k]), others, seen))
    return sorted(found, key=lambda s: -s.signal)


def _best_run(evidence: Evidence, params: BenchParameters, names: list[str], gram: np.ndarray) -> dict[str, Any] | None:
    """Return the run among the diagnosis's candidates that would show or split most of the undecided effects."""
    if not names:
        return None
    open_ = _undecided(gram)
    if not open_.any():
        return None
    try:
        log = simulate(params.replace(effects=()), [run.trajectory(str(k)) for k, run in enumerate(STANDARD)], seed=0)
    except (ValueError, ArithmeticError):
        return None
    columns = {"trajectory", "time", "q_ref", "q", "u1", "u2", "P1", "P2"}
    columns |= {f"{channel}{k}" for channel in ("F", "mdot") if evidence.reads(channel) for k in (1, 2)}
    trial = Evidence(log[[c for c in log.columns if c in columns]], params)
    others, D = _responses(trial)
    at = {name: k for k, name in enumerate(others)}
    place = [at.get(name, -1) for name in names]
    known = np.array(place) >= 0
    best: dict[str, Any] | None = None
    most = 0
    for t, trajectory in enumerate(trial.trajectories):
        rows = trial.block == t
        more = _products(D[rows], trial.J[rows])
        joint = gram.copy()
        index = np.array(place)[known]
        joint[np.ix_(known, known)] += more[np.ix_(index, index)]
        gained = open_ & ~_undecided(joint)
        if (count := int(gained.sum())) > most:
            most = count
            split = [names[k] for k in np.flatnonzero(gained.any(axis=1))]
            best = {**STANDARD[int(trajectory)].as_dict(), "splits": split}
    return best
