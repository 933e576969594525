r"""A law with named parameters and memories of the pressure, and a Gaussian process for the remainder.

.. math:: F = [m_\theta(\varepsilon, p^*) + r(\varepsilon, p^*)]_+, \qquad
    p^* = p + \sum_k w_k (p_k - p), \qquad
    r \sim \mathcal{N}\big(0,\; a^2 e^{-\frac12 (\Delta\varepsilon/\ell_\varepsilon)^2
    - \frac12 (\Delta p^*/\ell_p)^2} + b^2\,[\text{same run}] + \sigma^2 (1 + |\dot p|)^2\big)

with memories :math:`p_k` of the gauge pressure p. The named parameters θ and w have normal priors; those of a target
are centred where the source has them. They are found by Gauss–Newton steps in which the remainder is integrated out.
The greatest evidence gives its amplitudes and, where the bore is another, a factor on the widths of θ's prior. Forces
are in units of the bore's area times `BAR`, pressures in units of `BAR`, so that muscles of all sizes share priors.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from scipy.linalg import LinAlgError, cho_factor, cho_solve

from ..errors import FitError

BAR = 1e5
"""Unit of pressure, Pa."""
CONTRACTION = 0.05
"""Contraction over which the remainder changes."""
RUN = 0.05
"""Standard deviation of an error common to a run, as when a muscle warms up or is remounted."""
JUMP = 0.25
"""Distance between the pressure and its lag of 60 ms at which a sample's noise has doubled."""
SLACK = 0.1
"""Force over which a muscle falls slack; a remainder cannot make it push either."""
HYPER_ROWS = 300
"""Samples that the amplitudes are chosen on."""
STEPS = 8
"""Most Gauss–Newton steps."""
JITTER = 1e-9


@dataclass(frozen=True)
class Amplitudes:
    """What the priors of remainder, noise and memories are as wide as."""

    remainder: float = 1.0
    length: float = 1.0
    noise: float = 0.4
    recall: float = 1.0
    named: float = 1.0
    """Factor on the prior widths of the named parameters of a target of another bore."""


LIMITS = {"remainder": (0.25, 4.0), "length": (0.5, 4.0), "noise": (0.01, 100.0), "recall": (0.005, 2.0)}
LIMITS |= {"named": (0.25, 4.0)}
OCTAVES = {"remainder": 1.0, "length": 0.5, "noise": 2.0, "recall": 1.0, "named": 1.0}
"""Standard deviations of the amplitudes' binary logarithms about those that a search starts from."""


@dataclass(frozen=True)
class NamedRows:
    """Samples: contraction, gauge pressure, memories less the pressure, force, weight, run, and rate of the noise."""

    eps: np.ndarray
    p: np.ndarray
    past: np.ndarray
    force: np.ndarray
    weight: np.ndarray
    run: np.ndarray
    jump: np.ndarray

    def at(self, index: Any) -> NamedRows:
        """Return some of the samples."""
        return NamedRows(*(getattr(self, name)[index] for name in self.__dataclass_fields__))


@dataclass(frozen=True)
class BraidLaw:
    """Gas on a braid less an elastic bladder, slack where both balance: the law of a muscle that has no source."""

    names = ("gas", "gas_slope", "gas_curvature", "preload", "bladder", "bladder_curvature")

    @property
    def centre(self) -> np.ndarray:
        """A braid of 25° without a bladder."""
        inner, outer = 1.0 / np.tan(np.radians(25.0)) ** 2, 1.0 / np.sin(np.radians(25.0)) ** 2
        return np.array([3.0 * inner - outer, -6.0 * inner, 3.0 * inner, 0.0, 0.0, 0.0])

    guessed = False
    """Whether the prior's widths are guessed."""

    @property
    def spread(self) -> np.ndarray:
        """Standard deviations of the prior."""
        return np.array([5.0, 20.0, 20.0, 10.0, 20.0, 20.0])

    def at(self, theta: np.ndarray, eps: np.ndarray, p: np.ndarray) -> tuple[np.ndarray, ...]:
        """Return the force, its Jacobian, and its slopes in contraction and pressure."""
        one = np.ones_like(p)
        B = np.column_stack([p, p * eps, p * eps**2, one, eps, eps**2])
        u = B @ theta / SLACK
        pull = np.exp(-np.logaddexp(0.0, -u))
        slope_p = theta[0] + theta[1] * eps + theta[2] * eps**2
        slope_eps = (theta[1] + 2.0 * theta[2] * eps) * p + theta[4] + 2.0 * theta[5] * eps
        return SLACK * np.logaddexp(0.0, u), B * pull[:, None], slope_eps * pull, slope_p * pull


