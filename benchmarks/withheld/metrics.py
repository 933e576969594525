"""Figures of the withheld check, as pure functions of records: what was true of a case and what was answered.

A record is a `Truth` and an `Answer`. A method that gives no answer to a question leaves its field empty, and the
figure is then not counted for it.
"""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np

DETECTABLE = 0.15
"""Strength over the floor from which an effect has to be found."""
LOUD = 1.0
"""Strength from which an effect is loud."""
NAMING = ("cause", "class", "several")
"""Verdicts that name effects of the library."""
TOGETHER = ("pairs", "several")
"""Suites of more than one effect."""
APART = ("none", "unknown")
"""Candidates that are no effects."""


@dataclass(frozen=True)
class Truth:
    """What is true of a case.

    Parameters
    ----------
    suite : str
        Its suite.
    effects : dict of str to float
        What the bench has, and how strong it is over the floor.
    families : dict of str to str
        Families of these.
    equations : tuple of str
        Equations in which the gap is at least half as strong as where it is strongest, that one first.
    in_library : bool
        Whether the library of the diagnosis holds it.
    """

    suite: str
    effects: dict[str, float]
    families: dict[str, str]
    equations: tuple[str, ...]
    in_library: bool = True

    @property
    def label(self) -> str:
        """The right answer in one word: a name, ``none`` or ``unknown``."""
        if not self.effects:
            return "none"
        return next(iter(self.effects)) if self.in_library else "unknown"

    @property
    def strength(self) -> float:
        """Strength of the weakest effect; 0 without one."""
        return min(self.effects.values(), default=0.0)


@dataclass(frozen=True)
class Answer:
    """What a method says of a case.

    Parameters
    ----------
    gap : bool
        Whether there is one.
    verdict : str
        ``cause``, ``class``, ``several``, ``unknown`` or ``none``.
    confidence : dict of str to float
        Of each candidate, ``none`` and ``unknown`` included.
    causes : tuple of tuple of str
        Names of each cause.
    families : dict of str to str
        Families of the named effects.
    equation : str or None
        Where most of the gap lies.
    region_f1 : float or None
        Agreement of the named regions with the true ones.
    over_floor_f1 : float or None
        The same with the windows in which the gap is larger than the floor.
    predicted, realised : float or None
        Share of the explainable gap that the correction closes: as said, and on unseen trajectories.
    interval : tuple of float or None
        90 % interval of `predicted`.
    amplitude : bool or None
        Whether the 90 % interval of the amplitude holds the true one, where it means the same on the bench.
    seconds : float
        Time it took.
    reserved : bool
        Whether its names are said with reservations.
    """

    gap: bool
    verdict: str
    confidence: dict[str, float] = field(default_factory=dict)
    causes: tuple[tuple[str, ...], ...] = ()
    families: dict[str, str] = field(default_factory=dict)
    equation: str | None = None
    region_f1: float | None = None
    over_floor_f1: float | None = None
    predicted: float | None = None
    realised: float | None = None
    interval: tuple[float, float] | None = None
    amplitude: bool | None = None
    seconds: float = math.nan
    reserved: bool = False

    @property
    def ranking(self) -> list[str]:
        """Candidates, the most probable first; of equals, the first given."""
        return sorted(self.confidence, key=lambda k: -self.confidence[k])

    @property
    def named(self) -> set[str]:
        """All names of all causes; none unless the verdict names some."""
        return {n for names in self.causes for n in names} if self.verdict in NAMING else set()


Record = tuple[Truth, Answer]


@dataclass(frozen=True)
class Figure:
    """A measured figure.

    Parameters
    ----------
    value : float
        NaN if there was nothing to count.
    n : int
        Number of cases behind it.
    low, high : float
        95 % interval; NaN where none is given.
    """

    value: float
    n: int
    low: float = math.nan
    high: float = math.nan


NOTHING = Figure(math.nan, 0)


def wilson(hits: int, n: int, z: float = 1.959964) -> tuple[float, float]:
    """Return Wilson's 95 % interval of a share; (0, 1) without cases."""
    if n == 0:
        return 0.0, 1.0
    p = hits / n
    centre = (p + z * z / (2 * n)) / (1 + z * z / n)
    half = z / (1 + z * z / n) * math.sqrt(p * (1 - p) / n + z * z / (4 * n * n))
    return max(0.0, centre - half), min(1.0, centre + half)


def share(flags: Iterable[bool]) -> Figure:
    """Return the share of true flags with Wilson's interval."""
    listed = [bool(f) for f in flags]
    if not listed:
        return NOTHING
    hits = sum(listed)
    return Figure(hits / len(listed), len(listed), *wilson(hits, len(listed)))


def spread(values: Iterable[float | None], of: Callable[[np.ndarray], np.floating | float], seed: int = 0) -> Figure:
    """Return a statistic of numbers with the interval of 400 bootstrap samples."""
    x = np.array([v for v in values if v is not None and math.isfinite(v)], dtype=float)
    if not len(x):
        return NOTHING
    rng = np.random.default_rng(seed)
    again = [float(of(x[rng.integers(len(x), size=len(x))])) for _ in range(400)] if len(x) > 1 else [math.nan]
    low, high = np.quantile(again, [0.025, 0.975])
    return Figure(float(of(x)), len(x), float(low), float(high))


