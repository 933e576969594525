"""One channel of a log: range, noise, steps, missing, frozen and clipped readings."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
import pandas as pd

from ..explained import explained_fields
from ..signals import noise_level
from ..signals.noise import quantisation_step
from ..signals.stretches import stretches_of, stuck_rows
from ..signals.thinning import spaced
from ..signals.units import SI_UNITS, base_name, dimension_of

_MOTION = ("q", "eps", "x")
_READINGS = ("P", "F", "mdot", "drive")  # a position may be constant while others move
_EDGE = 3.0  # times as many readings at an edge as steps of the same width have elsewhere
_LEAST_EDGE = 0.005
_MOST_RUNS = 60


@explained_fields
@dataclass(frozen=True)
class Channel:
    """What one channel reads.

    Examples
    --------
    >>> from pamid.bench import BenchParameters, simulate, sine
    >>> from pamid.survey.survey import survey
    >>> log = simulate(BenchParameters.for_muscle("B"), [sine(4, 15, 800), sine(8, 10, 800)])
    >>> P1 = next(c for c in survey(log).channels if c.name == "P1")
    >>> f"{P1.unit}, moves: {P1.moves}"
    'Pa, moves: True'
    """

    name: Annotated[str, "Signal."]
    unit: Annotated[str, "SI unit; empty where the name does not say."]
    low: Annotated[float, "Range."]
    high: Annotated[float, "Range."]
    missing: Annotated[float, "Share of missing readings."]
    longest_missing: Annotated[float, "Longest stretch of missing readings, s."]
    frozen: Annotated[float, "Share of readings that repeat one value for long while other channels move."]
    clipped: Annotated[
        str, '``"low"``, ``"high"``, ``"both"`` or empty: the end of the range at which readings pile up.'
    ]
    noise: Annotated[float, "Standard deviation of white noise, unit of the channel."]
    step: Annotated[float, "Step of quantisation, 0 where none is seen."]
    moves: Annotated[bool, "Whether the range is well above the noise."]

    @property
    def bits(self) -> float:
        """Steps over the range, as a power of two; infinite where no step is seen."""
        return float(np.log2(max((self.high - self.low) / self.step, 1.0))) if self.step > 0 else float("inf")


def channels_of(log: pd.DataFrame) -> list[Channel]:
    """Return every channel of a tidy log, in its order."""
    names = [str(c) for c in log.columns if c not in ("trajectory", "time")]
    runs = [run for _, run in log.groupby("trajectory", sort=False)]
    moving = {name: _activity(log[name].to_numpy(dtype=float)) for name in names if base_name(name) in _MOTION}
    return [_channel(name, log, runs, moving if base_name(name) in _READINGS else {}) for name in names]


def _channel(name: str, log: pd.DataFrame, runs: list[pd.DataFrame], others: dict[str, np.ndarray]) -> Channel:
    y = log[name].to_numpy(dtype=float)
    good = np.isfinite(y)
    dimension = dimension_of(name)
    unit = SI_UNITS.get(dimension or "", "")
    if not good.any():
        return Channel(name, unit, np.nan, np.nan, 1.0, float("nan"), 0.0, "", np.nan, 0.0, False)
    low, high = float(y[good].min()), float(y[good].max())
    longest = 0.0 if good.all() else max(_longest(run, name) for run in runs)
    read = [run[name].to_numpy(dtype=float) for run in runs[spaced(len(runs), _MOST_RUNS, at_most=True)]]
    known = [x[np.isfinite(x)] for x in read if np.isfinite(x).sum() > 20]
    noise, step = (float(np.median([of(x) for x in known] or [0.0])) for of in (noise_level, quantisation_step))
    return Channel(
        name=name,
        unit=unit,
        low=low,
        high=high,
        missing=float(np.mean(~good)),
        longest_missing=longest,
        frozen=_frozen(y, others),
        clipped=_clipped(y[good]),
        noise=noise,
        step=step,
        moves=bool(high - low > max(10.0 * noise, 2.0 * step, 1e-9 * max(abs(low), abs(high)))),
    )


def _longest(run: pd.DataFrame, name: str) -> float:
    bad = ~np.isfinite(run[name].to_numpy(dtype=float))
    time = run["time"].to_numpy(dtype=float)
    return max((float(time[min(b, len(time) - 1)] - time[a]) for a, b in stretches_of(bad)), default=0.0)


def _activity(y: np.ndarray) -> np.ndarray:
    """Return the running sum of a channel's movement over its range."""
    d = np.abs(np.diff(y, prepend=y[:1]))
    scale = float(np.nanmax(y) - np.nanmin(y)) if np.isfinite(y).any() else 0.0
    return np.asarray(np.nancumsum(d) / scale) if scale > 0 else np.zeros(len(y))


def _frozen(y: np.ndarray, others: dict[str, np.ndarray]) -> float:
    """Return the share of readings in stretches that stand still for long while another channel moves."""

    def moves(a: int, b: int) -> bool:
        return bool(np.isfinite(y[a])) and any(o[b - 1] - o[a] > 0.2 for o in others.values())

    return float(np.mean(stuck_rows(y, moves))) if len(y) else 0.0


def _clipped(y: np.ndarray) -> str:
    """Say at which end of its range a channel stands longer than a signal that turns there would."""
    low, high = float(y.min()), float(y.max())
    if high <= low or len(np.unique(y)) < 20:
        return ""
    inner = np.histogram(y, bins=50)[0][[1, 2, -2, -3]]
    found = []
    for word, edge, beside in (("low", low, inner[:2]), ("high", high, inner[2:])):
        share = float(np.mean(y == edge))
        if share > _LEAST_EDGE and share * len(y) > _EDGE * max(float(beside.mean()), 1.0):
            found.append(word)
    return "both" if len(found) == 2 else found[0] if found else ""
