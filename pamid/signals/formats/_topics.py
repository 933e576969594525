"""From the messages of a robot's topics, each at times of its own, to one table."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pamid.errors import EmptyLogError, HostileLogError

from . import RawTable

if TYPE_CHECKING:
    from ..mapping import LogMapping

_DEEPEST, _LONGEST = 6, 64
"""Fields within fields, and numbers of one list, that become columns."""
Topic = tuple[np.ndarray, Mapping[str, np.ndarray]]
"""Times, s, shape (n,), and the fields at them, each of shape (n,)."""


class Messages:
    """Messages of topics, as they are read one after the other."""

    def __init__(self) -> None:
        self._first: int | None = None
        self._times: dict[str, list[float]] = {}
        self._rows: dict[str, list[dict[str, float]]] = {}

    def add(self, topic: str, stamp: int, said: Any) -> None:
        """Add a message.

        Parameters
        ----------
        topic : str
            Its topic.
        stamp : int
            When it was logged, ns.
        said : object
            What it says: fields by name or as attributes.
        """
        self._first = stamp if self._first is None else self._first
        self._times.setdefault(topic, []).append((stamp - self._first) * 1e-9)
        self._rows.setdefault(topic, []).append(dict(_numbers(said, "", 0)))

    def topics(self) -> dict[str, Topic]:
        """Return the numbers of each topic, missing where a message has none."""
        out: dict[str, Topic] = {}
        for name, rows in self._rows.items():
            fields = dict.fromkeys(k for row in rows for k in row)
            columns = {k: np.array([row.get(k, np.nan) for row in rows]) for k in fields}
            out[name] = np.array(self._times[name]), columns
        return out


def joined(topics: Mapping[str, Topic], mapping: LogMapping, path: Path, max_bytes: int) -> RawTable:
    """Return topics as one table in steps of the one with most messages: ``time`` (s) and columns ``topic.field``.

    Numbers of other topics are interpolated between their messages, and missing before the first and after the last;
    rows at which a topic that the mapping names has none are left out.

    Parameters
    ----------
    topics : mapping of str to (array, mapping)
        Times and fields of each topic.
    mapping : LogMapping
        Names the columns that are wanted.
    path : Path
        The file, for messages.
    max_bytes : int
        Largest table.

    Returns
    -------
    RawTable
        The table; times count from the first message of all.

    Raises
    ------
    EmptyLogError
        No topic holds a number twice.
    HostileLogError
        The table would be too large.
    """
    import pandas as pd

    kept = {name: topic for name, topic in topics.items() if len(topic[0]) > 1 and topic[1]}
    if not kept:
        raise EmptyLogError(f"{path.name} holds no topic with numbers.", "messages with numbers", "Record topics.")
    base = max(kept, key=lambda name: len(kept[name][0]))
    t = np.unique(kept[base][0])
    size = 8.0 * len(t) * sum(len(fields) for _, fields in kept.values())
    if size > max_bytes:
        raise HostileLogError(
            f"{path.name} makes a table of {size / 2**30:.3g} GiB.",
            f"at most {max_bytes / 2**30:.3g} GiB",
            "Split the log, or raise max_bytes if the file can be trusted.",
        )
    wanted = {source.column for source in mapping.signals.values()}
    for name, (times, fields) in kept.items():
        if any(_column(name, field) in wanted for field in fields):
            t = t[(t >= np.min(times)) & (t <= np.max(times))]
    first = min(float(times[0]) for times, _ in kept.values())
    columns: dict[str, Any] = {"time": t - first}
    for name, (times, fields) in kept.items():
        order = np.argsort(times, kind="stable")
        for field, values in fields.items():
            known = np.isfinite(values[order])
            if known.any():
                x = np.interp(t, times[order][known], values[order][known], left=np.nan, right=np.nan)
                columns[_column(name, field)] = x
    return RawTable(pd.DataFrame(columns))


def _column(topic: str, field: str) -> str:
    return f"{topic}.{field}" if field else topic


def _numbers(said: Any, name: str, depth: int) -> Iterator[tuple[str, float]]:
    """Yield the numbers of a message with their names: fields by dots, places in lists in brackets."""
    if isinstance(said, (bool, int, float, np.number)):
        yield name, float(said)
    elif depth >= _DEEPEST:
        return
    elif isinstance(said, dict):
        for key, value in said.items():
            yield from _numbers(value, f"{name}.{key}" if name else str(key), depth + 1)
    elif isinstance(said, (list, tuple, np.ndarray)):
        for k, value in enumerate(said[:_LONGEST]):
            yield from _numbers(value, f"{name}[{k}]", depth + 1)
    elif (fields := getattr(said, "__dataclass_fields__", getattr(said, "__slots__", None))) is not None:
        for key in fields:
            if not key.startswith("_"):
                yield from _numbers(getattr(said, key), f"{name}.{key}" if name else key, depth + 1)
