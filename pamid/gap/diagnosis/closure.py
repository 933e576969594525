"""How far a gap shrinks: held-out runs, the share of what is explainable, and intervals over runs."""

from collections.abc import Mapping
from itertools import combinations
from math import factorial

import numpy as np

from ..inference.gauss_newton import Fit, Fitter, joined, slots_of
from ..inference.student_t import bounded
from ..residuals.protocol import ResidualSource
from ..residuals.repeats import PIECES
from ..settings import EXCESS, FORM_LOCAL, NOISE_KNOWN, NU, TOLERANCE
from .findings import Closure, Interval, ParameterEstimate

DRAWS = 400
NEW_RUNS = 2
"""Runs on which a correction is typically tried."""
LEAST_LEFT, WIDEST = 1e-7, 2.0
"""Least share of a gap that counts as left, and the largest half width of its interval, in its logarithm."""


class Clusters:
    """A fit with the runs as units: refits without each run, to first order, and intervals of its parameters."""

    def __init__(self, fitter: Fitter, fit: Fit) -> None:
        evidence = fitter.evidence
        self.evidence, self.fit = evidence, fit
        self.slots = slots_of(evidence.effects, fit.spec)
        phi = np.array([fit.spec[name][p.name] for name, p in self.slots])
        z, J = evidence.tangent(fit.spec, fit.x), evidence.slopes(fit.spec, fit.x)
        D, back, on = fitter.jacobian(self.slots, phi, z, fit.x)
        self.A = np.column_stack([J, D])
        # Within one step's reach a refit without a run is to be found from here.
        self.reach = np.concatenate([fit.low - fit.x, back]), np.concatenate([fit.high - fit.x, on])
        # A parameter at the end of its tolerance, or at a bound, stays there, whichever run is left out.
        within = np.array([p.lower < v < p.upper for v, (_, p) in zip(phi, self.slots, strict=True)], dtype=bool)
        self.moving = np.concatenate([fit.inside, within])
        self.z = z + J @ fit.x
        self.scales, self.shares = np.empty((2, len(z)))
        for part, s, share in zip(evidence.parts, fit.scales, fitter.weights, strict=True):
            self.scales[part], self.shares[part] = s, share * (NU + 1.0)
        w = self.shares / (NU + np.square(self.z / self.scales)) / self.scales**2
        self.pieces, n = evidence.pieces()
        k = self.A.shape[1]
        self.H, self.g = np.zeros((n, k, k)), np.zeros((n, k))
        for t in range(n):
            rows = self.pieces == t
            Aw = self.A[rows] * w[rows, None]
            self.H[t], self.g[t] = self.A[rows].T @ Aw, -(self.z[rows] @ Aw)
        # A tolerance is a prior of its width: without it, what no run excites would drift.
        self.prior = np.diag(np.concatenate([np.full(evidence.J.shape[1], TOLERANCE), np.zeros(len(self.slots))]))
        # Where residuals bend, the fit has weighed it against them; elsewhere tolerances are as likely throughout.
        self.pull = -self.prior @ np.concatenate([fit.x + evidence.about, 0.0 * phi]) * evidence.bends
        self.size = np.sqrt(np.maximum(np.diag(self.H.sum(axis=0) + self.prior), 1e-300))

    def _solve(self, H: np.ndarray, g: np.ndarray, moving: np.ndarray) -> np.ndarray:
        """Return the step of those parameters that may move."""
        size, step = self.size[moving], np.zeros(len(moving))
        C = H[np.ix_(moving, moving)] / np.outer(size, size)
        step[moving] = np.linalg.lstsq(C + 1e-10 * np.eye(len(C)), g[moving] / size, rcond=None)[0] / size
        return step

    @property
    def knows_scatter(self) -> bool:
        """Whether there are enough runs, or pieces of them, for intervals of parameters."""
        return len(self.H) > 2

    def held_out(self) -> np.ndarray:
        """Return each run's residuals under the fit of all others, in units of the noise; exact where that is far."""
        n = len(self.H)
        if n < 2 or not self.A.shape[1]:
            return self.z
        out, far = self.z.copy(), dict[int, float]()
        steps = [self._without(t) for t in range(n)]
        for t, step in enumerate(steps):
            rows = self.pieces == t
            change = self.A[rows] @ step
            out[rows] += change
            before, moved = (float(np.sum(np.square(v))) for v in (self.z[rows], change))
            if moved > EXCESS * before:
                far[t] = moved
        for t in sorted(far, key=far.__getitem__, reverse=True)[:PIECES]:
            rows = self.pieces == t
            out[rows] = self._exact(t, steps[t])[rows]
        return out

    def _without(self, t: int) -> np.ndarray:
        """Return the step to the fit of all runs but one, to first order and within bounds."""
        low, high = (np.where(self.moving, end, 0.0) for end in self.reach)
        H, g = self.H.sum(axis=0) - self.H[t] + self.prior, self.g.sum(axis=0) - self.g[t] + self.pull
        return bounded(H, g, np.minimum(low, 0.0), np.maximum(high, 0.0))

    def _exact(self, t: int, step: np.ndarray) -> np.ndarray:
        """Return exact residuals as far along a step as suits all runs but one; where it suits none, the fit's."""
        others, best = self.pieces != t, self.z
        whole = least = self._cost(best, others, 0.0 * step)
        for much in (1.0, 0.35, 0.1):
            z = self._at(much * step)
            cost = self._cost(z, others, much * step)
            if cost < least:
                best, least = z, cost
            elif least < whole:
                break
        return best

    def _at(self, step: np.ndarray) -> np.ndarray:
        """Return the residuals beside the fit."""
        m, spec = self.evidence.J.shape[1], joined(self.fit.spec)
        for (name, p), by in zip(self.slots, step[m:], strict=True):
            spec[name][p.name] = float(np.clip(spec[name][p.name] + by, p.lower, p.upper))
        x = dict(zip(self.evidence.free, map(float, self.fit.x + step[:m]), strict=True))
        return self.evidence.z(spec, x, None)

    def _cost(self, z: np.ndarray, rows: np.ndarray, step: np.ndarray) -> float:
        """Return the negative log-likelihood of some windows, with the tolerances' prior."""
        far = np.log1p(np.square(z[rows] / self.scales[rows]) / NU)
        return float(0.5 * self.shares[rows] @ far - self.pull @ step + 0.5 * step @ self.prior @ step)

    def parameters(self) -> dict[str, dict[str, ParameterEstimate]]:
        r"""Return the effects' parameters with 90 % intervals: the jackknife over runs plus the tolerances' covariance.

        With H the information and :math:`\Lambda` the prior's, that covariance is :math:`H^{-1}\Lambda H^{-1}`.
        """
        from scipy.special import ndtri, stdtrit

        n, m = len(self.H), self.evidence.J.shape[1]
        total_H, total_g = self.H.sum(axis=0) + self.prior, self.g.sum(axis=0) + self.pull
        if self.knows_scatter:
            # This includes how far one at a bound could be from it.
            moving = np.concatenate([self.moving[:m], np.ones(len(self.slots), dtype=bool)])
            pairs = zip(self.H, self.g, strict=True)
            without = np.array([self._solve(total_H - H, total_g - g, moving) for H, g in pairs])
            error = np.sqrt((n - 1.0) / n * np.sum(np.square(without - without.mean(axis=0)), axis=0))
        else:
            error = np.full(self.A.shape[1], np.inf)
        reach = float(stdtrit(max(n - 1, 1), 0.95))
        whole = np.ones(len(self.moving), dtype=bool)
        shifts = np.array([self._solve(total_H, row, whole) for row in np.sqrt(self.prior[:m])]).reshape(m, len(whole))
        open_ = float(ndtri(0.95)) * np.sqrt(np.sum(np.square(shifts), axis=0))
        found: dict[str, dict[str, ParameterEstimate]] = {}
        for k, (name, p) in enumerate(self.slots):
            value = self.fit.spec[name][p.name]
            wide = float(np.hypot(reach * np.hypot(error[m + k], FORM_LOCAL * p.size(value)), open_[m + k]))
            known = np.isfinite(wide) and np.any(self.A[:, m + k])
            ci: Interval = p.interval(value, wide) if known else (-np.inf, np.inf)
            at_bound = not p.lower < value < p.upper and value != p.nominal
            found.setdefault(name, {})[p.name] = ParameterEstimate(value, p.unit, ci, at_bound)
        return found


