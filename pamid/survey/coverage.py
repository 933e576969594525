"""How far a log excites what it records: ranges, speeds, directions, holds, bandwidth."""

from dataclasses import dataclass, field, replace
from typing import Annotated, NamedTuple

import numpy as np
import pandas as pd

from ..explained import explained_fields
from ..signals import differentiate, noise_level, tune_cutoff
from ..signals.stretches import stretches_of
from ..signals.thinning import spaced
from .sampling import Sampling, between_pauses

_STILL = 0.02  # of the largest rate: slower counts as rest
_HELD = 0.02  # of the range over all runs: a run that moves by less is held
_SHUT = 1e-3
_POWER = 0.99
_MOST_RUNS = 60
_MOST_TUNED = 3
_TUNED = 5000  # rows of a run by which the cut-off is chosen


@explained_fields
@dataclass(frozen=True)
class Coverage:
    """What a log excites, in SI.

    Examples
    --------
    >>> from pamid.bench import BenchParameters, simulate, sine
    >>> from pamid.survey.survey import survey
    >>> log = simulate(BenchParameters.for_muscle("B"), [sine(4, 15, 800), sine(8, 10, 800)])
    >>> survey(log).coverage.reversals > 0
    True
    """

    position: Annotated[
        str, "Signals that were analysed; empty where the log has none. Of a bench these are its joint and muscle 1."
    ] = ""
    pressure: Annotated[
        str, "Signals that were analysed; empty where the log has none. Of a bench these are its joint and muscle 1."
    ] = ""
    target: Annotated[
        str, "Signals that were analysed; empty where the log has none. Of a bench these are its joint and muscle 1."
    ] = ""
    position_range: Annotated[float, "Swing between the 0.5 and 99.5 % quantiles."] = float("nan")
    pressure_range: Annotated[float, "Swing between the 0.5 and 99.5 % quantiles."] = float("nan")
    slow: Annotated[float, "Slowest and fastest tenth of the speeds while moving, unit of the position per s."] = float(
        "nan"
    )
    fast: Annotated[float, "Slowest and fastest tenth of the speeds while moving, unit of the position per s."] = float(
        "nan"
    )
    up: Annotated[float, "Shares of the time in which the position grows, falls, stands."] = 0.0
    down: Annotated[float, "Shares of the time in which the position grows, falls, stands."] = 0.0
    still: Annotated[float, "Shares of the time in which the position grows, falls, stands."] = 1.0
    reversals: Annotated[int, "Turns of the position well above its noise."] = 0
    amplitudes: Annotated[int, "Different amplitudes between turns (a factor of 1.5 apart)."] = 0
    correlation: Annotated[float, "Between position and pressure; at ±1 their effects cannot be distinguished."] = (
        float("nan")
    )
    longest_hold: Annotated[float, "Longest stretch with the position standing still, s."] = 0.0
    sealed: Annotated[float, "Time with all valves shut, s; NaN where no command is logged."] = float("nan")
    sealed_levels: Annotated[int, "Different pressures among sealed stretches (0.5 bar apart)."] = 0
    held_pressure_moves: Annotated[float, "Swing of the pressure while the position stands still, Pa."] = 0.0
    bandwidth: Annotated[float, "Frequency below which 99 % of the movement's power lies, Hz."] = float("nan")
    lowest: Annotated[float, "Lowest frequency that the longest run resolves, Hz."] = float("nan")
    command: Annotated[
        tuple[float, float], "Smallest and largest absolute command while a valve is open; NaN without."
    ] = field(default=(float("nan"), float("nan")))


def first_of(log: pd.DataFrame, names: tuple[str, ...]) -> str:
    """Return the first of some columns that a log has and that is not empty."""
    return next((n for n in names if n in log.columns and log[n].notna().any()), "")


