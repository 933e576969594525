"""Signs against a name: that it is not one cause, or that it leaves something unexplained.

Every cause has its own signs: the residual of its equation, its size from part to part of the log, and the other causes
in its equation. So a doubtful one does not affect the others.
"""

from collections.abc import Mapping, Sequence
from functools import cached_property

import numpy as np

from ..inference.competition import Competition
from ..inference.flexible import Flexible
from ..inference.hypotheses import Outcome
from ..inference.significance import noise_error
from ..inference.student_t import bounded
from ..residuals.protocol import ResidualSource
from ..settings import EXCESS, NU, OF_ITS_OWN
from .agreement import over_labels, over_rates, over_stretches
from .closure import Clusters, closures
from .findings import Closure

LAGS = 8
"""Number of lags, in windows, of the residual's autocorrelation."""


def signs_of(
    competition: Competition, outcome: Outcome, part_of: Mapping[str, float], classes: Mapping[str, Sequence[str]]
) -> dict[str, dict[str, float]]:
    """Return the signs of a cause beyond the library for each cause of the best hypothesis, each from 0 to 1."""
    told = _Told(competition, outcome)
    shares = beside(told.main, part_of)
    found = {name: told.signs(name, shares[name], classes[name]) for name in outcome.best.fit.spec}
    # A cause beyond the library that is imitated in several equations at once is not followed well in each of them.
    most = max((signs["left_of_equation"] for signs in found.values()), default=0.0)
    return {
        name: {sign: float(np.clip(v, 0.0, 1.0)) for sign, v in {**signs, "left_beside": most}.items()}
        for name, signs in found.items()
    }


def worst(signs: Mapping[str, Mapping[str, float]]) -> dict[str, float]:
    """Return each sign where it is largest over the causes of a set."""
    names = {sign for each in signs.values() for sign in each}
    return {sign: max(each.get(sign, 0.0) for each in signs.values()) for sign in sorted(names)}


def beside(main: Mapping[str, int], part_of: Mapping[str, float]) -> dict[str, float]:
    """Return each cause's share among those that act mainly in the same equation."""
    whole = dict.fromkeys(main.values(), 0.0)
    for name, part in part_of.items():
        whole[main[name]] += max(part, 0.0)
    return {name: max(part, 0.0) / whole[main[name]] if whole[main[name]] else 1.0 for name, part in part_of.items()}


