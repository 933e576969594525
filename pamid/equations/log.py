"""A log of the bench, checked once: its runs as stretches that are compared with a simulator."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cached_property

import numpy as np
import pandas as pd

from ..errors import (
    ColumnTypeError,
    EmptyLogError,
    InterleavedTrajectoryError,
    MissingColumnError,
    MissingTrajectoryError,
    NonFiniteError,
    TimeOrderError,
)
from ..signals.frames import as_pandas
from ..signals.stretches import equal_stretches
from ..signals.thinning import whole_trajectories
from .run import MUSCLES, Model, Run
from .stretch import stretches


def columns_of(channel: str) -> list[str]:
    """Return the columns of a log that hold a channel."""
    return [channel] if channel in ("q", "q_ref", "time") else [f"{channel}{m}" for m in MUSCLES]


class BenchLog:
    """A log of the bench, checked once: its runs, their times and its channels.

    Evaluation, refit, diagnosis and survey all read this object; each makes one of a table that it is given.

    Parameters
    ----------
    table : DataFrame
        The log, SI units, absolute pressures.

    Examples
    --------
    >>> from pamid.bench import BenchParameters, simulate, sine
    >>> from pamid.equations import BenchLog
    >>> log = BenchLog.of(simulate(BenchParameters.for_muscle("B"), [sine(4, 15, 400), sine(6, 15, 400)]))
    >>> [name for name, rows in log.trajectories], log.holds("P")
    (['sine-4-15', 'sine-6-15'], True)
    """

    def __init__(self, table: pd.DataFrame) -> None:
        self.table = table
        self._held: dict[str, bool] = {}
        self._views: dict[str, np.ndarray | None] = {}

    @classmethod
    def of(cls, log: pd.DataFrame | BenchLog) -> BenchLog:
        """Return a log as a `BenchLog`; one that is already is returned as it is."""
        return log if isinstance(log, BenchLog) else cls(as_pandas(log))

    def __len__(self) -> int:
        return len(self.table)

    @cached_property
    def trajectories(self) -> list[tuple[str, slice]]:
        """Name and rows of each run, in order; raise where runs are not named, are mixed, or do not exist."""
        log = self.table
        if "trajectory" not in log.columns:
            raise MissingTrajectoryError(
                f"The log has no column 'trajectory'; it has {', '.join(map(str, log.columns[:20]))}.",
                "the name of its run in each row",
                "Add the column, or map one of yours to it.",
            )
        if not len(log):
            raise EmptyLogError("The log has no rows.", "at least one run", "Check how the log was written.")
        codes, names = pd.factorize(log["trajectory"], use_na_sentinel=False)
        runs = equal_stretches(codes)
        if len(runs) != len(names):
            raise InterleavedTrajectoryError(
                f"The log has {len(names)} runs in {len(runs)} separate blocks of rows.",
                "the rows of each run together and in time order",
                "Sort the log by run and time; give repeats separate names.",
            )
        return [(str(names[codes[a]]), slice(a, b)) for a, b in runs]

    @cached_property
    def times(self) -> list[np.ndarray]:
        """The times of each run, s; one that is missing, or does not increase, raises."""
        return [_checked_time(self.numbers("time", rows), name) for name, rows in self.trajectories]

    def numbers(self, column: str, rows: slice = slice(None)) -> np.ndarray:
        """Return rows of a column as numbers, NaN where nothing was measured."""
        if column not in self._views:
            whole = self.table[column]
            plain = isinstance(whole.dtype, np.dtype) and whole.dtype.kind == "f"
            self._views[column] = whole.to_numpy() if plain else None
        if (view := self._views[column]) is not None:
            return np.asarray(view[rows], dtype=float)
        series = self.table[column].iloc[rows]
        try:
            return series.to_numpy(dtype=float, na_value=np.nan)
        except (TypeError, ValueError):
            bad = next((v for v in series if isinstance(v, str) or not np.isscalar(v)), "?")
            raise ColumnTypeError(
                f"The column '{column}' holds {str(bad)[:30]!r}.",
                "numbers",
                "Remove or convert the entries that are text.",
            ) from None

    def holds(self, channel: str) -> bool:
        """Return whether the log has all columns of a channel, each with a reading."""
        return all(self.reads(column) for column in columns_of(channel))

    def reads(self, column: str) -> bool:
        """Return whether the log has a column with a reading."""
        if column not in self._held:
            self._held[column] = column in self.table.columns and not bool(self.table[column].isna().all())
        return self._held[column]

    def whole(self, most: int) -> BenchLog:
        """Return whole runs spread evenly over the log, up to so many rows; itself if it is short enough."""
        if len(self) <= most:
            return self
        return BenchLog(whole_trajectories(self.table, most, [rows for _, rows in self.trajectories]))

    def read_as(self, readings: Mapping[str, np.ndarray | pd.Series]) -> BenchLog:
        """Return the log with other readings of some channels, its runs and times as they are."""
        other = BenchLog(self.table.assign(**readings))
        other.trajectories, other.times = self.trajectories, self.times
        return other

    def runs(self, model: Model, channels: list[str]) -> Iterator[Run]:
        """Yield the stretches of a log, in order, one run at a time.

        A stretch ends where a run ends and where angle or time are missing for longer than windows can bridge. Shorter
        holes, uneven times and missing readings of other channels are bridged, see `pamid.equations.stretch`. Channels
        are of ``P``, ``F``, ``mdot``, ``u``; ``q`` is always read. A stretch that lacks one of them comes without it.
        """
        needed = ["time", *columns_of("q"), *(c for name in channels for c in columns_of(name))]
        if missing := [c for c in needed if c not in self.table.columns]:
            raise MissingColumnError(
                f"The log lacks {', '.join(missing)}.",
                f"the columns {', '.join(needed)}",
                f"Map your columns to these names; the log has {', '.join(map(str, self.table.columns[:20]))}.",
            )
        for (name, rows), time in zip(self.trajectories, self.times, strict=True):
            data = {c: self.numbers(c, rows) for c in needed[1:]}
            if column := next((c for c, v in data.items() if np.isinf(v).any()), None):
                raise NonFiniteError(
                    f"The column '{column}' of run '{name}' holds infinite values.",
                    "finite numbers, or NaN where nothing was measured",
                    "Remove those rows or set them to NaN.",
                )
            columns = {c: np.column_stack([data[k] for k in columns_of(c)]) for c in ("q", *channels)}
            for stretch in stretches(name, time, columns):
                yield Run(stretch, model)


def _checked_time(time: np.ndarray, name: str) -> np.ndarray:
    """Return the times of a run; raise where one is missing or does not increase."""
    if not np.isfinite(time).all():
        raise NonFiniteError(f"The time of run '{name}' holds NaN.", "a time in each row", "Remove those rows.")
    steps = np.diff(time)
    if len(steps) and steps.min() <= 0:
        at = int(np.argmin(steps))
        raise TimeOrderError(
            f"The time of run '{name}' goes from {time[at]:g} s to {time[at + 1]:g} s.",
            "time that increases",
            "Sort the run by time and remove repeated rows; separate runs need separate names.",
        )
    return time
