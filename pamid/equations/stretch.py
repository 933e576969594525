"""One stretch of a log on equal steps: lost samples bridged, uneven times evened, and the noise that this leaves.

Windows, filters and memories need equal steps; a log need not have them. Each column of a stretch is brought to equal
steps by a sparse matrix, the identity where every sample was read at its time: a smooth signal by the cubic through the
four samples about a row, a valve's command and flow, which jump, by the sample nearest to it. The matrix also says what
the noise of the samples leaves in any weighted sum over the rows.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.sparse import csr_array

from ..effects import Signals
from ..remembered import Remembered
from ..signals.paths import Path
from ..signals.stretches import stretches_of
from .noise import ChannelNoise, roughness
from .windows import WINDOW, Bridge, Windows, samples_per_window

BRIDGED = 2 * WINDOW
"""Longest time between two samples that a stretch goes on over, s: no motion that windows resolve hides in it."""
HALF = 0.5
"""Longest time between two samples that the test function of a derivative may hold, in windows."""
JITTER = 0.25
"""Deviation of a time from equal steps that may be a clock's own, in steps."""
REMEMBERED = 12
"""Memories of paths, and results of nominal parameters, that are kept for fits to come."""
_BETTER = 0.8  # of the angle's noise: the clock under which the angle is so much smoother is the right one
_BRACKET = 1.9  # rows: samples that are closer determine a smooth signal between them
_SLOWEST = 3.5  # sampling intervals: two samples lost in a row of a slow log are bridged as well
_ENOUGH = 1000  # rows that tell the noise of a channel well enough
_JUMPS = ("mdot", "u")
_SEEN = 0.01  # of the full command: a smaller step that comes a sample earlier or later does not show in a flow
_JUMP = 8.0  # standard deviations of what lies between samples: a step over a hole that is larger is a jump


def remembered() -> Remembered[Any]:
    """Return a cache for later fits."""
    return Remembered(REMEMBERED)


@dataclass
class Stretch:
    """Signals of one stretch of a log on equal steps."""

    trajectory: str
    """Name of the run."""
    time: np.ndarray
    """s; shape (n_rows,)."""
    dt: float
    """Step, s."""
    readings: dict[str, np.ndarray]
    """Channels by name; ``q`` has one column, the others one per muscle. Shape (n_rows, n_columns)."""
    bridges: dict[str, list[Bridge]] = field(default_factory=dict)
    """For each channel of which not all rows were read, how its columns came to equal steps."""
    noises: dict[str, list[ChannelNoise]] = field(default_factory=dict)
    selections: dict[tuple[Any, ...], Windows] = field(default_factory=dict)
    smoothed: dict[tuple[Any, ...], np.ndarray] = field(default_factory=dict)
    memories: Remembered[np.ndarray] = field(default_factory=remembered)
    geometry: Remembered[np.ndarray] = field(default_factory=remembered)
    paths: Remembered[Path] = field(default_factory=remembered)
    signals: Remembered[Signals] = field(default_factory=remembered)

    def __post_init__(self) -> None:
        self.n: int = samples_per_window(self.dt)

    def holes(self, channel: str, longest: float) -> np.ndarray:
        """Return the rows of holes of a channel that are longer than a time, s; those in which it jumped with them."""
        out = np.zeros(len(self.time), dtype=bool)
        for bridge in self.bridges.get(channel, ()):
            for a, b in stretches_of(~bridge.given):
                out[a:b] |= (b - a + 1) * self.dt > longest * (1 + 1e-9)
        return out

    def torn(self, channel: str) -> np.ndarray:
        """Return the rows of holes in which a channel jumped, nobody knows when."""
        return np.logical_or.reduce([np.zeros(len(self.time), dtype=bool), *(b.torn for b in self.bridges[channel])])


def stretches(trajectory: str, time: np.ndarray, columns: dict[str, np.ndarray]) -> Iterator[Stretch]:
    """Cut a run where nothing is known for too long, and bring each part to equal steps."""
    at = np.flatnonzero(np.isfinite(columns["q"][:, 0]))
    if len(at) < 2:
        return
    longest = max(BRIDGED, _SLOWEST * _period(np.diff(time)))
    cuts = np.flatnonzero(np.diff(time[at]) > longest * (1 + 1e-9)) + 1
    for part in np.split(at, cuts):
        if len(part) > 1:
            rows = slice(int(part[0]), int(part[-1]) + 1)
            yield _even(trajectory, time[rows], {name: x[rows] for name, x in columns.items()})


