"""MCAP, the container of ROS 2 and Foxglove: topics with JSON messages, or CDR messages of ROS 2."""

import json
from pathlib import Path
from typing import Any

import pandas as pd

from pamid.errors import MissingDependencyError, needs

from ..mapping import LogMapping
from . import Format, RawTable
from ._foreign import foreign_reader, require_all
from ._topics import Messages, joined

_MARK = b"\x89MCAP0\r\n"
_WHOLE = "a complete MCAP file of JSON or ROS 2 messages"


def read(path: Path, mapping: LogMapping, max_bytes: int) -> tuple[list[RawTable], pd.DataFrame | None]:
    """Read all topics as one table: columns ``/topic.field``, times at which messages were logged."""
    with needs("mcap", "robot"):
        from mcap.reader import make_reader
    found, count = Messages(), 0
    with foreign_reader(path, _WHOLE), path.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        summary = reader.get_summary()
        for schema, channel, message in reader.iter_messages():
            found.add(channel.topic, message.log_time, _decoded(channel.message_encoding, schema, message.data))
            count += 1
        said = summary.statistics.message_count if summary is not None and summary.statistics is not None else None
        require_all(path, count, said, _WHOLE)
    return [joined(found.topics(), mapping, path, max_bytes)], None


def _decoders() -> list[Any]:
    """Return the decoder of ROS 2 messages, if installed."""
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


FORMAT = Format("MCAP", (".mcap",), lambda head: head.startswith(_MARK), read)