@dataclass(frozen=True)
class CarriedLaw:
    """The map of a source with a gain, another scale of contraction, a threshold that shifts with it, and a preload."""

    source: NamedProcess
    """Process of the source."""
    ratio: float = 1.0
    """Diameter of the target over that of the source: the further from 1, the wider the priors."""
    stretch: float = 1.0
    """What the target's contraction is multiplied by to be the source's: the ratio of the greatest ones."""

    names = ("gain", "contraction", "threshold", "threshold_slope", "threshold_curvature", "preload")

    @property
    def centre(self) -> np.ndarray:
        """The source scaled by geometry alone."""
        return np.array([0.0, self.stretch - 1.0, 0.0, 0.0, 0.0, 0.0])

    @property
    def guessed(self) -> bool:
        """Whether the prior's widths are guessed, as those of another bore are."""
        return bool(abs(np.log(self.ratio)) > 1e-3)

    @property
    def spread(self) -> np.ndarray:
        """Standard deviations of the prior: threshold, its slope and curvature per 10 % of contraction."""
        wider = np.array([3.0, 2.0, 1.0, 2.0, 2.0, 2.0]) * abs(np.log(self.ratio))
        return np.array([0.15, 0.1, 0.3, 0.2, 0.2, 0.2]) * (1.0 + wider)

    def at(self, theta: np.ndarray, eps: np.ndarray, p: np.ndarray) -> tuple[np.ndarray, ...]:
        """Return the force, its Jacobian, and its slopes in contraction and pressure."""
        gain, stretch, x = np.exp(np.clip(theta[0], -5.0, 5.0)), 1.0 + theta[1], eps / 0.1
        f, f_eps, f_p = self.source.jet(stretch * eps, p - theta[2] - theta[3] * x - theta[4] * x**2)
        J = gain * np.column_stack([f, f_eps * eps, -f_p, -f_p * x, -f_p * x**2, np.full_like(f, 1.0 / gain)])
        bent = (theta[3] + 2.0 * theta[4] * x) / 0.1
        return gain * f + theta[5], J, gain * (f_eps * stretch - f_p * bent), gain * f_p


class HeldOut(NamedTuple):
    """What samples leave when their run is held out, and what each of them counts: its weight over its variance."""

    left: np.ndarray
    trust: np.ndarray

    @property
    def error(self) -> float:
        """Root of the mean square, samples that nothing could tell counting for less."""
        return float(np.sqrt(np.average(self.left**2, weights=self.trust)))