class _Told:
    """Signs of the causes of the best hypothesis on a log, computed once for each equation."""

    def __init__(self, competition: Competition, outcome: Outcome) -> None:
        self.competition, self.outcome = competition, outcome
        self.evidence, self.best = competition.evidence, outcome.best
        fit = self.best.fit
        self.before, self.after = self.evidence.raw(outcome.base.fit.z), self.evidence.raw(self.best.fit.z)
        self.whole = competition.discrepancy.whole(fit)
        self.beyond = {k: self.evidence.raw(d) for k, d in competition.discrepancy.contributions(fit).items()}
        # What is less than the noise's own error is not left: on a bench the weights of the signs are fitted without.
        self.unsure = 0.0 if self.evidence.exact else noise_error(self.evidence)
        self.main = {name: competition.discrepancy.main_part(fit, name) for name in fit.spec}
        self.weight = np.empty(len(fit.z))
        for part, s, share in zip(self.evidence.parts, fit.scales, competition.fitter.weights, strict=True):
            self.weight[part] = share * (NU + 1.0) / (NU + np.square(fit.z[part] / s)) / s**2
        self.flexible = Flexible(self.evidence)
        self._equations: dict[int, dict[str, float]] = {}

    def signs(self, name: str, share: float, alike: Sequence[str]) -> dict[str, float]:
        """Return the signs of a cause, given its share among its equation's causes and its alternatives."""
        return {
            **self._of_equation(self.main[name]),
            "left_of_gap": self._left_of_gap,
            "unclosed_of_gap": self._unclosed_of_gap,
            "left_where_it_acts": self._left_where(self._where(name)),
            "elsewhere": self._elsewhere,
            "undone": self._undone(name),
            "faint": -0.25 * np.log(max(share, 1e-3)),
            **self._of_factor(name),
            "alike": (len(alike) - 1) / 4.0,
        }

    def _of_equation(self, k: int) -> dict[str, float]:
        """Return the signs that all causes of an equation share."""
        if k not in self._equations:
            part, name = self.evidence.parts[k], self.evidence.equations[k]
            was, now, left = self.outcome.base.left[k], self.best.left[k], 0.0
            if min(was, now) > self._least(k):
                left = float(np.log(now) / np.log(was))
            room, still = self._excess(self.before[part]), self._excess(self.after[part])
            enough = still > 0.0 and part.stop - part.start > 60
            share = still / room if room > 0 else 0.0
            # Where the gap is large, a right cause of a slightly wrong form leaves more than the noise.
            tells = min(1.0, share / OF_ITS_OWN**2)
            self._equations[k] = {
                "left": 2.0 * left * tells,
                "left_of_equation": share,
                "predictable": self.flexible.remainder(name, self.best.fit.z).share * tells if enough else 0.0,
                "coloured": _colour(self.evidence, self.best.z, part) * tells,
                # Two runs do not show what would be closed on others.
                "unclosed": 1.0 - self._closures[k].ci90[0] if len(self.evidence.trajectories) > 2 else 0.0,
            }
        return self._equations[k]

    def _least(self, k: int) -> float:
        """Return the level above which an equation's residual exceeds its noise, given the number of windows."""
        part = self.evidence.parts[k]
        return 1.0 + EXCESS + float(np.sqrt(2.0 / max(part.stop - part.start, 1)))

    @cached_property
    def _left_of_gap(self) -> float:
        return self._left_in(self.evidence.parts)

    def _left_in(self, parts: Sequence[slice]) -> float:
        """Return the share of the gap in some equations that the hypothesis leaves."""
        room = sum(self._excess(self.before[part]) for part in parts)
        return sum(self._excess(self.after[part]) for part in parts) / room if room > 0 else 0.0

    def _left_where(self, parts: Sequence[slice]) -> float:
        """Return the share that is left where a cause acts; of the whole gap where there is none beyond the noise."""
        return self._left_in(parts) if any(self._excess(self.before[p]) > 0.0 for p in parts) else self._left_of_gap

    def _excess(self, z: np.ndarray) -> float:
        """Return by how much residuals exceed their noise, a sum of squares to which no window adds without bound."""
        power = np.square(z)
        bounded_sum = float(np.sum(np.minimum(power, 36.0 * (np.median(power) + 1.0))))
        return max(bounded_sum - (1.0 + self.unsure) * len(z), 0.0)

    def _where(self, name: str) -> list[slice]:
        """Return the equations that a cause changes: a gap in others is no sign for or against it."""
        acts = self.evidence.touched([name])
        return [p for e, p in zip(self.evidence.equations, self.evidence.parts, strict=True) if e in acts]

    @cached_property
    def _held_out(self) -> tuple[np.ndarray, np.ndarray]:
        """Residuals of the fit, and of fits on the other runs."""
        clusters = Clusters(self.competition.fitter, self.best.fit)
        return self.evidence.raw(clusters.z), self.evidence.raw(clusters.held_out())

    @cached_property
    def _unclosed_of_gap(self) -> float:
        room, still = (sum(self._excess(z[p]) for p in self.evidence.parts) for z in (self.before, self._held_out[1]))
        return still / room if room > 0 else 0.0

    @cached_property
    def _elsewhere(self) -> float:
        """A cause beyond the library, imitated in one equation, is still there in the others."""
        most = 0.0
        for k, closure in enumerate(self._closures):
            b, a, f = np.square([closure.rmse_before, closure.rmse_after, closure.noise_floor])
            if k not in self.main.values() and b > self._least(k) ** 2 * f:
                most = max(most, float(np.clip((a - f) / (b - f), 0.0, 1.0) * min(1.0, 0.5 * np.log(b / f))))
        return most

    @cached_property
    def _closures(self) -> list[Closure]:
        after, held_out = self._held_out
        return closures(self.evidence, self.before, held_out, after, np.random.RandomState(0))

    def _undone(self, name: str) -> float:
        part = self.evidence.parts[self.main[name]]
        d, others = self.beyond[name][part], [self.beyond[n][part] for n in self.main if n != name]
        return -float(_cosines(np.sum(others, axis=0)[:, None], d)[0]) if others else 0.0

    def _of_factor(self, name: str) -> dict[str, float]:
        """Return how far runs and parts of the state disagree on a cause, and how uncertain it is."""
        evidence, fit, whole = self.evidence, self.best.fit, self.whole[name]
        # A parameter at the end of its tolerance explains nothing more: a cause may be what is beyond.
        J, low, high = (
            v[..., fit.inside] for v in (evidence.slopes(fit.spec, fit.x), fit.low - fit.x, fit.high - fit.x)
        )
        # A cause by the same parameter is its change beyond the tolerance, which the tolerance cannot explain.
        own = ~np.isclose(np.abs(_cosines(J, whole)), 1.0, atol=1e-2)
        J, low, high = J[:, own], low[own], high[own]
        d = whole - J @ bounded(J.T @ J, J.T @ whole, low, high)
        information, score = self.weight * d * d, -self.weight * d * fit.z
        runs, uneven = over_labels(evidence.block, information, score), 0.0
        for x in evidence.state.values():
            known = np.isfinite(x)
            if known.any() and np.ptp(x[known]) > 0.0:
                middle = np.average(x[known], weights=information[known]) if information[known].any() else 0.0
                halves = over_labels((x[known] > middle).astype(int), information[known], score[known])
                uneven = max(uneven, halves.least)
        size = np.sqrt(self.weight)
        return {
            "disagreeing": runs.least,
            "uneven": uneven,
            "uncertain": runs.half,
            "paced": over_rates(evidence, size * d, size * fit.z).least,
            "unsupported": self._unsupported(name, size * d, size),
        }

    def _unsupported(self, name: str, d: np.ndarray, size: np.ndarray) -> float:
        """Return half of the interval of a cause's factor beside other causes, tolerances projected out."""
        D, slots = self.competition.sensitivities(self.best.fit)
        others = D[:, [n != name for n, _ in slots]] * size[:, None]
        if others.shape[1]:
            others = others / np.maximum(np.linalg.norm(others, axis=0), 1e-300)
            d = d - others @ np.linalg.lstsq(others, d, rcond=1e-9)[0]
        return over_stretches(self.evidence, d * d, -d * size * self.best.fit.z).half


def _cosines(A: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Return the cosine between each column and a vector."""
    size = np.sqrt(np.sum(np.square(A), axis=0) * float(x @ x))
    return np.asarray((x @ A) / np.maximum(size, 1e-300))


def _colour(evidence: ResidualSource, z: np.ndarray, part: slice) -> float:
    """Return the root mean square autocorrelation of an equation's residual, beyond chance."""
    order = np.lexsort((evidence.time[part], evidence.side[part], evidence.run[part]))
    x = z[part][order]
    size = float(np.median(np.abs(x))) / 0.6745 if len(x) else 0.0
    if len(x) < 10 * LAGS or size <= 0.0:
        return 0.0
    x = np.clip(x, -4.0 * size, 4.0 * size)
    lane = (evidence.run[part] * 16 + evidence.side[part])[order]
    power, total = float(np.mean(x * x)), 0.0
    for lag in range(1, LAGS + 1):
        same = lane[lag:] == lane[:-lag]
        if same.any():
            total += float(np.mean((x[lag:] * x[:-lag])[same]) / power) ** 2 - 1.0 / float(same.sum())
    return float(np.sqrt(max(total, 0.0) / LAGS))