def of_suite(records: Sequence[Record], *suites: str) -> list[Record]:
    """Return the records of some suites."""
    return [r for r in records if r[0].suite in suites]


def _single(records: Sequence[Record], low: float = DETECTABLE, high: float = math.inf) -> list[Record]:
    return [r for r in of_suite(records, "single") if low <= r[0].strength < high]


# --- is there a gap, and where ------------------------------------------------------------------------------
def false_alarms(records: Sequence[Record]) -> Figure:
    """Share of logs without a gap that are said to have one."""
    return share(a.gap for _, a in of_suite(records, "none"))


def detected(records: Sequence[Record]) -> Figure:
    """Share of logs with a detectable effect that are said to have a gap."""
    return share(a.gap for _, a in _single(records))


def located(records: Sequence[Record]) -> Figure:
    """Share of these in which the equation with the largest share is one where the gap is strong."""
    return share(a.equation in t.equations for t, a in _single(records) if a.equation is not None or a.gap)


def region_f1(records: Sequence[Record]) -> Figure:
    """Mean agreement of the named regions with the smallest set of windows that holds 80 % of the gap; loud effects."""
    return spread((a.region_f1 for _, a in _single(records, LOUD)), np.mean)


def over_floor_f1(records: Sequence[Record]) -> Figure:
    """Mean agreement of the named regions with the windows in which the gap is larger than the floor; loud effects."""
    return spread((a.over_floor_f1 for _, a in _single(records, LOUD)), np.mean)


# --- which ---------------------------------------------------------------------------------------------------
def _ranked(records: Sequence[Record]) -> list[Record]:
    return [r for r in records if r[1].confidence]


def first(records: Sequence[Record], low: float, high: float = math.inf) -> Figure:
    """Share of single effects of some strength whose name heads the ranking (with ``none`` and ``unknown`` in it)."""
    return share(a.ranking[0] == t.label for t, a in _ranked(_single(records, low, high)))


def first_three(records: Sequence[Record]) -> Figure:
    """Share of single effects whose name is among the first three."""
    return share(t.label in a.ranking[:3] for t, a in _ranked(_single(records)))


def in_class(records: Sequence[Record]) -> Figure:
    """Share of answers that name effects in which the true one is among them; single and confusable cases."""
    kept = [r for r in of_suite(records, "single", "confusable") if r[0].strength >= DETECTABLE and r[1].named]
    return share(t.label in a.named for t, a in kept)


def class_size(records: Sequence[Record]) -> Figure:
    """Mean number of names a cause in these answers."""
    kept = [a for t, a in of_suite(records, "single", "confusable") if t.strength >= DETECTABLE and a.named]
    return spread((len(names) for a in kept for names in a.causes), np.mean)


def off_library_named(records: Sequence[Record]) -> Figure:
    """Share of causes outside the library that are given a name of the library."""
    return share(bool(a.named) for _, a in of_suite(records, "off-library"))


def off_library_sure(records: Sequence[Record]) -> Figure:
    """Share of causes outside the library that are given a name of the library without reservations."""
    return share(bool(a.named) and not a.reserved for _, a in of_suite(records, "off-library"))


def wrong_and_sure(records: Sequence[Record]) -> Figure:
    """Share of causes named without reservations, whatever is true, none of whose names is an effect of the bench."""
    kept = [(t, names) for t, a in records if a.verdict in NAMING and not a.reserved for names in a.causes]
    return share(not set(names) & set(t.effects) for t, names in kept)


def reserved(records: Sequence[Record]) -> Figure:
    """Share of detectable effects of the library, alone or in pairs, whose names are said with reservations."""
    kept = [r for r in of_suite(records, "single", "confusable", "pairs") if r[0].strength >= DETECTABLE]
    return share(a.verdict in NAMING and a.reserved for _, a in kept)


def wrong_names(records: Sequence[Record]) -> Figure:
    """Share of named causes, whatever is true, none of whose names is an effect of the bench."""
    kept = [(t, names) for t, a in records if a.verdict in NAMING for names in a.causes]
    return share(not set(names) & set(t.effects) for t, names in kept)


def left_unknown(records: Sequence[Record]) -> Figure:
    """Share of detectable effects of the library, alone or in pairs, whose log is answered with ``unknown``."""
    kept = [r for r in of_suite(records, "single", "confusable", "pairs") if r[0].strength >= DETECTABLE]
    return share(a.verdict == "unknown" for _, a in kept)


def _pairs(records: Sequence[Record]) -> list[Record]:
    return [r for r in of_suite(records, "pairs") if r[0].strength >= DETECTABLE]


def both(records: Sequence[Record]) -> Figure:
    """Share of pairs, each effect detectable alone, of which both are named."""
    return share(set(t.effects) <= a.named for t, a in _pairs(records))


