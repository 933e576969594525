"""An explanation with its posterior from the earlier logs, and draws from it."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple, Protocol

import numpy as np

from ...effects import Parameter
from ..diagnosis.rivals import Rival
from ..inference.discrepancy import Discrepancy
from ..inference.gauss_newton import Fit, Fitter, slots_of
from ..inference.occam import occam_of, possible
from ..inference.student_t import loglik
from ..residuals.protocol import ResidualSource
from ..settings import FORM_SMOOTH, TOLERANCE

HALVINGS = 6
"""How often a draw is moved halfway back to the fit where the logs contradict it."""
LOST = 2.0
"""Log-likelihood that a draw may lose beyond its posterior's prediction, in nats."""


class Recorded(ResidualSource, Protocol):
    """A log as evidence, whose clocks and offsets are unknown."""

    @property
    def nuisances(self) -> np.ndarray:
        """Change of the residuals by one tolerance of each, shape (n_windows, n)."""
        ...


class Draw(NamedTuple):
    """A draw from an explanation's posterior, beside its best fit."""

    fit: Fit
    """Its effects and deviations of the tolerances."""
    lost: float
    """Its loss in the earlier logs, in nats."""


@dataclass(frozen=True)
class Known:
    """An explanation with the posterior of its parameters from the earlier logs."""

    fit: Fit
    """Its effects and deviations of the tolerances."""
    precision: np.ndarray
    """Posterior precision of the tolerances and its effects' parameters, shape (n_free + n_parameters, n_free +
    n_parameters)."""
    belief: float
    """Probability."""
    windows: int = 0
    """Windows of the earlier logs."""
    draws: Sequence[Draw] = ()
    """What could be true instead: draws of its parameters and deviations that the earlier logs allow."""
    slots: Sequence[tuple[str, Parameter]] = ()
    """The parameters of its effects, in order."""

    @property
    def names(self) -> tuple[str, ...]:
        """Its effects."""
        return tuple(self.fit.spec)

    def step_to(self, other: Fit) -> np.ndarray:
        """Return how far tolerances and parameters of another fit of the same effects are from its own."""
        own, there = ([fit.spec[name][p.name] for name, p in self.slots] for fit in (self.fit, other))
        return np.concatenate([other.x - self.fit.x, np.array(there) - np.array(own)])

    def curvature(self, H: np.ndarray) -> np.ndarray:
        """Return the precision of the effects' parameters where that of all coefficients is H."""
        m = len(self.fit.x)
        keep = np.arange(m, len(self.precision))
        rest = np.setdiff1d(np.arange(len(H)), keep)
        C, size = scaled(H)
        schur = C[np.ix_(keep, keep)] - C[np.ix_(keep, rest)] @ np.linalg.solve(
            C[np.ix_(rest, rest)], C[np.ix_(rest, keep)]
        )
        return np.asarray(schur * np.outer(size[keep], size[keep]))

    def each(self, H: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray, list[Parameter], list[float], float]]:
        """Yield for each effect the places, precision, parameters, values and gain where that of all coefficients is H.

        The gain is that of its amplitudes, in which it is linear.
        """
        known = self.curvature(H)
        for name, values in self.fit.spec.items():
            at = [q for q, (effect, _) in enumerate(self.slots) if effect == name]
            parameters, mine = [self.slots[q][1] for q in at], known[np.ix_(at, at)]
            a = np.array([values[p.name] if p.linear else 0.0 for p in parameters])
            yield np.array(at), mine, parameters, [values[p.name] for p in parameters], 0.5 * float(a @ mine @ a)

    def price(self, H: np.ndarray, windows: float) -> float:
        """Return the price of the parameters in evidence where the precision of all coefficients is H."""
        each = self.each(H) if self.fit.spec else ()
        return sum((occam_of(mine, windows, of, values, gain) for _, mine, of, values, gain in each), 0.0)

    @property
    def reach(self) -> np.ndarray:
        """Prior widths of tolerances and parameters about their values."""
        out = np.full(len(self.precision), np.inf)
        for at, mine, of, values, gain in self.each(self.precision) if self.fit.spec else ():
            out[len(self.fit.x) + at] = possible(mine, of, values, gain)
        return np.maximum(out, 1e-12)

    @property
    def held(self) -> np.ndarray:
        """The precision with which the explanation is refitted: nonlinear parameters no further than they reach."""
        linear = np.array([p.linear for _, p in self.slots], dtype=bool)
        free = np.concatenate([np.ones(len(self.fit.x), dtype=bool), linear])
        return np.asarray(self.precision + np.diag(np.where(free, 0.0, self.reach**-2.0)))


