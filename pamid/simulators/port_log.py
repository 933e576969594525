"""A log at the ports of a simulator: even in time, in the units of the ports, run after run."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..errors import ColumnTypeError, MissingColumnError, ShortTrajectoryError
from ..signals.ends import end_of
from ..signals.formats import is_measured
from ..signals.mapping import LogMapping
from ..signals.stretches import stretches_of
from .absent import meant, notes_of_absent
from .base import Simulator
from .interpolated import Interpolated

if TYPE_CHECKING:
    import pandas as pd

_UNEVEN = 0.02
_AWAY = 0.6
"""Steps from the nearest reading beyond which a row was not read: at uneven times half a step is usual."""
_LEAST = 8


@dataclass(frozen=True)
class PortLog:
    """Signals of a log under the names of ports."""

    channels: Mapping[str, np.ndarray]
    """What was measured, by port. Shape (n,)."""
    t: np.ndarray
    """Time within each run, s. Shape (n,)."""
    starts: np.ndarray
    """First row of each run, shape (n_runs,)."""
    dt: float
    """Sampling interval, s."""
    names: list[str]
    """Names of the runs."""
    gaps: Mapping[str, np.ndarray] = field(default_factory=dict)
    """Rows in which a channel was not read, if any; they are filled by linear interpolation. Shape (n,)."""
    notes: list[str] = field(default_factory=list)
    """Notes for the reader."""
    between: Mapping[str, Interpolated] = field(default_factory=dict)
    """Where the rows of a channel lie between its readings, if any were interpolated."""

    @property
    def n(self) -> int:
        """Number of rows."""
        return len(self.t)

    @property
    def spans(self) -> list[tuple[int, int]]:
        """First row of each run and the one after its last."""
        return list(pairwise([*self.starts.tolist(), self.n]))

    @property
    def usual_seconds(self) -> float:
        """Length of a typical run, s."""
        return float(np.median([b - a for a, b in self.spans])) * self.dt

    @property
    def again(self) -> float:
        """Length of the longest run, s, where there are several; 0 where there is one."""
        return float(np.max(self.t)) if len(self.starts) > 1 else 0.0

    @property
    def run(self) -> np.ndarray:
        """Number of the run of each row."""
        return np.searchsorted(self.starts, np.arange(self.n), side="right") - 1

    @property
    def along(self) -> np.ndarray:
        """How far each row is along the log, from 0 to 1."""
        return np.arange(self.n) / max(self.n - 1, 1)

    @cached_property
    def lost(self) -> np.ndarray:
        """Rows in which something was not read."""
        return np.logical_or.reduce([np.zeros(self.n, dtype=bool), *self.gaps.values()])

    def missed(self, name: str) -> np.ndarray:
        """Return the possible interpolation error of a channel at each row: 0 where it was read."""
        out, gap = np.zeros(self.n), self.gaps.get(name)
        if gap is None:
            return out
        x = self.channels[name]
        run = self.run
        read = ~(gap[:-2] | gap[1:-1] | gap[2:]) & (run[:-2] == run[2:])
        if read.any():
            bends = (x[1:-1] - 0.5 * (x[:-2] + x[2:]))[read]
            out[gap] = float(np.sqrt(np.mean(np.square(bends))))
        return out

    def hidden(self, n: int) -> np.ndarray:
        """Return the lost rows that interpolation cannot replace in windows of n samples."""
        lost = self.lost
        out = np.zeros(len(lost), dtype=bool)
        for a, b in stretches_of(lost):
            out[a:b] = b - a > n // 4
        return out

    def inputs(self, simulator: Simulator) -> np.ndarray:
        """Return the inputs, shape (n_inputs, n); those that were not logged are at their start value."""
        rows = [
            self.channels[p.name] if p.name in self.channels else np.full(self.n, p.begins)
            for p in simulator.ports
            if p.kind == "input"
        ]
        return np.stack(rows) if rows else np.zeros((0, self.n))


def port_log(log: pd.DataFrame, simulator: Simulator) -> PortLog:
    """Return a log at the ports of a simulator."""
    signals = [p for p in simulator.ports if p.kind in ("input", "output", "state")]
    has = ", ".join(map(str, log.columns[:20]))
    wanted = [p for p in signals if p.kind == "input" and (p.column or p.start is None)]
    mute = {p.through for p in simulator.ports if p.through}
    lacking = [p.source for p in wanted if p.source not in log.columns and (p.column or p.name not in mute)]
    if "time" not in log.columns:
        lacking.insert(0, "time")
    there = [p for p in signals if p.source in log.columns]
    columns = [str(c) for c in log.columns]
    if lacking:
        raise MissingColumnError(
            f"The log lacks {', '.join(lacking)}; it has {has}.{meant(lacking, columns, signals)}",
            f"time, and a column for each input: {', '.join(p.source for p in wanted if p.name not in mute) or 'none'}",
            "Name the columns in [ports], or map them ('pamid init' writes both). A constant input needs "
            "none if its port has start = VALUE and no column.",
        )
    # A simulator of whole runs returns its outputs alone: states are where runs begin.
    shown = ("output",) if simulator.form == "run" else ("output", "state")
    if not any(p.kind in shown for p in there):
        unread = [p.source for p in signals if p.kind in shown]
        if not unread:
            raise MissingColumnError(
                f"The simulator has no port for what it returns, of kind {' or '.join(shown)}; the log has {has}.",
                "an output port for each row that a run function returns; its state ports are where runs begin"
                if simulator.form == "run" else "a state or an output that the log has",
                'Add one to [ports]: NAME = { kind = "output", unit = UNIT, column = COLUMN }.',
            )  # fmt: skip
        raise MissingColumnError(
            f"The log holds no {' and no '.join(reversed(shown))} of the simulator; it has {has}."
            f"{meant(unread, columns, signals)}",
            f"at least one of {', '.join(unread[:20])}",
            "Name the columns in [ports], or let 'pamid init LOG --sim MODEL' map them.",
        )
    if "trajectory" in log.columns and is_measured(log["trajectory"], LogMapping()):
        raise ColumnTypeError(
            "The column 'trajectory' of the log is a signal: it has a different number in nearly every row.",
            "the name of each row's run",
            "Rename the column.",
        )
    pieces, notes = _runs(log, [p.source for p in there]), notes_of_absent(columns, signals)
    if not pieces:
        raise ShortTrajectoryError(
            f"No run of the log has {_LEAST} rows.", f"runs of at least {_LEAST} rows", "Record longer runs."
        )
    dt = float(np.median(np.concatenate([np.diff(t) for _, t, _ in pieces])))
    if any(np.max(np.abs(np.diff(t) - dt)) > _UNEVEN * dt for _, t, _ in pieces):
        notes.append(f"The sampling is uneven: rows were interpolated to steps of {dt:.4g} s.")
    even = [_even(t, x, dt) for _, t, x in pieces]
    starts = np.concatenate([[0], np.cumsum([len(run.t) for run in even])[:-1]]).astype(int)
    values, lost = (np.concatenate(one) for one in ([run.x for run in even], [run.lost for run in even]))
    gaps = {p.name: lost[:, k] for k, p in enumerate(there) if lost[:, k].any()}
    channels = {p.name: np.ascontiguousarray(values[:, k]) for k, p in enumerate(there)}
    joined = {p.name: Interpolated.joined([run.between[k] for run in even]) for k, p in enumerate(there)}
    between = {name: rows for name, rows in joined.items() if rows.interpolated}
    t = np.concatenate([run.t for run in even])
    made = PortLog(channels, t, starts, dt, [name for name, *_ in pieces], gaps, notes, between)
    # Others are simulated over stretches, which shows how far the motion goes where a reading ends.
    if simulator.form == "algebraic" or (simulator.form == "ode" and simulator.one_by_one):
        return _without_ends(made, [p.name for p in there if p.kind in ("output", "state")])
    return made


def _without_ends(log: PortLog, readings: list[str]) -> PortLog:
    """Return a log without readings at the one end of the range that sensors reach, with notes."""
    channels, gaps, notes = dict(log.channels), dict(log.gaps), list(log.notes)
    for name in readings:
        if (end := end_of(x := log.channels[name], log.spans)) is not None and end.side:
            rows = x == x[end.rows][0]
            gaps[name] = gaps.get(name, False) | rows
            channels[name] = np.concatenate([_bridged(x[a:b], rows[a:b]) for a, b in log.spans])
            notes.append(
                f"{name} stays at {x[end.rows][0]:.4g}, the limit of its readings, in {100 * rows.mean():.1f} % of the "
                "rows and moves in the others: its sensor saturates. These readings are left out."
            )
    return replace(log, channels=channels, gaps=gaps, notes=notes)


def _runs(log: pd.DataFrame, columns: list[str]) -> list[tuple[str, np.ndarray, np.ndarray]]:
    frames = log.groupby("trajectory", sort=False) if "trajectory" in log.columns else [("run", log)]
    found = []
    for name, run in frames:
        t = run["time"].to_numpy(dtype=float)
        x = run[columns].to_numpy(dtype=float, na_value=np.nan)
        keep = np.isfinite(t) & np.concatenate([[True], np.diff(t) > 0])
        if keep.sum() >= _LEAST and np.isfinite(x[keep]).any(axis=0).all():
            found.append((str(name), t[keep] - t[keep][0], x[keep]))
    return found


class _Even(NamedTuple):
    """A run in even steps without gaps."""

    t: np.ndarray
    x: np.ndarray
    """Its columns, shape (n, n_columns)."""
    lost: np.ndarray
    """Cells that were not read, of the same shape."""
    between: list[Interpolated]
    """Where the rows of each column lie between readings."""


def _even(t: np.ndarray, x: np.ndarray, dt: float) -> _Even:
    """Return a run in even steps without gaps."""
    bad = ~np.isfinite(x).all(axis=1)
    even = np.abs(np.diff(t) - dt).max() <= _UNEVEN * dt
    grid = t if even else np.arange(0.0, t[-1] + 1e-9 * dt, dt)
    if even and not bad.any():
        return _Even(grid, x, np.zeros(x.shape, dtype=bool), [Interpolated.of(t, column, grid) for column in x.T])
    columns, lost, between = [], np.zeros((len(grid), x.shape[1]), dtype=bool), []
    for k in range(x.shape[1]):
        known = np.isfinite(x[:, k])
        columns.append(np.interp(grid, t[known], x[known, k]))
        after = np.clip(np.searchsorted(t[known], grid), 1, int(known.sum()) - 1)
        nearest = np.minimum(np.abs(grid - t[known][after - 1]), np.abs(grid - t[known][after]))
        lost[:, k] = nearest > _AWAY * dt
        between.append(Interpolated.of(t[known], x[known, k], grid))
    return _Even(grid, np.column_stack(columns), lost, between)


def _bridged(x: np.ndarray, lost: np.ndarray) -> np.ndarray:
    """Return a signal of one run with straight lines over lost rows; as it is where all are lost."""
    rows = np.arange(len(x))
    return x if lost.all() else np.interp(rows, rows[~lost], x[~lost])