def one_of_two(records: Sequence[Record]) -> Figure:
    """Share of these pairs of which at least one is named."""
    return share(bool(set(t.effects) & a.named) for t, a in _pairs(records))


def confusable_first(records: Sequence[Record]) -> Figure:
    """Share of confusable cases, recorded with poor excitation, whose name heads the ranking."""
    kept = [r for r in of_suite(records, "confusable") if r[0].strength >= DETECTABLE]
    return share(a.ranking[0] == t.label for t, a in _ranked(kept))


# --- how sure ------------------------------------------------------------------------------------------------
def correct(truth: Truth, answer: Answer) -> bool:
    """Whether the head of the ranking is right; of several effects, any of them is."""
    head = answer.ranking[0]
    return head in truth.effects if truth.suite in TOGETHER else head == truth.label


def calibration_error(confidence: np.ndarray, right: np.ndarray, bins: int = 10) -> float:
    """Return the expected calibration error over bins of equal width, weighted by their cases."""
    at = np.minimum((np.asarray(confidence) * bins).astype(int), bins - 1)
    gaps = [abs(confidence[at == b].mean() - right[at == b].mean()) * np.sum(at == b) for b in np.unique(at)]
    return float(np.sum(gaps) / len(confidence))


def ece(records: Sequence[Record]) -> Figure:
    """Expected calibration error of the confidence in the head of the ranking, over all suites."""
    kept = _ranked(records)
    if not kept:
        return NOTHING
    sure = np.array([a.confidence[a.ranking[0]] for _, a in kept])
    right = np.array([correct(t, a) for t, a in kept], dtype=float)
    rng = np.random.default_rng(0)
    picks = [rng.integers(len(kept), size=len(kept)) for _ in range(200)]
    low, high = np.quantile([calibration_error(sure[p], right[p]) for p in picks], [0.025, 0.975])
    return Figure(calibration_error(sure, right), len(kept), float(low), float(high))


# --- how far -------------------------------------------------------------------------------------------------
def _right(records: Sequence[Record]) -> list[Answer]:
    return [a for t, a in _single(records, LOUD) if a.named and t.label in a.named]


def closed(records: Sequence[Record]) -> Figure:
    """Median share of the explainable gap that the correction closes on unseen trajectories; loud, right cause."""
    return spread((a.realised for a in _right(records)), np.median)


def misjudged(records: Sequence[Record]) -> Figure:
    """Median distance of the predicted from the realised closed share; loud effects that were given a name."""
    kept = [a for _, a in _single(records, LOUD) if a.named and a.predicted is not None and a.realised is not None]
    return spread(
        (abs(a.predicted - a.realised) for a in kept if a.predicted is not None and a.realised is not None), np.median
    )


def covered(records: Sequence[Record]) -> Figure:
    """Share of 90 % intervals of the closed share that hold the realised one; loud effects that were given a name."""
    kept = [a for _, a in _single(records, LOUD) if a.named and a.realised is not None and a.interval is not None]
    return share(a.interval[0] <= a.realised <= a.interval[1] for a in kept if a.interval and a.realised is not None)


def covered_nearly(records: Sequence[Record]) -> Figure:
    """Share of these intervals that come within one point of the realised share."""
    kept = [a for _, a in _single(records, LOUD) if a.named]
    return share(
        a.interval[0] - 0.01 <= a.realised <= a.interval[1] + 0.01
        for a in kept
        if a.interval is not None and a.realised is not None
    )


def amplitude_covered(records: Sequence[Record]) -> Figure:
    """Share of 90 % intervals of amplitudes that hold the true one; single effects that mean the same on the bench."""
    return share(a.amplitude for _, a in _single(records) if a.amplitude is not None)


def wrong_family(records: Sequence[Record]) -> Figure:
    """Median share closed on unseen trajectories where all that was named is of other families; loud effects."""
    kept = []
    for t, a in _single(records, LOUD):
        if a.named and not {a.families.get(n) for n in a.named} & set(t.families.values()):
            kept.append(a.realised)
    return spread(kept, np.median)


# --- matrices ------------------------------------------------------------------------------------------------
def said(answer: Answer) -> str:
    """Return the head of the ranking, or the verdict where nothing is ranked."""
    return answer.ranking[0] if answer.confidence else answer.verdict


def confusion(records: Sequence[Record]) -> dict[str, Counter[str]]:
    """Return for each true label how often each answer was given; several at once are left out."""
    table: dict[str, Counter[str]] = defaultdict(Counter)
    for t, a in records:
        if t.suite not in TOGETHER:
            table[t.label][said(a)] += 1
    return dict(table)


def inversion(records: Sequence[Record]) -> dict[str, Counter[str]]:
    """Return for each answer how often each label was true."""
    table: dict[str, Counter[str]] = defaultdict(Counter)
    for label, answers in confusion(records).items():
        for answer, n in answers.items():
            table[answer][label] += n
    return dict(table)
