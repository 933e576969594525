r"""Model discrepancy of effects: the residual of a right cause with a slightly wrong form is not another cause.

Where an effect acts it may be wrong by a small share of what it adds there, differently in each window, and by a larger
share that goes smoothly with the state:

.. math:: z = z_0 + \sum_k d_k (1 + \sum_j \beta_{kj} u_j) + \eta, \qquad
    \beta_{kj} \sim N(0, \varphi^2), \quad \operatorname{var} \eta = 1 + \sum_k (\delta_k d_k)^2 + c_k^2

with d the contribution of effect k, u signals of the state between −1 and 1, and c what it may add where the library's
form is zero. Both are part of the likelihood of every hypothesis that holds the effect.

References
----------
M. C. Kennedy, A. O'Hagan, "Bayesian calibration of computer models", Journal of the Royal Statistical Society B 63(3),
2001. https://doi.org/10.1111/1467-9868.00294
"""

from itertools import pairwise

import numpy as np

from ...remembered import Remembered
from ...signals.recursion import past
from ..residuals.protocol import ResidualSource, lanes
from ..settings import FORM_ELSEWHERE, FORM_EXACT, FORM_LOCAL
from .gauss_newton import Fit
from .sensitivity import has_form
from .student_t import bounded

AGES = (0.05, 0.3, 1.5)
"""Ages of the past that forms may differ by, s: from a few windows to the length of a run."""
_CONFINED = {"friction", "hysteresis", "load"}