def _even(trajectory: str, time: np.ndarray, columns: dict[str, np.ndarray]) -> Stretch:
    dt, rows = _clock(time, columns["q"][:, 0])
    if rows is None and all(np.isfinite(x).all() for x in columns.values()):
        return Stretch(trajectory, time, dt, columns)
    rows = np.arange(len(time), dtype=float) if rows is None else rows
    n_rows = int(np.floor(rows[-1] + 1e-9)) + 1
    even = np.interp(np.arange(n_rows), rows, time)
    out = Stretch(trajectory, even, dt, {})
    for name, x in columns.items():
        finite = np.isfinite(x)
        if np.any(finite.sum(axis=0) < 2):
            continue  # not read here: as if the log had no such channel
        if finite.all() and len(rows) == n_rows and not np.any(rows != np.arange(n_rows)):
            out.readings[name] = x
            continue
        bridged = [_bridge(rows[f], x[f, k], n_rows, name, out.n) for k, f in enumerate(finite.T)]
        out.readings[name] = np.column_stack([values for values, _ in bridged])
        out.bridges[name] = [bridge for _, bridge in bridged]
    return out


def pool_noise(found: Sequence[Stretch]) -> None:
    """Give short stretches, which show their noise within a tenth at best, the noise of all stretches together."""
    for channel in {name for stretch in found for name in stretch.noises}:
        own = [stretch for stretch in found if channel in stretch.noises]
        rows = np.array([len(stretch.time) for stretch in own], dtype=float)
        for k in range(len(own[0].noises[channel])):
            variances = np.array([stretch.noises[channel][k].white ** 2 for stretch in own])
            order = np.argsort(variances)
            middle = float(variances[order][np.searchsorted(np.cumsum(rows[order]), rows.sum() / 2)])
            for stretch, variance, share in zip(own, variances, np.minimum(rows / _ENOUGH, 1.0), strict=True):
                if share < 1.0:
                    noise = stretch.noises[channel][k]
                    white = float(np.sqrt(share * variance + (1.0 - share) * middle))
                    stretch.noises[channel][k] = noise._replace(white=white)


# --- clocks -------------------------------------------------------------------------------------------------
def _period(steps: np.ndarray) -> float:
    """Return the sampling interval: the median step, or the unit of which most steps are whole multiples."""
    median = float(np.median(steps))
    if float(steps.max()) <= 1.5 * float(steps.min()):  # nothing is lost
        return median
    small = float(np.quantile(steps, 0.1))
    ratio = steps / small
    whole = np.abs(ratio - np.rint(ratio)) <= JITTER
    return small if median > 1.5 * small and np.mean(whole) > 0.95 else median


def _clock(time: np.ndarray, q: np.ndarray) -> tuple[float, np.ndarray | None]:
    """Return the step of a stretch, s, and the place of each sample in steps; None for one sample a step."""
    steps = np.diff(time)
    dt = _period(steps)
    count = np.maximum(np.rint(steps / dt), 1.0)
    off = float(np.max(np.abs(steps - count * dt))) / dt
    even = np.concatenate([[0.0], np.cumsum(count)])
    if off < 0.01:
        return (dt, None) if even[-1] == len(steps) else (float(np.median(steps / count)), even)
    stated = float(np.mean(steps[steps < 3.0 * dt]))
    if off > JITTER:
        even = np.arange(len(time), dtype=float)
    lag = (time - time[0]) / ((time[-1] - time[0]) / even[-1]) - even
    one_clock = off <= JITTER or float(np.ptp(lag)) < 2.0
    known = np.isfinite(q)
    rough = [roughness(q[known], at[known]) for at in (time / stated, even)]
    if one_clock and (rough[0] >= _BETTER * rough[1] if off <= JITTER else rough[1] < _BETTER * rough[0]):
        dt = dt if off <= JITTER else float(np.polyfit(even, time, 1)[0])
        return dt, None if even[-1] == len(steps) else even
    return stated, (time - time[0]) / stated


