"""Maximum likelihood for nonlinear residuals: Levenberg–Marquardt steps under Student's t, within bounds.

Each step is solved about the last iterate, and taken only if the actual residuals there are likelier. Parameters with
wide tolerances need this: their sensitivities differ from one end of the tolerance to the other, and with and without
an effect.

References
----------
D. W. Marquardt, "An algorithm for least-squares estimation of nonlinear parameters", SIAM Journal on Applied
Mathematics 11(2), 1963. https://doi.org/10.1137/0111030
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple, Self

import numpy as np

from ...fitting.marquardt import Damping
from .student_t import RobustFit, bounded, loglik, window_weights

DAMPED = 1e-8
"""Damping of the first step; the result of a fit does not depend on it (``benchmarks/settings.py --computed``).

A whole step comes first: windows are weighted as they count where it ends, so that a part of it may gain nothing.
"""
REWEIGHTED = 4
"""How often windows are weighted anew before a step: affects run time only."""
BROYDEN = 3.0
"""Reuse the Jacobian after steps that gain more than this times the tolerance: affects run time only."""


class Prior(NamedTuple):
    """Gaussian prior of numbers; flat at zero precision."""

    centre: np.ndarray
    precision: np.ndarray
    """Mean, and one over the variance. Shape (n,)."""

    def cost(self, x: np.ndarray) -> float:
        """Return the penalty of numbers in log-likelihood."""
        return 0.5 * float(self.precision @ np.square(x - self.centre))


class Bounds(NamedTuple):
    """Where numbers may be, and how far one step may take them."""

    lower: np.ndarray
    upper: np.ndarray
    """Least and largest values, shape (n,)."""
    back: np.ndarray
    on: np.ndarray
    """Largest steps down and up, as positive numbers. Shape (n,)."""

    @classmethod
    def of(cls, lower: np.ndarray, upper: np.ndarray) -> Self:
        """Return bounds that one step may cross the whole way between."""
        return cls(lower, upper, upper - lower, upper - lower)


def descend(
    at: Callable[[np.ndarray], np.ndarray],
    slopes: Callable[[np.ndarray], np.ndarray],
    x: np.ndarray,
    bounds: Callable[[np.ndarray], Bounds],
    parts: Sequence[slice],
    weights: np.ndarray,
    rounds: int,
    prior: Prior,
    enough: float = 0.3,
    behind: float = -np.inf,
) -> RobustFit:
    """Maximise the likelihood of residuals over numbers in which they are nonlinear."""

    def there(x: np.ndarray) -> RobustFit:
        z = at(x)
        value, scales = loglik(z, parts, weights)
        return RobustFit(value - prior.cost(x), x, z, scales)

    best = there(x)
    damping = Damping(DAMPED, shrink=0.1, grow=100.0, least=1e-12, most=1e2)
    A, anew = np.zeros(0), True
    for left in reversed(range(rounds)):
        A = slopes(best.x) if anew else A
        here, room, ahead = best, bounds(best.x), best.z
        lower, upper = np.maximum(room.lower - here.x, -room.back), np.minimum(room.upper - here.x, room.on)
        for _ in range(REWEIGHTED):  # windows count as they will where the step ends
            w = window_weights(here._replace(z=ahead, scales=loglik(ahead, parts, weights)[1]), parts, weights)
            H, g = A.T @ (A * w[:, None]) + np.diag(prior.precision), -(A.T @ (w * here.z))
            g -= prior.precision * (here.x - prior.centre)
            full = bounded(H, g, lower, upper)
            ahead = here.z + A @ full
        diagonal = np.maximum(np.diag(H), 1e-300)  # of any unit
        promised = loglik(ahead, parts, weights)[0] - prior.cost(here.x + full)
        # A step that is cut short promises less than the way that goes on from there.
        short = bool(np.any(((full <= -room.back) & (lower == -room.back)) | ((full >= room.on) & (upper == room.on))))
        # Where residuals are curved, the next step may gain as much again.
        far = promised + (promised - here.loglik) <= behind
        if promised <= here.loglik + enough or (far and not short):
            if anew:
                break
            anew = True
            continue

        def propose(much: float) -> RobustFit:
            step = bounded(H + np.diag(much * diagonal), g, lower, upper)  # noqa: B023 - used within this round
            return there(np.clip(here.x + step, room.lower, room.upper))  # noqa: B023

        # Where updated slopes fail, new ones tell more than a shorter step.
        before, tries = damping.value, None if anew else 1
        found = damping.descend(-here.loglik, propose, lambda trial: -trial.loglik, tries)
        if found is None:
            if anew:
                break
            anew = True
            continue
        best = found[0]
        gain = best.loglik - here.loglik
        if best.loglik + left * gain <= behind:  # as much again in each step left is not enough
            break
        if gain < enough and damping.value >= before:  # else it was only damped too much: more was promised
            break
        # A step that gained much updates the slopes itself (Broyden); the next but one is relinearised.
        anew = not anew or gain < BROYDEN * enough
        if not anew:
            A = _turned(A, best.x - here.x, best.z - here.z, diagonal)
    return best._replace(loglik=best.loglik + prior.cost(best.x))


def _turned(A: np.ndarray, moved: np.ndarray, changed: np.ndarray, size: np.ndarray) -> np.ndarray:
    """Return slopes that agree with the last step by the least change (Broyden)."""
    along = size * moved
    power = float(along @ moved)
    return A + np.outer(changed - A @ moved, along) / power if power > 0.0 else A
