"""Means and end-to-end differences over windows of time, which satisfy balances exactly."""

import numpy as np
import pandas as pd

from pamid.errors import ParameterError, ShortTrajectoryError

from ._rows import blocks
from .resampling import require_columns


def windows(log: pd.DataFrame, length: float) -> pd.DataFrame:
    """Take time-means and end-differences of every signal over windows within each run.

    Parameters
    ----------
    log : DataFrame
        Tidy frame with ``trajectory``, ``time`` (s) and signals.
    length : float
        Length of a window, s; windows follow each other and share their border rows. A remainder shorter than half a
        window is left out.

    Returns
    -------
    DataFrame
        Columns ``trajectory``, ``time`` (middle of the window, s), ``duration`` (s), each signal's mean under its own
        name, and ``delta_<signal>``, its value at the end less that at the start.

    Raises
    ------
    ParameterError
        If the length is not positive.
    ShortTrajectoryError
        If a run is shorter than half a window.

    Notes
    -----
    Means are those of the trapezoidal rule: mean · duration is the integral over the window, so that a balance such as
    ∫ ṁ dt = Δm holds over each window and, the differences telescoping, over the run.

    Examples
    --------
    >>> import numpy as np
    >>> import pandas as pd
    >>> from pamid.signals import windows
    >>> t = np.arange(0, 1.001, 0.01)
    >>> w = windows(pd.DataFrame({"trajectory": "a", "time": t, "q": t**2, "dq": 2 * t}), 0.25)
    >>> bool(np.allclose(w["dq"] * w["duration"], w["delta_q"])), len(w)
    (True, 4)
    """
    require_columns(log, ["trajectory", "time"])
    if not np.isfinite(length) or length <= 0:
        raise ParameterError(f"length is {length}.", "a positive time in s", "Correct it.")
    signals = [c for c in log.columns if c not in ("trajectory", "time") and pd.api.types.is_numeric_dtype(log[c])]
    time = log["time"].to_numpy(dtype=float)
    values = log[signals].to_numpy(dtype=float)
    parts = []
    for name, rows in blocks(log["trajectory"].to_numpy(dtype=object)):
        t, y = time[rows], values[rows]
        count = int(np.floor((t[-1] - t[0]) / length + 0.5 + 1e-9))
        borders = t[0] + length * np.arange(count + 1)
        borders[-1] = min(borders[-1], t[-1])
        edges = np.unique(_nearest(t, borders)) if count else np.zeros(1, int)
        if len(edges) < 2:
            raise ShortTrajectoryError(
                f"Run '{name}' lasts {t[-1] - t[0]:.4g} s in {len(t)} rows.",
                f"at least half a window of {length:.4g} s",
                "Choose shorter windows, or leave it out.",
            )
        steps = np.diff(t)[:, None]
        integral = np.add.reduceat(0.5 * (y[1:] + y[:-1]) * steps, edges[:-1], axis=0)
        if edges[-1] < len(t) - 1:
            integral[-1] -= (0.5 * (y[edges[-1] + 1 :] + y[edges[-1] : -1]) * steps[edges[-1] :]).sum(axis=0)
        duration = np.diff(t[edges])
        part = pd.DataFrame(integral / duration[:, None], columns=signals)
        part.insert(0, "trajectory", name)
        part.insert(1, "time", 0.5 * (t[edges[1:]] + t[edges[:-1]]))
        part.insert(2, "duration", duration)
        deltas = pd.DataFrame(np.diff(y[edges], axis=0), columns=[f"delta_{s}" for s in signals])
        parts.append(pd.concat([part, deltas], axis=1))
    return pd.concat(parts, ignore_index=True).astype({"trajectory": log["trajectory"].dtype})


def _nearest(t: np.ndarray, borders: np.ndarray) -> np.ndarray:
    right = np.clip(np.searchsorted(t, borders), 1, len(t) - 1)
    return np.where(borders - t[right - 1] <= t[right] - borders, right - 1, right)
