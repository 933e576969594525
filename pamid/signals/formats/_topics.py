"""From the messages of a robot's topics, each with its own times, to one table."""

import re
from collections.abc import Collection, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from pamid.errors import EmptyLogError, HostileLogError

from ..mapping import LogMapping
from . import RawTable
from ._lists import LONGEST

_NUMBERED = re.compile(r"^(.*)\[(\d+)\]$")
_DEEPEST = 6
"""Fields within fields that become columns."""
Topic = tuple[np.ndarray, Mapping[str, np.ndarray]]
"""Times, s, shape (n,), and the fields at them, each of shape (n,)."""


class Messages:
    """Messages of topics, collected while reading."""

    def __init__(self) -> None:
        self._first: int | None = None
        self._times: dict[str, list[float]] = {}
        self._rows: dict[str, list[dict[str, float]]] = {}

    def add(self, topic: str, stamp: int, said: Any) -> None:
        """Add a message."""
        self._first = stamp if self._first is None else self._first
        self._times.setdefault(topic, []).append((stamp - self._first) * 1e-9)
        self._rows.setdefault(topic, []).append(dict(_numbers(said, "", 0)))

    def topics(self) -> dict[str, Topic]:
        """Return the numbers of each topic; NaN where a message has none."""
        out: dict[str, Topic] = {}
        for name, rows in self._rows.items():
            fields = dict.fromkeys(k for row in rows for k in row)
            columns = {k: np.array([row.get(k, np.nan) for row in rows]) for k in fields}
            out[name] = np.array(self._times[name]), columns
        return out


def joined(topics: Mapping[str, Topic], mapping: LogMapping, path: Path, max_bytes: int) -> RawTable:
    """Return topics as one table at the times of the one with most messages: ``time`` (s) and ``topic.field``."""
    kept = {name: topic for name, topic in topics.items() if len(topic[0]) > 1 and topic[1]}
    if not kept:
        raise EmptyLogError(f"{path.name} holds no topic with numbers.", "messages with numbers", "Record topics.")
    base = max(kept, key=lambda name: len(kept[name][0]))
    t = np.unique(kept[base][0])
    lost = list(_out_of_step(kept[base][0], base))
    size = 8.0 * len(t) * sum(len(fields) for _, fields in kept.values())
    if size > max_bytes:
        raise HostileLogError(
            f"{path.name} makes a table of {size / 2**30:.3g} GiB.",
            f"at most {max_bytes / 2**30:.3g} GiB",
            "Split the log, or raise max_bytes if the file can be trusted.",
        )
    wanted = {source.column for source in mapping.signals.values()}
    kept = {name: (times, _as_numbered(name, fields, wanted)) for name, (times, fields) in kept.items()}
    for name, (times, fields) in kept.items():
        if any(_column(name, field) in wanted for field in fields):
            t = t[(t >= np.min(times)) & (t <= np.max(times))]
    first = min(float(times[0]) for times, _ in kept.values())
    columns: dict[str, Any] = {"time": t - first}
    bridged: dict[str, int] = {}
    for name, (times, fields) in kept.items():
        order = np.argsort(times, kind="stable")
        for field, values in fields.items():
            known = np.isfinite(values[order])
            if known.any():
                if not known.all() and (not wanted or _column(name, field) in wanted):
                    bridged[_column(name, field)] = len(known) - int(known.sum())
                x = np.interp(t, times[order][known], values[order][known], left=np.nan, right=np.nan)
                columns[_column(name, field)] = x
    if bridged:
        worst = max(bridged, key=bridged.__getitem__)
        lost.append(
            f"values missing from messages in {len(bridged)} columns, up to {bridged[worst]} of {worst}, are "
            "interpolated linearly"
        )
    return RawTable(pd.DataFrame(columns), lost=tuple(lost))


def _out_of_step(times: np.ndarray, topic: str) -> Iterator[str]:
    """Describe errors in the time stamps of the topic whose messages are the rows."""
    if again := len(times) - len(np.unique(times)):
        yield f"{again} messages of {topic} repeat the time stamp of another one; one for each time stamp is kept"
    if back := int(np.sum(np.diff(times) < 0.0)):
        yield f"the time stamps of {topic} go backwards {back} times; its messages are sorted by them"


def _as_numbered(
    topic: str, fields: Mapping[str, np.ndarray], wanted: Collection[str | int | None]
) -> Mapping[str, np.ndarray]:
    """Return the fields; those of joints also by their index, if a mapping uses that."""
    found = dict(fields)
    for name in wanted:
        match = _NUMBERED.match(str(name).removeprefix(f"{topic}."))
        if match and _column(topic, match[0]) == name and match[0] not in found:
            places = [f for f in fields if f.startswith(f"{match[1]}[")]
            if int(match[2]) < len(places):
                found[match[0]] = fields[places[int(match[2])]]
    return found


def _column(topic: str, field: str) -> str:
    return f"{topic}.{field}" if field else topic


def _numbers(said: Any, name: str, depth: int) -> Iterator[tuple[str, float]]:
    """Yield the numbers of a message with their names: fields after dots, list indices in brackets."""
    if isinstance(said, (bool, int, float, np.number)):
        yield name, float(said)
    elif depth >= _DEEPEST:
        return
    elif isinstance(said, dict):
        called = _joints(said)
        for key, value in said.items():
            yield from _numbers(_by_name(value, called), f"{name}.{key}" if name else str(key), depth + 1)
    elif isinstance(said, _Places):
        for place, value in zip(said.names, said.values, strict=True):
            yield from _numbers(value, f"{name}[{place}]", depth + 1)
    elif isinstance(said, (list, tuple, np.ndarray)):
        for k, value in enumerate(said[:LONGEST]):
            yield from _numbers(value, f"{name}[{k}]", depth + 1)
    elif (fields := getattr(said, "__dataclass_fields__", getattr(said, "__slots__", None))) is not None:
        yield from _numbers({k: getattr(said, k) for k in fields if not k.startswith("_")}, name, depth)


class _Places(NamedTuple):
    """Numbers whose list indices have names, such as joints."""

    names: list[str]
    values: list[Any]


def _joints(said: dict[str, Any]) -> list[str]:
    """Return the names that a message such as JointState gives the elements of its lists, whose order may change."""
    names = said.get("name", said.get("joint_names"))
    listed = isinstance(names, list | tuple) and all(isinstance(n, str) for n in names)
    return [str(n) for n in names] if listed and names and len(set(names)) == len(names) else []


def _by_name(value: Any, names: list[str]) -> Any:
    fits = names and isinstance(value, list | tuple | np.ndarray) and len(value) == len(names) <= LONGEST
    return _Places(names, list(value)) if fits and not any(isinstance(v, str) for v in value) else value