def closures(
    evidence: ResidualSource,
    before: np.ndarray,
    after: np.ndarray,
    fitted: np.ndarray,
    random_state: np.random.RandomState,
) -> list[Closure]:
    """Return how far each equation's gap shrinks on held-out runs."""
    pieces, n = evidence.pieces()
    # The interval is for a few new runs, on which a correction is tried, not for the mean of all runs. Pieces of a run
    # differ, and what acts in some of them acts in the run: a new run has as many of them.
    pieced = n > len(evidence.trajectories)
    drawn = n if pieced else NEW_RUNS
    few = np.zeros((DRAWS, n), dtype=int)
    few[:] = random_state.randint(0, n, size=(DRAWS, drawn))[:, np.arange(n) % drawn]
    draws = np.vstack([np.arange(n), few])
    found = []
    for name, part in zip(evidence.equations, evidence.parts, strict=True):
        noise2 = np.square(evidence.noise[part])
        block = pieces[part]
        sums = np.array(
            [
                np.bincount(block, v, minlength=n)
                for v in (
                    np.square(before[part]) * noise2,
                    np.square(after[part]) * noise2,
                    np.square(fitted[part]) * noise2,
                    noise2,
                    np.ones(len(block)),
                )
            ]
        )
        b, a, least, floor, count = sums[:, draws].sum(axis=2)
        count = np.maximum(count, 1.0)
        # The floor is itself known to a few per cent, which limits the share of a faint gap.
        floor = floor * np.exp(2.0 * NOISE_KNOWN * np.concatenate([[0.0], random_state.standard_normal(DRAWS)]))
        share = _closed(b / count, a / count, floor / count)
        most = _closed(b / count, np.minimum(least, a) / count, floor / count)
        ci = (float(np.quantile(share[1:], 0.05)), float(np.quantile(most[1:], 0.95))) if n > 1 else (0.0, 1.0)
        rms_before, rms_after, rms_noise = (float(np.sqrt(v[0] / count[0])) for v in (b, a, floor))
        point = float(share[0] if pieced else np.median(share))
        wide = _rescaled((min(ci[0], point), max(ci[1], point)), point, n)
        found.append(Closure(name, rms_before, rms_after, rms_noise, point, wide, evidence.units[name]))
    return found


