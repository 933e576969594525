"""Notes for the reader of a diagnosis, and requirements on a log."""

from __future__ import annotations

import numpy as np

from ...bench.parameters import BenchParameters
from ...equations.allowed import allowed_equations
from ...equations.log import BenchLog, columns_of
from ...equations.unit_doubts import unit_doubts
from ...errors import ExcitationError, MissingColumnError
from ...signals.stretches import stuck_rows
from .bench import Evidence

_STUCK_SECONDS = 0.2  # s: a channel that repeats one reading for longer while the joint moves is stuck or clipped
_MOVED = 0.02  # rad
_RESTING = 0.2  # share of a run's largest speed below which it begins at rest


def check(log: BenchLog, params: BenchParameters, *, moving: bool = True) -> list[str]:
    """Return notes on a log; raise where no effect could be ranked."""
    allowed, skipped = allowed_equations(log)
    if not allowed:
        raise MissingColumnError(
            "The log allows no equation of the bench: " + "; ".join(skipped.values()) + ".",
            "at least the columns of one equation",
            "Log the forces F1, F2 or the flows mdot1, mdot2 as well.",
        )
    if moving and not moves(log):
        swing, rise = _motion(log)
        raise ExcitationError(
            f"Hardly anything moves in the log: the angle changes by {swing:.2g} rad, the pressure by {rise:.2g} Pa.",
            "motion of at least 0.05 rad, or pressures that change by 0.2 bar",
            "Record sines of 1 to 10 rad/s with 10 to 25 degrees, steps, and a hold with both valves shut.",
        )
    notes = unit_doubts(log, params)
    if len(log.trajectories) == 1:
        notes.append("The log has only one run: there are no intervals over runs, and nothing is held out.")
    if not params.tolerance:
        notes.append(
            "The simulator file has no tolerances: its parameters count as exact, and a parameter that is slightly "
            "off shows as a gap. Add a [tolerance] table."
        )
    lost = float(log.table[[c for c in log.table.columns if c != "trajectory"]].isna().any(axis=1).mean())
    if lost:
        notes.append(
            f"{100 * lost:.1f} % of the rows have a missing value: windows average the readings that exist, and are "
            "left out if too few exist."
        )
    notes += [f"Not tested: {why}." for why in skipped.values()]
    return notes


def moves(log: BenchLog) -> bool:
    """Return whether the angle or a pressure moves in any run of a log."""
    swing, rise = _motion(log)
    return swing >= 2e-3 or rise >= 2e3


def _motion(log: BenchLog) -> tuple[float, float]:
    """Return the largest range of the angle (rad) and of a pressure (Pa) within one run."""

    def largest(column: str) -> float:
        runs = (log.table[column].iloc[r].dropna().to_numpy(dtype=float) for _, r in log.trajectories)
        return max((float(np.ptp(v)) for v in runs if len(v)), default=0.0)

    return largest("q"), max((largest(c) for c in columns_of("P") if c in log.table.columns), default=0.0)


def without_stuck(log: BenchLog) -> tuple[BenchLog, list[str]]:
    """Return a log without the readings of sensors that repeat one value while the joint moves, and notes on them."""
    notes: list[str] = []
    changed: dict[str, np.ndarray] = {}
    for channel in ("P", "F", "mdot"):
        for column in columns_of(channel):
            if column not in log.table.columns:
                continue
            x = log.numbers(column)
            stuck = np.zeros(len(x), dtype=bool)
            for (_, r), time in zip(log.trajectories, log.times, strict=True):
                stuck[r] = _stuck(x[r], log.numbers("q", r), time)
            if stuck.any():
                changed[column] = np.where(stuck, np.nan, x)
                notes.append(
                    f"{column} repeats one value while the joint moves in {100 * stuck.mean():.1f} % of the rows: a "
                    "stuck or clipped sensor. Those readings are left out."
                )
    return (log.read_as(changed), notes) if changed else (log, notes)


def _stuck(x: np.ndarray, q: np.ndarray, time: np.ndarray) -> np.ndarray:
    def moves(a: int, b: int) -> bool:
        return bool(time[b - 1] - time[a] > _STUCK_SECONDS and np.ptp(q[a:b]) > _MOVED)

    return stuck_rows(x, moves, longer_than=10)


def notes_on(evidence: Evidence) -> list[str]:
    """Return notes on the windows of a log."""
    notes = ["The noise floor is estimated from the differences between neighbouring samples, not from repeated runs."]
    intervals = sorted({f"{1e3 * run.dt:.3g} ms" for run in evidence.runs})
    if len(intervals) > 1:
        notes.append(f"The log mixes sampling intervals: {', '.join(intervals)}. Each run is compared at its own.")
    rows = sum(len(run.time) for run in evidence.runs)
    unread = sum(
        float(1.0 - b.given.mean()) * len(r.time) for r in evidence.runs for b in r.stretch.bridges.get("q", ())
    )
    if unread:
        notes.append(
            f"{100 * unread / rows:.1f} % of the samples are missing or fall between the log's regular time steps. "
            "Short gaps are bridged, which adds to the noise."
        )
    speeds = [np.abs(run.smooth("q", 1)[:, 0]) for run in evidence.runs]
    moving = sum(bool(v[: max(1, len(v) // 100)].min() > _RESTING * v.max()) for v in speeds if len(v))
    if moving:
        notes.append(
            f"{moving} of {len(speeds)} runs begin in motion. Creep, hysteresis and heat depend on what came before, "
            "which is not in this log: such causes may be reported as unknown. Record runs that begin at rest."
        )
    return notes
