"""Whether there is a gap at all: the best score over the whole library against its distribution under noise alone."""

from collections.abc import Iterable, Iterator
from itertools import islice
from typing import NamedTuple

import numpy as np

from ...signals.noise import SPREAD
from ..residuals.protocol import ResidualSource, lanes
from ..settings import FAR, FEW, NOISE_KNOWN, NU
from .gauss_newton import Fit
from .sensitivity import Template

REPLICATES = 199
_AT_ONCE = 64  # templates, so that they take less memory than the draws; the answer is the same for any number
ALIKE = 0.01
"""Share of an effect that parameters within their tolerances must leave for it to be told from them. What is left of
less is of second order: a change that makes residuals and their noise smaller, which no score of first order counts."""


class Significance(NamedTuple):
    """The test of no gap."""

    observed: float
    """The largest score of the library, a gain in log-likelihood less its penalty."""
    p_value: float
    """Probability of as large a score without a gap."""
    threshold: float
    """Score that noise alone exceeds in one of a hundred logs."""


def library_test(
    evidence: ResidualSource, fit: Fit, found: Iterable[Template], random_state: np.random.RandomState
) -> Significance:
    """Test whether any effect of the library explains more than chance does: wild-bootstrap maxima, Gumbel tail.

    C. F. J. Wu, The Annals of Statistics 14(4), 1986. https://doi.org/10.1214/aos/1176350142
    """
    found = list(found)
    if not found:
        return Significance(0.0, 1.0, np.inf)
    root = np.empty(len(fit.z))
    for part, s in zip(evidence.parts, fit.scales, strict=True):
        root[part] = np.sqrt((NU + 1.0) / (NU + np.square(fit.z[part] / s))) / s
    zw = fit.z * root
    # A parameter at the end of its tolerance cannot go further that way: an effect may replace what is beyond.
    J = (evidence.J * root[:, None])[:, fit.inside]
    Q = np.linalg.qr(J)[0] if J.shape[1] else J
    signs = _signs(evidence, random_state)
    Z = np.column_stack([zw, zw[:, None] * signs])
    Z -= Q @ (Q.T @ Z)
    best = np.full(Z.shape[1], -np.inf)
    directions = _directions(found, root, Q)
    while some := list(islice(directions, _AT_ONCE)):
        # One product for many templates: the draws are far more numbers than these, and are read once.
        along = np.concatenate([U for U, *_ in some], axis=1).T @ Z
        ends = np.cumsum([U.shape[1] for U, *_ in some])
        for (U, positive, of), own in zip(some, np.split(along, ends[:-1]), strict=True):
            score = 0.5 * np.sum(own * own, axis=0)
            if positive:
                score = np.where(own[0] < 0.0, score, 0.0)
            if of > 1.0:
                score[1:] = best_of(of, score[1:], len(own))
            best = np.maximum(best, score - least_penalty(U.shape[1], evidence))
    drawn = best[1:]
    spread = max(float(np.std(drawn)) * np.sqrt(6.0) / np.pi, 0.3)
    place = float(np.mean(drawn)) - 0.5772 * spread
    p = -np.expm1(-np.exp(-(best[0] - place) / spread))
    return Significance(float(best[0]), float(p), place - spread * float(np.log(-np.log(0.99))))


def best_of(many: float, score: np.ndarray, k: int) -> np.ndarray:
    """Return what draws of a score of k parameters are as draws of the best of many independent ones."""
    from scipy.special import chdtrc, chdtri

    rare = np.log1p(-np.minimum(chdtrc(k, 2.0 * score), 1.0 - np.finfo(float).eps)) / many
    return np.maximum(score, 0.5 * chdtri(k, np.maximum(-np.expm1(rare), np.finfo(float).tiny)))


def _directions(found: Iterable[Template], root: np.ndarray, Q: np.ndarray) -> Iterator[tuple[np.ndarray, bool, float]]:
    """Yield an orthonormal basis of a template's changes beside tolerances, whether it is of one sign, and `of`."""
    for t in found:
        whole = t.columns * root[:, None]
        T = whole - Q @ (Q.T @ whole)
        size = np.sqrt(np.sum(T * T, axis=0))
        usable = size > ALIKE * np.sqrt(np.sum(whole * whole, axis=0))
        if not usable.any():
            continue
        T = T[:, usable] / size[usable]
        if T.shape[1] == 1:
            yield T, bool(t.lower[usable][0] >= 0.0), t.of  # an amplitude that cannot be negative
            continue
        U, s, _ = np.linalg.svd(T, full_matrices=False)
        U = U[:, s > 1e-4 * s[0]]
        positive = U.shape[1] == 1 and bool(t.lower[usable][0] >= 0.0)
        yield (U * np.sign(U[:, 0] @ T[:, 0]) if positive else U), positive, t.of