def fit_of(rival: Rival, log: ResidualSource) -> Fit:
    """Return an explanation as a fit to a log."""
    x = np.array([float(rival.deviations.get(name, 0.0)) for name in log.free])
    return Fit({k: dict(v) for k, v in rival.effects.items()}, x, 0.0, np.zeros(0), np.ones(0))


def known_of(logs: Sequence[Recorded], fit: Fit, belief: float, rng: np.random.Generator, draws: int = 0) -> Known:
    """Return an explanation with the posterior of its parameters from logs."""
    known = Known(
        fit, precision(logs, fit), belief, sum(len(log.z0) for log in logs), (), slots_of(logs[0].effects, fit.spec)
    )
    linear = np.array([True] * len(fit.x) + [p.linear for _, p in known.slots], dtype=bool)
    now, found = _loglik(logs, fit), []
    for k in range(draws):
        # Where all parameters move, bounds of nonlinear ones end a step early: every other pair of draws leaves them.
        free = linear if k % 4 < 2 else np.ones(len(linear), dtype=bool)
        if k % 2 == 0:
            C, size = scaled(known.held[np.ix_(free, free)], 1e-6)
            root = np.linalg.cholesky(C)
            step = np.zeros(len(linear))
            step[free] = np.linalg.solve(root.T, rng.standard_normal(len(size))) / size
        else:
            step = -step
        found.append(_allowed(logs, fit, step, now, 0.5 * float(step @ known.held @ step)))
    return replace(known, draws=tuple(found))


def _allowed(logs: Sequence[Recorded], fit: Fit, step: np.ndarray, now: float, price: float) -> Draw:
    """Return a fit moved along a step as far as bounds and the logs' likelihood allow."""
    slots, m = slots_of(logs[0].effects, fit.spec), len(fit.x)
    value = np.array([fit.spec[name][p.name] for name, p in slots])
    end = np.array([p.upper if d > 0.0 else p.lower for d, (_, p) in zip(step[m:], slots, strict=True)])
    moves = step[m:] != 0.0
    share = float(np.clip(np.min(((end - value) / np.where(moves, step[m:], 1.0))[moves], initial=1.0), 0.0, 1.0))
    for _ in range(HALVINGS):
        spec: dict[str, dict[str, float]] = {name: dict(values) for name, values in fit.spec.items()}
        for (name, p), v in zip(slots, value + share * step[m:], strict=True):
            spec[name][p.name] = float(np.clip(v, p.lower, p.upper))
        moved = replace(fit, spec=spec, x=fit.x + share * step[:m])
        lost = max(now - _loglik(logs, moved), 0.0) + _unlikely(moved) - _unlikely(fit)
        if lost <= share**2 * price + LOST:
            return Draw(moved, max(lost, 0.0))
        share *= 0.5
    return Draw(fit, 0.0)


def _unlikely(fit: Fit) -> float:
    return 0.5 * TOLERANCE * float(fit.x @ fit.x)


def _loglik(logs: Sequence[Recorded], fit: Fit) -> float:
    return sum(loglik(residuals(log, fit), log.parts, log.weights)[0] for log in logs)


