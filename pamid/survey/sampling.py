"""How a log is sampled: runs, rate, jitter, gaps, repeats."""

from collections import Counter
from dataclasses import dataclass
from typing import Annotated

import numpy as np
import pandas as pd

from ..explained import explained_fields
from ..signals.splits import kind_of

_GAP = 5.0  # sampling intervals
_PAUSE = 20.0  # sampling intervals
_POINTS = 200
_ALIKE = 0.1  # of the spread: two runs that differ by less are a repeat
_MOST_RUNS = 80


@explained_fields
@dataclass(frozen=True)
class Sampling:
    """Runs of a log and their clock.

    Examples
    --------
    >>> from pamid.bench import BenchParameters, simulate, sine
    >>> from pamid.survey.survey import survey
    >>> log = simulate(BenchParameters.for_muscle("B"), [sine(4, 15, 800), sine(8, 10, 800)])
    >>> sampling = survey(log).sampling
    >>> f"{sampling.rate:.0f} Hz, {sampling.gaps} gaps"
    '1000 Hz, 0 gaps'
    """

    rows: Annotated[int, "Rows and runs."]
    runs: Annotated[int, "Rows and runs."]
    kinds: Annotated[dict[str, int], "Runs of each kind (the first part of a run's name)."]
    seconds: Annotated[float, "Recorded time, s."]
    shortest: Annotated[float, "Length of the shortest and the longest run, s."]
    longest: Annotated[float, "Length of the shortest and the longest run, s."]
    period: Annotated[float, "Median sampling period, s."]
    jitter: Annotated[float, "Standard deviation of the period over its median, gaps left out, dimensionless."]
    gaps: Annotated[int, "Steps of time longer than five periods."]
    longest_gap: Annotated[float, "s."]
    mixed: Annotated[bool, "Whether the runs have different periods."]
    repeats: Annotated[int, "Runs that repeat an earlier one."]
    repeat_error: Annotated[dict[str, float], "For each signal the standard deviation between repeats, in its unit."]

    @property
    def rate(self) -> float:
        """Sampling rate, Hz."""
        return 1.0 / self.period if self.period > 0 else float("nan")


def sampling_of(log: pd.DataFrame, signals: list[str]) -> Sampling:
    """Return how a tidy log is sampled."""
    groups = [(str(name), run) for name, run in log.groupby("trajectory", sort=False)]
    times = [run["time"].to_numpy(dtype=float) for _, run in groups]
    lengths = np.array([t[-1] - t[0] if len(t) > 1 else 0.0 for t in times])
    periods = np.array([np.median(s) for t in times if len(s := np.diff(t)) and np.median(s) > 0])
    period = float(np.median(periods)) if len(periods) else float("nan")
    steps = np.concatenate([np.diff(t) for t in times]) if times else np.zeros(0)
    long = steps > _GAP * period
    repeats, error = _repeats([run for _, run in groups], signals)
    usual = steps[(steps > 0) & ~long]
    return Sampling(
        rows=len(log),
        runs=len(groups),
        kinds=dict(Counter(kind_of(name) for name, _ in groups)),
        seconds=float(lengths.sum()),
        shortest=float(lengths.min()) if len(lengths) else 0.0,
        longest=float(lengths.max()) if len(lengths) else 0.0,
        period=period,
        jitter=float(np.std(usual) / period) if len(usual) and period > 0 else 0.0,
        gaps=int(long.sum()),
        longest_gap=float(steps[long].max()) if long.any() else 0.0,
        mixed=bool(len(periods) and periods.max() > 1.1 * periods.min()),
        repeats=repeats,
        repeat_error=error,
    )


def between_pauses(log: pd.DataFrame, period: float) -> pd.DataFrame:
    """Return a log whose runs are cut where time goes on by more than 20 periods, so that nothing looks across."""
    time = log["time"].to_numpy(dtype=float)
    codes = log["trajectory"].factorize()[0]
    same = codes[1:] == codes[:-1]
    pauses = np.concatenate([[False], same & (np.diff(time) > _PAUSE * period)])
    if not pauses.any():
        return log
    part = log.assign(pause=pauses.astype(int)).groupby("trajectory", sort=False)["pause"].cumsum()
    names = log["trajectory"].astype(str)
    return log.assign(trajectory=names.where(part == 0, names + " (" + (part + 1).astype(str) + ")"))


def _repeats(runs: list[pd.DataFrame], signals: list[str]) -> tuple[int, dict[str, float]]:
    """Return how many runs repeat an earlier one, and how far repeats differ."""
    if len(runs) < 2 or not signals:
        return 0, {}
    looked = runs[:_MOST_RUNS]
    shapes = [{s: _resampled(run, s) for s in signals} for run in looked]
    lengths = [float(np.ptp(run["time"])) for run in looked]
    count, squares = 0, {s: [] for s in signals}  # type: ignore[var-annotated]
    for j in range(1, len(looked)):
        for i in range(j):
            if abs(lengths[i] - lengths[j]) > 0.05 * max(lengths[i], lengths[j]):
                continue
            if all(_alike(shapes[i][s], shapes[j][s]) for s in signals[:2]):
                count += 1
                for s in signals:
                    squares[s].append(float(np.nanmean(np.square(shapes[i][s] - shapes[j][s])) / 2))
                break
    return count, {s: float(np.sqrt(np.mean(v))) for s, v in squares.items() if v and np.isfinite(v).all()}


def _resampled(run: pd.DataFrame, signal: str) -> np.ndarray:
    t, y = run["time"].to_numpy(dtype=float), run[signal].to_numpy(dtype=float)
    good = np.isfinite(y)
    if good.sum() < 2:
        return np.full(_POINTS, np.nan)
    t, y = t[good], y[good]  # the nearest reading: between two of them part of the noise would average out
    at = np.linspace(t[0], t[-1], _POINTS)
    right = np.clip(np.searchsorted(t, at), 1, len(t) - 1)
    return np.asarray(y[np.where(at - t[right - 1] < t[right] - at, right - 1, right)])


def _alike(a: np.ndarray, b: np.ndarray) -> bool:
    spread = float(np.std(a))
    if not np.isfinite(spread) or not np.isfinite(b).all():
        return False
    return bool(np.sqrt(np.mean(np.square(a - b))) <= _ALIKE * max(spread, 1e-3 * abs(float(np.mean(a)))))