@dataclass(frozen=True)
class NamedProcess:
    """A fitted process; `jet` is its map without memory, `predict` the force of samples with theirs."""

    law: BraidLaw | CarriedLaw
    theta: np.ndarray
    recall: np.ndarray
    amplitudes: Amplitudes
    covariance: np.ndarray
    eps: np.ndarray
    p: np.ndarray
    pull: np.ndarray

    def jet(self, eps: np.ndarray, p: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return force, which a slack muscle has none of, and its slopes in contraction and equivalent pressure."""
        f, _, f_eps, f_p = self.law.at(self.theta, eps, p)
        d_eps, d_p = eps[:, None] - self.eps, p[:, None] - self.p
        K = _kernel(self.amplitudes, d_eps, d_p) * self.pull
        r_eps, r_p = (-K * d_eps).sum(1) / CONTRACTION**2, (-K * d_p).sum(1) / self.amplitudes.length**2
        u = (f + K.sum(1)) / SLACK
        pull = np.exp(-np.logaddexp(0.0, -u))
        return SLACK * np.logaddexp(0.0, u), pull * (f_eps + r_eps), pull * (f_p + r_p)

    def predict(self, eps: np.ndarray, p: np.ndarray, past: np.ndarray) -> np.ndarray:
        """Return the force of samples."""
        out = np.empty(len(p))
        for begin in range(0, len(p), 4096):
            rows = slice(begin, begin + 4096)
            out[rows] = self.jet(eps[rows], p[rows] + past[rows] @ self.recall)[0]
        return out


def fit_process(
    law: BraidLaw | CarriedLaw, rows: NamedRows, start: Amplitudes, memory: np.ndarray
) -> tuple[NamedProcess, HeldOut]:
    """Fit named parameters and remainder about `start` and `memory`; return the process and its held-out residuals."""
    few = rows.at(np.unique(np.linspace(0, len(rows.p) - 1, min(HYPER_ROWS, len(rows.p))).round().astype(int)))
    names = [n for n in OCTAVES if n not in ("recall", "named")]
    names += ["recall"] * bool(rows.past.shape[1]) + ["named"] * law.guessed
    theta = np.concatenate([law.centre, memory])

    def cost(a: Amplitudes) -> tuple[float, np.ndarray]:
        moved = sum((np.log2(getattr(a, n) / np.clip(getattr(start, n), *LIMITS[n])) / OCTAVES[n]) ** 2 for n in names)
        try:
            found = _steps(law, few, a, memory, theta)
        except (LinAlgError, ValueError, FloatingPointError):
            return np.inf, theta
        return found.evidence + 0.5 * float(moved), found.theta

    best = replace(start, **{n: float(np.clip(getattr(start, n), *LIMITS[n])) for n in names})
    least, theta = cost(best)
    step = 2.0
    while step > 1.2:
        moved = False
        for name in names:
            for factor in (step, 1.0 / step):
                value = float(np.clip(getattr(best, name) * factor, *LIMITS[name]))
                if value == getattr(best, name):
                    continue
                tried = replace(best, **{name: value})
                lower, at = cost(tried)
                if lower < least - 1e-3:
                    best, least, theta, moved = tried, lower, at, True
                    break
        if not moved:
            step **= 0.5
    if not np.isfinite(least):
        raise FitError("The evidence of the samples is not finite.", "signals and forces in SI units", "Check them.")
    found = _steps(law, rows, best, memory, theta)
    n = len(law.names)
    p = rows.p + rows.past @ found.theta[n:]
    process = NamedProcess(
        law,
        found.theta[:n].copy(),
        found.theta[n:].copy(),
        best,
        found.covariance,
        rows.eps.copy(),
        p,
        found.solve(found.left),
    )
    return process, _held_out(found.inverse(), found.linear, rows, _noise(rows, best))


def _held_out(inverse: np.ndarray, y: np.ndarray, rows: NamedRows, noise: np.ndarray) -> HeldOut:
    left, variance = np.asarray(inverse @ y), np.empty(len(y))
    for run in np.unique(rows.run):
        out = np.flatnonzero(rows.run == run)
        own = np.linalg.inv(inverse[np.ix_(out, out)])
        left[out], variance[out] = own @ left[out], np.diag(own)
    # A weight of 2 is two samples, each with the noise of one.
    return HeldOut(left, rows.weight / (variance + noise**2 * (1.0 - 1.0 / rows.weight)))


@dataclass(frozen=True)
class _Steps:
    """Where Gauss–Newton steps ended."""

    theta: np.ndarray
    evidence: float
    covariance: np.ndarray
    left: np.ndarray
    linear: np.ndarray
    solve: Callable[[np.ndarray], np.ndarray]
    inverse: Callable[[], np.ndarray]


def _steps(law: BraidLaw | CarriedLaw, rows: NamedRows, a: Amplitudes, memory: np.ndarray, theta: np.ndarray) -> _Steps:
    centre = np.concatenate([law.centre, memory])
    precision = np.concatenate([a.named * law.spread, np.full(len(memory), a.recall)]) ** -2.0
    n = len(law.names)

    def linearised(theta: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        p = rows.p + rows.past @ theta[n:]
        m, J, _, m_p = law.at(theta[:n], rows.eps, p)
        return m, np.column_stack([J, m_p[:, None] * rows.past]), p

    m, J, p = linearised(theta)
    for _ in range(STEPS):
        factor = _factor(rows, a, p)
        KJ = cho_solve(factor, J)
        H = J.T @ KJ + np.diag(precision)
        gradient = KJ.T @ (rows.force - m) - precision * (theta - centre)
        step = np.linalg.solve(H, gradient)
        before = _misfit(factor, rows.force - m, theta - centre, precision)
        for shrink in (1.0, 0.5, 0.25, 0.1, 0.0):
            tried = theta + shrink * step
            m, J, p = linearised(tried)
            if shrink == 0.0 or _misfit(factor, rows.force - m, tried - centre, precision) <= before:
                break
        theta = tried
        if shrink == 0.0 or float(gradient @ step) < 1e-3:
            break
    factor = _factor(rows, a, p)
    KJ = cho_solve(factor, J)
    H = J.T @ KJ + np.diag(precision)
    linear = rows.force - m + J @ (theta - centre)
    z = cho_solve(factor, linear)
    z -= KJ @ np.linalg.solve(H, KJ.T @ linear)
    repeats = float(np.sum((rows.weight - 1.0) * np.log(_noise(rows, a))))
    evidence = 0.5 * float(linear @ z) + float(np.log(np.diag(factor[0])).sum()) + repeats
    evidence += 0.5 * float(np.linalg.slogdet(H)[1] - np.log(precision).sum())
    covariance = np.linalg.inv(H)

    def inverse() -> np.ndarray:
        return np.asarray(cho_solve(factor, np.eye(len(m))) - KJ @ covariance @ KJ.T)

    return _Steps(
        theta, evidence, covariance, rows.force - m, linear, lambda v: np.asarray(cho_solve(factor, v)), inverse
    )


def _kernel(a: Amplitudes, d_eps: np.ndarray, d_p: np.ndarray) -> np.ndarray:
    return np.asarray(a.remainder**2 * np.exp(-0.5 * (d_eps / CONTRACTION) ** 2 - 0.5 * (d_p / a.length) ** 2))


def _noise(rows: NamedRows, a: Amplitudes) -> np.ndarray:
    return a.noise * (1.0 + np.abs(rows.jump) / JUMP)


def _factor(rows: NamedRows, a: Amplitudes, p: np.ndarray) -> Any:
    K = _kernel(a, rows.eps[:, None] - rows.eps, p[:, None] - p)
    K += RUN**2 * (rows.run[:, None] == rows.run)
    K[np.diag_indices_from(K)] += _noise(rows, a) ** 2 / rows.weight + JITTER
    return cho_factor(K, lower=True)


def _misfit(factor: Any, left: np.ndarray, moved: np.ndarray, precision: np.ndarray) -> float:
    return float(left @ cho_solve(factor, left) + precision @ moved**2)
