"""A log as runs: the stretches of its trajectories, held against a simulator."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from ..errors import (
    ColumnTypeError,
    EmptyLogError,
    InterleavedTrajectoryError,
    MissingColumnError,
    MissingTrajectoryError,
    NonFiniteError,
    TimeOrderError,
)
from .run import MUSCLES, Model, Run
from .stretch import stretches

if TYPE_CHECKING:
    import pandas as pd


def columns_of(channel: str) -> list[str]:
    """Return the columns of a log that hold a channel."""
    return [channel] if channel in ("q", "q_ref", "time") else [f"{channel}{m}" for m in MUSCLES]


def _numbers(log: pd.DataFrame, column: str, rows: slice) -> np.ndarray:
    try:
        return log[column].iloc[rows].to_numpy(dtype=float, na_value=np.nan)
    except (TypeError, ValueError):
        bad = next((v for v in log[column].iloc[rows] if isinstance(v, str) or not np.isscalar(v)), "?")
        raise ColumnTypeError(
            f"The column '{column}' holds {str(bad)[:30]!r}.", "numbers", "Remove or convert the entries that are text."
        ) from None


def trajectory_rows(log: pd.DataFrame) -> list[tuple[str, slice]]:
    """Return name and rows of each trajectory of a log, in its order.

    Raises
    ------
    MissingTrajectoryError, InterleavedTrajectoryError, EmptyLogError
        The log does not name its trajectories, mixes their rows, or has none.
    """
    import pandas as pd

    if "trajectory" not in log.columns:
        raise MissingTrajectoryError(
            f"The log has no column 'trajectory'; it has {', '.join(map(str, log.columns[:20]))}.",
            "the name of its run in each row",
            "Add the column, or map one of yours to it.",
        )
    if not len(log):
        raise EmptyLogError("The log has no rows.", "at least one trajectory", "Check how the log was written.")
    codes, names = pd.factorize(log["trajectory"], use_na_sentinel=False)
    borders = [0, *(np.flatnonzero(np.diff(codes)) + 1).tolist(), len(codes)]
    if len(borders) - 1 != len(names):
        raise InterleavedTrajectoryError(
            f"The log has {len(names)} trajectories in {len(borders) - 1} separate blocks of rows.",
            "the rows of each trajectory together and in time order",
            "Sort the log by trajectory and time; give repeats names of their own.",
        )
    return [(str(names[codes[a]]), slice(a, b)) for a, b in pairwise(borders)]


def runs(log: pd.DataFrame, model: Model, channels: list[str]) -> Iterator[Run]:
    """Cut a log into stretches, one trajectory at a time.

    A stretch ends where a trajectory ends and where angle or time are missing for longer than windows can go over.
    Shorter holes, uneven times and missing readings of other channels are bridged, see `pamid.equations.stretch`.

    Parameters
    ----------
    log : DataFrame
        The log, SI units, absolute pressures.
    model : Model
        The simulator.
    channels : list of str
        The channels to read, of ``P``, ``F``, ``mdot``, ``u``; ``q`` is always read. A stretch that lacks one of them
        comes without it.

    Yields
    ------
    Run
        The stretches in order.
    """
    needed = ["time", *columns_of("q"), *(c for name in channels for c in columns_of(name))]
    if missing := [c for c in needed if c not in log.columns]:
        raise MissingColumnError(
            f"The log lacks {', '.join(missing)}.",
            f"the columns {', '.join(needed)}",
            f"Map your columns to these names; the log has {', '.join(map(str, log.columns[:20]))}.",
        )
    for name, rows in trajectory_rows(log):
        time = _numbers(log, "time", rows)
        data = {c: _numbers(log, c, rows) for c in needed[1:]}
        if column := next((c for c, v in data.items() if np.isinf(v).any()), None):
            raise NonFiniteError(
                f"The column '{column}' of trajectory '{name}' holds infinite values.",
                "finite numbers, or NaN where nothing was measured",
                "Remove those rows or set them to NaN.",
            )
        if not np.isfinite(time).all():
            raise NonFiniteError(
                f"The time of trajectory '{name}' holds NaN.", "a time in each row", "Remove those rows."
            )
        steps = np.diff(time)
        if len(steps) and steps.min() <= 0:
            at = int(np.argmin(steps))
            raise TimeOrderError(
                f"The time of trajectory '{name}' goes from {time[at]:g} s to {time[at + 1]:g} s.",
                "time that increases",
                "Sort the trajectory by time and remove repeated rows; runs of their own need names of their own.",
            )
        columns = {c: np.column_stack([data[k] for k in columns_of(c)]) for c in ("q", *channels)}
        for stretch in stretches(name, time, columns):
            yield Run(stretch, model)