class Discrepancy:
    """The model discrepancy of the fits of one log."""

    def __init__(self, evidence: ResidualSource) -> None:
        self.evidence = evidence
        self._contributions: Remembered[dict[str, tuple[np.ndarray, np.ndarray]]] = Remembered(8)
        self._signals: list[np.ndarray] | None = None

    def contributions(self, fit: Fit) -> dict[str, np.ndarray]:
        """Return each effect's contribution to the residuals orthogonal to the tolerances, in units of noise."""
        return {name: beyond for name, (_, beyond) in self._parts_of(fit).items()}

    def whole(self, fit: Fit) -> dict[str, np.ndarray]:
        """Return what each effect of a fit changes: the residuals with it less those without it, in units of noise.

        Where residuals bend, these are run. About a run that overflows, a little less overflow changes next to nothing;
        without any, the level goes on rising.
        """
        evidence, at = self.evidence, dict(zip(self.evidence.free, map(float, fit.x), strict=True))
        if not evidence.bends:
            return {name: added for name, (added, _) in self._parts_of(fit).items()}
        rests = {name: {k: v for k, v in fit.spec.items() if k != name} for name in fit.spec}
        return {name: evidence.z(fit.spec, at, None) - evidence.z(rest, at, None) for name, rest in rests.items()}

    def _parts_of(self, fit: Fit) -> dict[str, tuple[np.ndarray, np.ndarray]]:
        """Return each effect's contribution to the residuals, as it is and orthogonal to the tolerances."""

        def made() -> dict[str, tuple[np.ndarray, np.ndarray]]:
            found, J = {}, self.evidence.slopes(fit.spec, fit.x)
            for name in fit.spec:
                rest = {k: v for k, v in fit.spec.items() if k != name}
                d = -self.evidence.change(rest, fit.spec, fit.x)
                found[name] = d, d - J @ np.linalg.lstsq(J, d, rcond=None)[0] if J.shape[1] else d
            return found

        return self._contributions.get(f"{fit.spec!r} {fit.x.tobytes()!r}", made)

    def main_part(self, fit: Fit, name: str) -> int:
        """Return the place of the equation in which an effect of a fit is largest, in units of noise."""
        raw = self.evidence.raw(self._parts_of(fit)[name][0])
        return int(np.argmax([float(np.mean(np.square(raw[part]))) for part in self.evidence.parts]))

    def magnitude(self, d: np.ndarray) -> float:
        """Return the root mean square of a contribution in the equation where it is largest, unwhitened."""
        raw = self.evidence.raw(d)
        return max(float(np.sqrt(np.mean(np.square(raw[part])))) for part in self.evidence.parts)

    def width(self, fit: Fit, times: float = 1.0) -> np.ndarray | None:
        """Return the standard deviation of each window, in units of its noise; None where nothing is inexact."""
        variance = np.zeros(len(self.evidence.z0))
        for name, d in self.contributions(fit).items():
            if not has_form(self.evidence.effects[name]):
                variance += np.square(FORM_EXACT * d)
                continue
            # A change of a muscle's shape shows in force and volume alike; friction does not.
            elsewhere = 0.0 if self.evidence.effects[name].family in _CONFINED else FORM_ELSEWHERE * self.magnitude(d)
            variance += np.square(FORM_LOCAL * d) + elsewhere**2
        return np.sqrt(1.0 + times**2 * variance) if np.any(variance) else None

    def own_share(self, fit: Fit, name: str, D: np.ndarray, gap: np.ndarray) -> float:
        """Return an effect's own contribution relative to the discrepancy of the others, where that is largest."""
        direct = {k: d for k, (d, _) in self._parts_of(fit).items()}
        rough = [d for k, d in direct.items() if k != name and has_form(self.evidence.effects[k])]
        if not rough:
            return np.inf
        A = np.column_stack([self.evidence.slopes(fit.spec, fit.x), D])
        H, d, free = A.T @ A, direct[name], np.full(D.shape[1], np.inf)
        # Tolerances explain no more than their bounds allow.
        lower, upper = np.concatenate([fit.low - fit.x, -free]), np.concatenate([fit.high - fit.x, free])
        alone = self.evidence.raw(d - A @ bounded(H + 1e-9 * np.diag(np.diag(H)), A.T @ d, lower, upper))
        beside, whole = self.evidence.raw(np.sum(rough, axis=0)), self.evidence.raw(direct[name])
        sizes = [
            [float(np.sqrt(np.mean(np.square(d[p])))) for d in (alone, beside, whole)] for p in self.evidence.parts
        ]
        if not self.evidence.exact:
            # A model that was fitted to the log holds what its causes undo.
            bare = [float(np.sqrt(np.mean(np.square(self.evidence.raw(gap)[p])))) for p in self.evidence.parts]
            sizes = [[mine, min(theirs, g), size] for (mine, theirs, size), g in zip(sizes, bare, strict=True)]
        # Where an effect does not act, tolerances hardly change its apparent contribution.
        acts = 0.3 * max(whole_size for *_, whole_size in sizes)
        return max(mine / max(theirs, 1e-3 * mine, 1e-300) for mine, theirs, size in sizes if size >= acts)

    def columns(self, fit: Fit) -> np.ndarray:
        """Return the columns of the smooth part: each effect's contribution times a signal of the state."""
        if self._signals is None:
            self._signals = _signals(self.evidence.state)
        found: list[np.ndarray] = []
        for name, d in self.contributions(fit).items():
            if not has_form(self.evidence.effects[name]):
                continue
            raw = self.evidence.raw(d)
            mine = [raw * signal for signal in self._signals]
            if self.evidence.effects[name].n_states:
                mine += pasts(raw, self.evidence)
            # A form is inexact by its share once, however many signals it may vary with.
            found += [column / np.sqrt(len(mine)) for column in mine]
        return self.evidence.white(np.column_stack(found)) if found else np.zeros((len(self.evidence.z0), 0))


def _signals(state: dict[str, np.ndarray]) -> list[np.ndarray]:
    """Return signals of the state between about −1 and 1; zero where a window has none."""
    found = []
    for x in (state["P"], state["eps"], np.abs(state["deps"]), np.abs(state["u"])):
        if np.all(np.isnan(x)):
            continue
        low, mid, high = np.nanquantile(x, (0.05, 0.5, 0.95))
        found.append(np.nan_to_num((x - mid) / max(high - low, 1e-12)).clip(-2.0, 2.0))
    return found


def pasts(x: np.ndarray, evidence: ResidualSource) -> list[np.ndarray]:
    """Return the distance of window values from their exponentially weighted past, for several ages."""
    sequence = lanes(evidence)
    order = np.lexsort((evidence.time, sequence))
    starts = np.flatnonzero(np.diff(sequence[order], prepend=-1))
    time, ordered = evidence.time[order], x[order]
    step = np.empty(len(x))
    for a, b in pairwise([*starts.tolist(), len(x)]):
        step[a:b] = max(float(np.median(np.diff(time[a:b]))), 1e-6) if b > a + 1 else 1.0
    out = [np.zeros(len(x)) for _ in AGES]
    for k, age in enumerate(AGES):
        out[k][order] = ordered - past(ordered, np.exp(-step / age), starts)
    return out