def least_penalty(k: int, evidence: ResidualSource) -> float:
    """Return the provisional price of k parameters of one effect: Schwarz's price, once; others may matter little."""
    return 0.5 * float(np.log(max(len(evidence.z0), 2))) + 1.5 * (k - 1)


def _signs(evidence: ResidualSource, random_state: np.random.RandomState) -> np.ndarray:
    """Draw the sign of every stretch of time of every run, shape (n_windows, REPLICATES).

    It is one for all equations: the noise of a reading is in each that reads it.
    """
    stretch = np.floor(evidence.time / evidence.stretch).astype(int)
    _, label = np.unique(np.column_stack([evidence.run, stretch]), axis=0, return_inverse=True)
    draws = random_state.randint(0, 2, size=(label.max() + 1, REPLICATES)) * 2 - 1
    return draws[label.ravel()]


class Excess(NamedTuple):
    """How far an equation's residual is above its noise."""

    scale: float
    """Robust scale of the residual in units of the noise."""
    p_value: float
    """Probability of as much if the noise is known to `NOISE_KNOWN`, and as well as the log's rows show it."""


def excess(evidence: ResidualSource, z: np.ndarray, part: slice, size: float) -> Excess:
    """Return how far an equation's residual exceeds its noise, with stretches of time as units."""
    from scipy.special import ndtr

    stretch = np.floor(evidence.time[part] / evidence.stretch).astype(int)
    _, label = np.unique(
        np.column_stack([evidence.run[part], evidence.side[part], stretch]), axis=0, return_inverse=True
    )
    power = np.minimum(np.square(z[part]), 25.0 * size**2)
    count = np.bincount(label.ravel())
    means = np.bincount(label.ravel(), power) / count
    mean = float(np.average(means, weights=count))
    error = float(np.sqrt(np.average(np.square(means - mean), weights=count) / max(len(means) - 1, 1)))
    return Excess(size, float(ndtr((1.0 - mean) / np.hypot(error, noise_error(evidence)))))


def noise_error(evidence: ResidualSource) -> float:
    """Return the relative standard error of the noise's power."""
    return 2.0 * float(np.hypot(NOISE_KNOWN, SPREAD / np.sqrt(max(evidence.rows, 1))))


def outliers(evidence: ResidualSource, z: np.ndarray) -> float:
    """Return the probability of as many outliers, in equations without derivatives, consecutive at ports."""
    from scipy.special import ndtr, pdtrc

    p_value = 1.0
    if not evidence.exact:
        z = evidence.raw(z)
        p_value = min((_in_a_row(evidence, z, part) for part in evidence.parts), default=1.0)
    for part in evidence.sharp:
        if (far := int(np.sum(np.abs(z[part]) > FAR))) >= FEW:
            expected = 2.0 * len(z[part]) * float(ndtr(-FAR / (1.0 + 10.0 * NOISE_KNOWN)))
            p_value = min(p_value, float(pdtrc(far - 1, expected)))
    return p_value


def lasting(evidence: ResidualSource, z: np.ndarray, part: slice, size: float = 1.0) -> list[np.ndarray]:
    """Return the windows of each event: `FEW` or more of a run in a row, far beyond their noise of a size."""
    return [part.start + k for k in _far_stretches(evidence, z, part, size) if len(k) >= FEW]


def _far_stretches(evidence: ResidualSource, z: np.ndarray, part: slice, size: float = 1.0) -> list[np.ndarray]:
    """Return the windows of each stretch far beyond the noise, counted within the part."""
    lane = lanes(evidence)[part]
    order = np.lexsort((evidence.time[part], lane))
    lane, far = lane[order], np.abs(z[part][order]) > FAR * size
    ends = np.flatnonzero((np.diff(lane) != 0) | (np.diff(far) != 0)) + 1
    return [order[k] for k in np.split(np.arange(len(far)), ends) if len(k) and far[k[0]]]


def _in_a_row(evidence: ResidualSource, z: np.ndarray, part: slice) -> float:
    """Return the probability of as many windows far beyond their noise in rows that no one bad reading makes."""
    from scipy.special import pdtrc

    lengths = [len(k) for k in _far_stretches(evidence, z, part)]
    rows = sum(max(n - evidence.overlap, 0) for n in lengths)
    windows, row = part.stop - part.start, evidence.overlap + 1
    return float(pdtrc(rows - 1, windows * (sum(lengths) / windows) ** row)) if rows > FEW - row else 1.0