def residuals(evidence: Recorded, fit: Fit) -> np.ndarray:
    """Return the residuals of an explanation on a log."""
    return evidence.tangent(fit.spec, fit.x) + evidence.slopes(fit.spec, fit.x) @ fit.x


def cleaned(evidence: Recorded, apart: bool = False) -> Callable[[np.ndarray], np.ndarray]:
    r"""Return a function that integrates out unknown clocks and offsets N: it whitens by :math:`I + N N^\top/\tau`."""
    N, parts = evidence.nuisances / np.sqrt(TOLERANCE), []
    for run in np.unique(evidence.block) if apart else [None]:
        rows = np.arange(len(N)) if run is None else np.flatnonzero(evidence.block == run)
        U, size, _ = np.linalg.svd(N[rows], full_matrices=False)
        parts.append((rows, U, 1.0 - 1.0 / np.sqrt(1.0 + np.square(size))))

    def clean(x: np.ndarray) -> np.ndarray:
        out = np.array(x, dtype=float)
        for rows, U, share in parts:
            out[rows] -= (U * share) @ (U.T @ out[rows])
        return out

    return clean if N.shape[1] else lambda x: x


def sensitivities(evidence: Recorded, fit: Fit) -> tuple[np.ndarray, np.ndarray]:
    """Return the residuals of an explanation on a log, and their sensitivities to tolerances and its parameters."""
    slots = slots_of(evidence.effects, fit.spec)
    z, J = evidence.tangent(fit.spec, fit.x), evidence.slopes(fit.spec, fit.x)
    if not slots:
        return z + J @ fit.x, J
    phi = np.array([fit.spec[name][p.name] for name, p in slots])
    D, _, _ = Fitter(evidence).jacobian(slots, phi, z, fit.x)
    return z + J @ fit.x, np.column_stack([J, D])


def precision(logs: Sequence[Recorded], fit: Fit) -> np.ndarray:
    """Return the posterior precision of an explanation's parameters after logs, its inexact form left free."""
    m = logs[0].J.shape[1]
    total = np.diag(np.concatenate([np.full(m, TOLERANCE), np.zeros(len(slots_of(logs[0].effects, fit.spec)))]))
    for log in logs:
        clean = cleaned(log)
        z, A = map(clean, sensitivities(log, fit))
        S, width = form_of(log, fit)
        total = total + informed(A, clean(S), 1.0 / np.square(width * _scales(log, z / width)))
    return total


def informed(A: np.ndarray, S: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Return the precision that weighted windows give to the coefficients of columns, those of a form left free."""
    Aw = A * weight[:, None]
    H = A.T @ Aw
    if S.shape[1]:
        cross = S.T @ Aw
        H -= cross.T @ np.linalg.solve(S.T @ (S * weight[:, None]) + np.eye(S.shape[1]) / FORM_SMOOTH**2, cross)
    return np.asarray(H)


def scaled(H: np.ndarray, ridge: float = 1e-9) -> tuple[np.ndarray, np.ndarray]:
    """Return a precision with a diagonal of one and a ridge on it, and the square roots of its own diagonal."""
    size = np.sqrt(np.maximum(np.diag(H), 1e-300))
    return H / np.outer(size, size) + ridge * np.eye(len(H)), size


def _scales(log: Recorded, z: np.ndarray) -> np.ndarray:
    """Return the scale of each window's equation, at least 1."""
    out = np.ones(len(z))
    for part in log.parts:
        out[part] = max(1.0, float(np.sqrt(np.mean(np.square(z[part]))))) if part.stop > part.start else 1.0
    return out


def form_of(log: Recorded, fit: Fit) -> tuple[np.ndarray, np.ndarray]:
    """Return the columns of an explanation's inexact form, and the standard deviation of each window with it."""
    if not fit.spec:
        return np.zeros((len(log.z0), 0)), np.ones(len(log.z0))
    discrepancy = Discrepancy(log)
    width = discrepancy.width(fit)
    return discrepancy.columns(fit), np.ones(len(log.z0)) if width is None else width