# --- columns ------------------------------------------------------------------------------------------------
def _bridge(at: np.ndarray, x: np.ndarray, n_rows: int, channel: str, n: int) -> tuple[np.ndarray, Bridge]:
    """Return a column on equal steps from its samples at places ``at``, in steps."""
    rows = np.arange(n_rows, dtype=float)
    after = np.clip(np.searchsorted(at, rows - 1e-9), 1, len(at) - 1)
    width = at[after] - at[after - 1]
    near = np.where(rows - at[after - 1] <= at[after] - rows, after - 1, after)
    distance = np.abs(at[near] - rows)
    if channel in _JUMPS:
        given = distance <= 0.5
        index, weight = _straight(at, rows, after, hold=channel == "u")
        index[given], weight[given] = near[given, None], np.array([1.0, 0.0])
    else:
        inside = (rows > at[0] - 1e-9) & (rows < at[-1] + 1e-9)
        given = (distance < 1e-9) | ((width < _BRACKET) & inside)
        index, weight = _cubic(at, rows, after)
        far = (width > HALF * n) | ~inside | (len(at) < 4)
        if far.any():
            index[far, :2], line = _straight(at, rows[far], after[far])[0], _straight(at, rows[far], after[far])[1]
            weight[far, :2], weight[far, 2:] = line, 0.0
    values = np.sum(weight * x[index], axis=1)
    pointer = np.arange(0, index.size + 1, index.shape[1])
    mix = csr_array((weight.ravel(), index.ravel(), pointer), shape=(n_rows, len(x)))
    if channel not in _JUMPS:
        return values, Bridge(at, x, given, mix, 0.0, np.zeros(n_rows, dtype=bool))
    hidden, torn = _between(values, given, least=_SEEN if channel == "u" else 0.0)
    return values, Bridge(at, x, given, mix, hidden, torn)


def _straight(at: np.ndarray, rows: np.ndarray, after: np.ndarray, hold: bool = False) -> tuple[np.ndarray, np.ndarray]:
    """Return the two samples about each row and their shares on the line between them; beyond the ends they hold."""
    share = np.clip((rows - at[after - 1]) / (at[after] - at[after - 1]), 0.0, 1.0)
    share = np.floor(share) if hold else share
    return np.column_stack([after - 1, after]), np.column_stack([1.0 - share, share])


def _cubic(at: np.ndarray, rows: np.ndarray, after: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the four samples about each row and their weights in the cubic through them."""
    if len(at) < 4:
        return np.zeros((len(rows), 4), dtype=int), np.zeros((len(rows), 4))
    index = np.clip(after - 2, 0, len(at) - 4)[:, None] + np.arange(4)
    t = at[index]
    weight = np.ones((len(rows), 4))
    for i in range(4):
        for k in range(4):
            if k != i:
                weight[:, i] *= (rows - t[:, k]) / (t[:, i] - t[:, k])
    return index, weight


def _between(x: np.ndarray, given: np.ndarray, least: float) -> tuple[float, np.ndarray]:
    """Return how far a signal leaves its line between samples, noise included, and the holes in which it jumped."""
    torn = np.zeros(len(x), dtype=bool)
    if len(x) < 5:
        return 0.0, torn
    three = given[:-2] & given[1:-1] & given[2:]
    if not three.any():
        return 0.0, torn
    bends = np.abs(x[1:-1] - (x[:-2] + x[2:]) / 2)[three] / np.sqrt(1.5)
    bend = 1.4826 * float(np.median(bends))
    # Most samples of a signal at rest say nothing.
    most = max(_JUMP * max(bend, float(np.quantile(bends, 0.9)) / 1.645), least)
    for a, b in stretches_of(~given):
        if a < 2 or b > len(x) - 2 or not (given[a - 2] and given[b + 1]):
            torn[a:b] = bool(a > 0 and b < len(x) and abs(x[b] - x[a - 1]) > most * (b - a + 1))
            continue
        half = (b - a + 1) / 2
        jump = x[b] - x[a - 1] - half * (x[a - 1] - x[a - 2] + x[b + 1] - x[b])
        torn[a:b] = abs(jump) > most * np.sqrt(2.0 * (1.0 + half) ** 2 + 2.0 * half**2)
    return bend, torn