def coverage_of(log: pd.DataFrame, sampling: Sampling) -> Coverage:
    """Return the excitation of a tidy log between its pauses."""
    log = between_pauses(log, sampling.period)
    longest = max((float(np.ptp(run["time"])) for _, run in log.groupby("trajectory", sort=False)), default=0.0)
    sampling = replace(sampling, longest=min(sampling.longest, longest))
    position = first_of(log, ("q", "eps", "x"))
    pressure = first_of(log, ("P", "P1", "P2"))
    target = first_of(log, ("F", "F1", "drive", "mdot", "mdot1"))
    found: dict[str, object] = {"position": position, "pressure": pressure, "target": target}
    found["lowest"] = 1.0 / sampling.longest if sampling.longest > 0 else float("nan")
    if pressure:
        found["pressure_range"] = _swing(log[pressure].to_numpy(dtype=float))
    commands = [c for c in ("u", "u1", "u2") if c in log.columns]
    if commands:
        found |= _valves(log, commands, pressure, sampling.period)
    if position and _moves(log, position):
        found |= _motion(log, position, pressure, sampling)
    elif pressure:  # a position at rest in every run is held: only the pressure moves
        found |= _held(log, position, pressure, sampling)
    if position and pressure:
        found["correlation"] = _correlation(log, position, pressure)
    return Coverage(**found)  # type: ignore[arg-type]


def _moves(log: pd.DataFrame, position: str) -> bool:
    """Return whether the position moves within a run; runs held at different places are no movement."""
    whole = _swing(log[position].to_numpy(dtype=float))
    for _, run in log.groupby("trajectory", sort=False):
        values = run[position].dropna().to_numpy(dtype=float)
        if len(values) > 5 and _swing(values) > max(_HELD * whole, 4.0 * noise_level(values)):
            return True
    return False


def _held(log: pd.DataFrame, position: str, pressure: str, sampling: Sampling) -> dict[str, object]:
    """Return the excitation of runs in which the position stands, or is not logged."""
    runs = [run[pressure].dropna().to_numpy(dtype=float) for _, run in log.groupby("trajectory", sort=False)]
    found: dict[str, object] = {"bandwidth": _bandwidth([_spectrum(p, sampling.period) for p in runs if len(p) > 20])}
    if position:
        swings = [_swing(p) for p in runs if len(p)]
        found |= {
            "position_range": _swing(log[position].to_numpy(dtype=float)),
            "longest_hold": sampling.longest,
            "held_pressure_moves": max(swings, default=0.0),
        }
    return found


def _correlation(log: pd.DataFrame, position: str, pressure: str) -> float:
    both = log[[position, pressure]].dropna().to_numpy(dtype=float)
    if len(both) < 3 or not np.all(np.ptp(both, axis=0) > 0):
        return float("nan")
    return float(np.corrcoef(both.T)[0, 1])


def forward(run: pd.DataFrame, name: str) -> pd.DataFrame:
    """Return the rows of a run in which a signal is known and time has gone on."""
    run = run[np.isfinite(run[name].to_numpy(dtype=float))]
    time = run["time"].to_numpy(dtype=float)
    return run[np.diff(np.maximum.accumulate(time), prepend=-np.inf) > 0]


class Smoothed(NamedTuple):
    """A signal of one run, smoothed, with its rate."""

    run: pd.DataFrame
    """Its rows."""
    time: np.ndarray
    raw: np.ndarray
    value: np.ndarray
    rate: np.ndarray
    """Time (s), the signal, the smoothed signal, its rate. Shape (n_samples,)."""


def smoothed(log: pd.DataFrame, name: str) -> list[Smoothed]:
    """Return a signal with its rate, run by run; of many runs some, evenly spread, at the cut-off of a few."""
    runs = [part for _, run in log.groupby("trajectory", sort=False) if len(part := forward(run, name)) > 20]
    runs = runs[spaced(len(runs), _MOST_RUNS, at_most=True)]
    arrays = [(run["time"].to_numpy(dtype=float), run[name].to_numpy(dtype=float)) for run in runs]
    moving = [(t[:_TUNED], x[:_TUNED]) for t, x in arrays if np.ptp(x) > 0]
    moving = moving[spaced(len(moving), _MOST_TUNED, at_most=True)]
    if not moving:
        return [Smoothed(run, t, x, x, np.zeros(len(x))) for run, (t, x) in zip(runs, arrays, strict=True)]
    cutoff = tune_cutoff([x for _, x in moving], [t for t, _ in moving])
    found = []
    for run, (t, x) in zip(runs, arrays, strict=True):
        value, rate = differentiate(x, t, tuning=cutoff, warn=False)[:2]
        found.append(Smoothed(run, t, x, value, rate))
    return found


