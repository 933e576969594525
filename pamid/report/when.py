"""In which run a gap lies, and from when to when, where it is confined to a part of the log."""

import numpy as np

from ..gap.diagnosis.result import Diagnosis
from .quantities import percent, run_named

_MOST = 0.85
"""Share of a gap that makes the part of a log in which it lies worth a sentence."""
_CONCENTRATED = 1.5
"""That part holds at least so many times its share of the windows."""
_FEW = 20  # windows of a run


def when(d: Diagnosis) -> str:
    """Return the sentence on the one run, or the time within it, that holds most of a gap; empty where none does."""
    if not d.trajectories or not d.equations or not len(d.windows):
        return ""
    run, part = d.trajectories[0], d.windows[d.windows["equation"] == d.equations[0].equation]
    mine = (part["trajectory"] == run.trajectory).to_numpy()
    if run.share < _MOST or mine.sum() < _FEW:
        return ""
    one = run.share >= _CONCENTRATED * mine.mean()
    left = (part["before"] - part["after"] if d.added else part["before"]) / part["noise"]
    power = np.square(left.to_numpy()) if d.added else np.maximum(np.square(left.to_numpy()) - 1.0, 0.0)
    begins, ends, long = _shortest(part["time"].to_numpy()[mine], power[mine])
    within = _CONCENTRATED * long <= _MOST
    if not (one or within):
        return ""
    span = f"from {begins:.4g} to {ends:.4g} s"
    if len(d.trajectories) == 1:
        return f" Most of the gap lies {span}."
    then = f", most of it {span}" if within else ""
    return f" Of the gap, {percent(run.share)} lies in {run_named(run.trajectory)}{then}."


def _shortest(time: np.ndarray, power: np.ndarray) -> tuple[float, float, float]:
    """Return begin and end of the shortest time that holds most of a run's power, and its share of the run."""
    order = np.argsort(time, kind="stable")
    t, whole = time[order], np.concatenate([[0.0], np.cumsum(power[order])])
    if whole[-1] <= 0.0 or t[-1] <= t[0]:
        return float(t[0]), float(t[-1]), 1.0
    last = np.searchsorted(whole, whole[:-1] + _MOST * whole[-1])
    first = np.flatnonzero(last < len(whole))
    k = first[np.argmin(t[last[first] - 1] - t[first])]
    return float(t[k]), float(t[last[k] - 1]), float((t[last[k] - 1] - t[k]) / (t[-1] - t[0]))
