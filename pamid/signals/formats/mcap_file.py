"""MCAP, the container of ROS 2 and Foxglove: topics whose messages are JSON, or CDR of ROS 2."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pamid.errors import MissingDependencyError, TruncatedLogError

from . import Format, RawTable
from ._topics import joined

if TYPE_CHECKING:
    import pandas as pd

    from ..mapping import LogMapping

_MARK = b"\x89MCAP0\r\n"
_DEEPEST, _LONGEST = 6, 64
"""Fields within fields, and numbers of one list, that become columns."""


def read(path: Path, mapping: LogMapping, max_bytes: int) -> tuple[list[RawTable], pd.DataFrame | None]:
    """Read all topics as one table: columns ``/topic.field``, times those at which messages were logged."""
    try:
        from mcap.exceptions import McapError
        from mcap.reader import make_reader
    except ImportError:
        raise MissingDependencyError(
            "mcap is not installed.", "the package mcap", "Install it: pip install 'pamid[robot]'."
        ) from None
    times: dict[str, list[float]] = {}
    rows: dict[str, list[dict[str, float]]] = {}
    first: int | None = None
    try:
        with path.open("rb") as stream:
            reader = make_reader(stream)
            for schema, channel, message in reader.iter_messages():
                first = message.log_time if first is None else first
                said = _decoded(channel.message_encoding, schema, message.data)
                times.setdefault(channel.topic, []).append((message.log_time - first) * 1e-9)
                rows.setdefault(channel.topic, []).append(dict(_numbers(said, "", 0)))
    except (McapError, ValueError, TypeError, KeyError, OSError, EOFError, RecursionError) as error:
        raise TruncatedLogError(
            f"{path.name} is damaged or cut off: {type(error).__name__}: {str(error)[:120]}.",
            "a whole MCAP file of JSON or ROS 2 messages",
            "Copy the log again.",
        ) from None
    topics = {}
    for name, found in rows.items():
        fields = dict.fromkeys(k for row in found for k in row)
        columns = {k: np.array([row.get(k, np.nan) for row in found]) for k in fields}
        topics[name] = np.array(times[name]), columns
    return [joined(topics, mapping, path, max_bytes)], None


def _decoders() -> list[Any]:
    """Return what decodes messages of ROS 2, where it is installed."""
    try:
        from mcap_ros2.decoder import DecoderFactory
    except ImportError:
        return []
    return [DecoderFactory()]


def _decoded(encoding: str, schema: Any, data: bytes) -> Any:
    if encoding == "json":
        return json.loads(data)
    for factory in _decoders():
        if (decode := factory.decoder_for(encoding, schema)) is not None:
            return decode(data)
    raise MissingDependencyError(
        f"The messages are {encoding!r}.",
        "JSON, or CDR with the package mcap-ros2-support",
        "Install it: pip install 'pamid[robot]'.",
    )


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
    elif hasattr(said, "__slots__"):
        for key in said.__slots__:
            if not key.startswith("_"):
                yield from _numbers(getattr(said, key), f"{name}.{key}" if name else key, depth + 1)


FORMAT = Format("MCAP", (".mcap",), lambda head: head.startswith(_MARK), read)