def _swing(y: np.ndarray) -> float:
    y = y[np.isfinite(y)]
    return float(np.subtract(*np.quantile(y, [0.995, 0.005]))) if len(y) else float("nan")


def _valves(log: pd.DataFrame, commands: list[str], pressure: str, period: float) -> dict[str, object]:
    u = np.abs(log[commands].to_numpy(dtype=float))
    shut = np.all(u < _SHUT, axis=1)
    opened = u[u >= _SHUT]
    levels = 0
    if pressure and shut.any():
        levels = len(np.unique(np.round(log[pressure].to_numpy(dtype=float)[shut] / 5e4)))
    sealed = float(shut.sum() * period)
    edge = (float(np.quantile(opened, 0.02)), float(np.quantile(opened, 0.98))) if len(opened) else (np.nan, np.nan)
    return {"sealed": sealed, "sealed_levels": levels, "command": edge}


def _motion(log: pd.DataFrame, position: str, pressure: str, sampling: Sampling) -> dict[str, object]:
    whole = _swing(log[position].to_numpy(dtype=float))
    smooth = smoothed(log, position)
    if not smooth:
        return {"position_range": whole}
    sizes = [size for one in smooth for size in _turns(one.value, max(0.02 * whole, 4.0 * noise_level(one.raw)))]
    moved = [one.value for one in smooth if _swing(one.value) > 0.1 * whole]  # the others rest but for their noise
    every = np.concatenate([one.rate for one in smooth])
    limit = _STILL * float(np.quantile(np.abs(every), 0.995))
    rests = [(one, a, b) for one in smooth for a, b in stretches_of(np.abs(one.rate) < limit)]
    held = [one.run[pressure].to_numpy(dtype=float)[a:b] for one, a, b in rests if pressure and b - a > 20]
    moving = np.abs(every[np.abs(every) >= limit])
    slow, fast = np.quantile(moving, [0.1, 0.9]) if len(moving) else (np.nan, np.nan)
    return {
        "position_range": whole,
        "slow": float(slow),
        "fast": float(fast),
        "up": float(np.mean(every >= limit)),
        "down": float(np.mean(every <= -limit)),
        "still": float(np.mean(np.abs(every) < limit)),
        "reversals": len(sizes),
        "amplitudes": _groups(sizes),
        "longest_hold": max([0.0, *(float(one.time[b - 1] - one.time[a]) for one, a, b in rests)]),
        "held_pressure_moves": max([0.0, *map(_swing, held)]),
        "bandwidth": _bandwidth([_spectrum(y, sampling.period) for y in moved]),
    }


def _turns(y: np.ndarray, least: float) -> list[float]:
    """Return the sizes of the movements between turns of at least some size."""
    sizes: list[float] = []
    extreme, last, way = y[0], y[0], 0
    for value in y[spaced(len(y), 20_000)]:
        if way == 0:
            if abs(value - last) > least:
                way, extreme = int(np.sign(value - last)), value
        elif (value - extreme) * way > 0:
            extreme = value
        elif abs(value - extreme) > least:
            sizes.append(abs(float(extreme - last)))
            last, extreme, way = extreme, value, -way
    return sizes


def _groups(sizes: list[float]) -> int:
    """Return how many amplitudes a factor of 1.5 apart there are."""
    count, edge = 0, 0.0
    for size in sorted(sizes):
        if size > 1.5 * edge:
            count, edge = count + 1, size
    return count


def _spectrum(y: np.ndarray, period: float) -> tuple[np.ndarray, np.ndarray]:
    power = np.square(np.abs(np.fft.rfft((y - y.mean()) * np.hanning(len(y)))))
    return np.fft.rfftfreq(len(y), period), power


def _bandwidth(powers: list[tuple[np.ndarray, np.ndarray]]) -> float:
    found = []
    for frequency, power in powers:
        total = np.cumsum(power)
        if total[-1] > 0:
            found.append(float(frequency[np.searchsorted(total, _POWER * total[-1])]))
    return max(found) if found else float("nan")