def _rescaled(ci: Interval, point: float, n: int) -> Interval:
    """Rescale the log interval of a share closed by the bootstrap's small-sample correction n / (n − 1).

    J. N. K. Rao, C. F. J. Wu, JASA 83(401), 1988. https://doi.org/10.1080/01621459.1988.10478591
    """
    if n < 2:
        return ci
    left = np.maximum(1.0 - np.array([ci[0], point, ci[1]]), LEAST_LEFT)
    apart = np.clip(np.log(left / left[1]), -WIDEST, WIDEST)
    low, _, high = left * np.exp((np.sqrt(n / (n - 1.0)) - 1.0) * apart)
    return (max(0.0, 1.0 - float(low)) if ci[0] > 0.0 else 0.0), (1.0 - float(high) if ci[1] < 1.0 else 1.0)


def _closed(before: np.ndarray, after: np.ndarray, floor: np.ndarray) -> np.ndarray:
    """Return the closed share of the explainable gap; 0 where nothing is explainable."""
    # Noise is known to a few per cent: a smaller excess over the floor is not a gap to close.
    room = before - floor
    some = room > 0.02 * floor
    return np.clip(np.divide(before - after, room, out=np.zeros_like(room), where=some), 0.0, 1.0)


def shapley(fitter: Fitter, base: Fit, fit: Fit) -> dict[str, float]:
    """Return each cause's Shapley share of the gain in likelihood of all causes."""
    names = list(fit.spec)
    value: dict[frozenset[str], float] = {frozenset(): base.loglik, frozenset(names): fit.loglik}
    for size in range(1, len(names)):
        for some in combinations(names, size):
            value[frozenset(some)] = fitter.at({k: fit.spec[k] for k in some}).loglik
    total = max(fit.loglik - base.loglik, 1e-9)
    share = {}
    for name in names:
        rest = [k for k in names if k != name]
        share[name] = 0.0
        for size in range(len(rest) + 1):
            weight = factorial(size) * factorial(len(rest) - size) / factorial(len(names))
            for some in combinations(rest, size):
                share[name] += weight * (value[frozenset((*some, name))] - value[frozenset(some)])
    return {name: float(np.clip(v / total, 0.0, 1.0)) for name, v in share.items()}


def main_equation(
    evidence: ResidualSource, effect: str, contribution: np.ndarray, closure: Mapping[str, Closure]
) -> str:
    """Return the equation in which an effect closes most, at most as much as all causes there."""
    closed, strength = {}, {}
    for name, part in zip(evidence.equations, evidence.parts, strict=True):
        c = closure[name]
        closed[name] = (c.rmse_before**2 - c.rmse_after**2) / c.noise_floor**2 if c.noise_floor > 0.0 else np.inf
        strength[name] = min(float(np.mean(np.square(contribution[part]))), closed[name])
    allowed = evidence.touched([effect]) or evidence.equations
    if not any(closure[e].closed_share > 0.0 for e in allowed):
        return max(evidence.equations, key=lambda e: closed[e])
    return max(allowed, key=lambda e: strength[e])
