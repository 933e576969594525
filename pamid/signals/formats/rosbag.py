"""Rosbag, the logs of ROS 1 (``.bag``) and ROS 2 (``.db3`` beside its ``metadata.yaml``), read without ROS."""

from __future__ import annotations

import sqlite3
import struct
from pathlib import Path
from typing import TYPE_CHECKING

from pamid.errors import LogFormatError, MissingDependencyError, TruncatedLogError

from . import Format, RawTable
from ._topics import Messages, joined

if TYPE_CHECKING:
    import pandas as pd

    from ..mapping import LogMapping

_MARKS = b"#ROSBAG V2.0", b"SQLite format 3\0"


def read(path: Path, mapping: LogMapping, max_bytes: int) -> tuple[list[RawTable], pd.DataFrame | None]:
    """Read all topics as one table: columns ``/topic.field``, times those at which messages were recorded.

    Of ROS 2 a recording is a folder: its ``.db3`` stands for all of it.
    """
    try:
        from rosbags.highlevel import AnyReader, AnyReaderError
        from rosbags.typesys import Stores, TypesysError, get_typestore
    except ImportError:
        raise MissingDependencyError(
            "rosbags is not installed.", "the package rosbags", "Install it: pip install 'pamid[robot]'."
        ) from None
    two = path.suffix.lower() != ".bag"
    if two and not (path.parent / "metadata.yaml").is_file():
        raise LogFormatError(
            f"{path.name} is a database, and there is no metadata.yaml beside it.",
            "the whole folder of a recording of ROS 2",
            "Copy the folder, and name its .db3.",
        )
    found = Messages()
    try:
        # Bags of ROS 2 before Iron do not say what their messages hold: those of the common packages are known.
        with AnyReader([path.parent if two else path], default_typestore=get_typestore(Stores.LATEST)) as reader:
            for connection, stamp, data in reader.messages():
                found.add(connection.topic, stamp, reader.deserialize(data, connection.msgtype))
    except (
        AnyReaderError, TypesysError, sqlite3.Error, struct.error, ValueError, TypeError, KeyError, IndexError, OSError,
        EOFError, AssertionError, RecursionError, MemoryError,
    ) as error:  # fmt: skip
        raise TruncatedLogError(
            f"{path.name} is damaged or cut off: {type(error).__name__}: {str(error)[:120]}.",
            "a whole recording with messages of known types",
            "Copy the log again.",
        ) from None
    return [joined(found.topics(), mapping, path, max_bytes)], None


FORMAT = Format("rosbag", (".bag", ".db3"), lambda head: head.startswith(_MARKS), read)
