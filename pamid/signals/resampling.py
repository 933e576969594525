"""Resampling of logs to equal steps, and of logs with different rates to one rate, without aliasing."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd

from pamid.errors import (
    ColumnTypeError,
    DuplicateColumnError,
    MissingColumnError,
    ParameterError,
    ShortTrajectoryError,
    TimeError,
    TrajectoryError,
)

from ._rows import blocks
from .rates import sampling_grid

_PASS = 0.8
_ATTENUATION = 60.0


def resample(log: pd.DataFrame, period: float | None = None, *, hold: Sequence[str] = ()) -> pd.DataFrame:
    """Bring a log to equal steps, each run on its own, with a filter against aliasing where steps grow.

    Parameters
    ----------
    log : DataFrame
        Tidy frame with ``trajectory``, ``time`` (s) and signals.
    period : float, optional
        New time between rows, s; the longest median step of the runs if not given.
    hold : sequence of str, default=()
        Signals that jump between states (``branch``, a switched valve): they keep their last value, unfiltered.

    Returns
    -------
    DataFrame
        The same columns; each run begins at its first time and does not pass its last.

    Raises
    ------
    ParameterError
        If the period is not positive.
    MissingColumnError
        If a column is missing.
    ShortTrajectoryError
        If a run is shorter than the period.

    Notes
    -----
    Where steps grow by more than a tenth, a symmetric Kaiser window filter (60 dB, pass band to 0.8 of the new Nyquist
    frequency) runs on equal steps of the old period; values are then read by cubic interpolation. The signal is
    continued at its ends by point reflection, so that neither level nor slope is bent there.

    Examples
    --------
    >>> import numpy as np
    >>> import pandas as pd
    >>> from pamid.signals import resample
    >>> t = np.arange(0, 1, 1e-3)
    >>> log = pd.DataFrame({"trajectory": "a", "time": t, "q": np.sin(2 * np.pi * t) + np.sin(2 * np.pi * 90 * t)})
    >>> slow = resample(log, 0.02)
    >>> len(slow), bool(np.abs(slow["q"] - np.sin(2 * np.pi * slow["time"]))[5:-5].max() < 0.01)
    (50, True)
    """
    require_columns(log, ["trajectory", "time", *hold])
    if period is None:
        period = _longest_period([log])
    if not np.isfinite(period) or period <= 0:
        raise ParameterError(f"period is {period}.", "a positive time in s", "Correct it.")
    parts = []
    for name, rows in blocks(log["trajectory"].to_numpy(dtype=object)):
        t = log["time"].to_numpy(dtype=float)[rows]
        sampling_grid(t, warn=False)  # words the errors of times that do not increase
        new = _steps(t[0], t[-1], period)
        if len(t) < 2 or len(new) < 2:
            raise ShortTrajectoryError(
                f"Run '{name}' lasts {t[-1] - t[0]:.4g} s.", f"at least one period of {period:.4g} s", "Drop it."
            )
        parts.append(_carried([log.iloc[rows]], name, new, period, hold))
    result = pd.concat(parts, ignore_index=True)
    return result.astype({"trajectory": log["trajectory"].dtype})[list(log.columns)]


def _longest_period(logs: Sequence[pd.DataFrame]) -> float:
    return max(
        sampling_grid(log["time"].to_numpy(dtype=float)[rows], warn=False).period
        for log in logs
        for _, rows in blocks(log["trajectory"].to_numpy(dtype=object))
    )


def _steps(start: float, stop: float, period: float) -> np.ndarray:
    return start + period * np.arange(int(np.floor((stop - start) / period * (1 + 1e-9))) + 1)


def _carried(
    runs: Sequence[pd.DataFrame], name: Any, new: np.ndarray, period: float, hold: Sequence[str]
) -> pd.DataFrame:
    """Return the signals of a run, from one log or several, at new times."""
    columns: dict[str, object] = {"trajectory": np.repeat(name, len(new)), "time": new}
    for run in runs:
        t = run["time"].to_numpy(dtype=float)
        for signal in run.columns.drop(["trajectory", "time"]):
            columns[signal] = _carry(run[signal], t, new, period, hold=signal in hold)
    return pd.DataFrame(columns)


def _carry(column: pd.Series, t: np.ndarray, new: np.ndarray, period: float, *, hold: bool) -> np.ndarray:
    last = np.clip(np.searchsorted(t, new + 1e-9 * period, side="right") - 1, 0, len(t) - 1)
    if hold:
        return column.to_numpy()[last]
    if not pd.api.types.is_numeric_dtype(column):
        raise ColumnTypeError(f"{column.name} holds text.", "numbers", f"Name it in hold=['{column.name}'].")
    y = column.to_numpy(dtype=float)
    grid = sampling_grid(t, warn=False)
    if period > 1.1 * grid.period:
        return _decimate(y, t, new, grid.period, period)
    return _cubic(y, t, new)


def _cubic(y: np.ndarray, t: np.ndarray, new: np.ndarray) -> np.ndarray:
    from scipy.interpolate import PchipInterpolator

    # The monotone cubic does not overshoot at steps, as a spline would.
    return PchipInterpolator(t, y)(new) if len(t) > 2 else np.interp(new, t, y)


def _decimate(y: np.ndarray, t: np.ndarray, new: np.ndarray, old: float, period: float) -> np.ndarray:
    from scipy.signal import firwin, kaiserord, oaconvolve

    steps = max(round((t[-1] - t[0]) / old), 2)
    grid = np.linspace(t[0], t[-1], steps + 1)
    y = np.interp(grid, t, y)
    ratio = (grid[1] - grid[0]) / period
    taps, beta = kaiserord(_ATTENUATION, (1.0 - _PASS) * ratio)
    half = min(taps // 2, len(y) - 1)
    kernel = firwin(2 * half + 1, (1.0 + _PASS) / 2.0 * ratio, window=("kaiser", beta))
    continued = np.concatenate([2 * y[0] - y[half:0:-1], y, 2 * y[-1] - y[-2 : -half - 2 : -1]])
    return _cubic(oaconvolve(continued, kernel, mode="valid"), grid, new)


def merge_rates(logs: Sequence[pd.DataFrame], period: float | None = None, *, hold: Sequence[str] = ()) -> pd.DataFrame:
    """Join logs of the same runs that were recorded at different rates.

    Parameters
    ----------
    logs : sequence of DataFrame
        Tidy frames, each with ``trajectory``, ``time`` (s, on one clock) and other signals.
    period : float, optional
        Time between rows of the result, s; that of the slowest log if not given.
    hold : sequence of str, default=()
        Signals that keep their last value, see `resample`.

    Returns
    -------
    DataFrame
        One frame over the time that all logs of a run share.

    Raises
    ------
    DuplicateColumnError
        If two logs hold the same signal.
    TrajectoryError
        If the logs hold different runs.
    TimeError
        If the logs of a run share no time.

    Examples
    --------
    >>> import numpy as np
    >>> import pandas as pd
    >>> from pamid.signals import merge_rates
    >>> fast, slow = np.arange(0, 1, 1e-3), np.arange(0.1, 1, 1e-2)
    >>> one = pd.DataFrame({"trajectory": "a", "time": fast, "P": 2e5 + fast})
    >>> two = pd.DataFrame({"trajectory": "a", "time": slow, "q": slow})
    >>> both = merge_rates([one, two])
    >>> list(both.columns), len(both), round(float(both["time"][0]), 3)
    (['trajectory', 'time', 'P', 'q'], 90, 0.1)
    """
    if not len(logs):
        raise ParameterError("No log is given.", "at least one", "Pass the logs to join.")
    seen: set[str] = set()
    for log in logs:
        require_columns(log, ["trajectory", "time"])
        signals = set(log.columns) - {"trajectory", "time"}
        if seen & signals:
            raise DuplicateColumnError(
                f"Two logs hold {', '.join(sorted(seen & signals))}.", "each signal in one log", "Drop or rename it."
            )
        seen |= signals
    names = list(logs[0]["trajectory"].unique())
    for log in logs[1:]:
        if (own := set(log["trajectory"].unique())) != set(names):
            odd = sorted(map(str, own ^ set(names)))
            raise TrajectoryError(
                f"The runs {', '.join(odd[:4])} are not in all logs.", "the same in all", "Leave them out."
            )
    if period is None:
        period = _longest_period(logs)
    parts = []
    for name in names:
        runs = [log[log["trajectory"] == name] for log in logs]
        start = max(float(o["time"].iloc[0]) for o in runs)
        stop = min(float(o["time"].iloc[-1]) for o in runs)
        if stop - start < period:
            raise TimeError(
                f"The logs of '{name}' share {max(stop - start, 0.0):.4g} s.", "times on one clock", "Align the clocks."
            )
        parts.append(_carried(runs, name, _steps(start, stop, period), period, hold))
    return pd.concat(parts, ignore_index=True).astype({"trajectory": logs[0]["trajectory"].dtype})


def require_columns(log: pd.DataFrame, names: Sequence[str]) -> None:
    """Raise if a log lacks some of the columns."""
    missing = [n for n in names if n not in log.columns]
    if missing:
        raise MissingColumnError(
            f"The log has no column {', '.join(missing)}; it has {', '.join(map(str, log.columns))}.",
            "a tidy frame with trajectory and time",
            "Read the log with read_log, or add the column.",
        )
