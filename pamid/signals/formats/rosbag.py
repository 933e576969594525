"""Rosbag, the logs of ROS 1 (``.bag``) and ROS 2 (``.db3`` beside its ``metadata.yaml``), read without ROS."""

from pathlib import Path

import pandas as pd

from pamid.errors import LogFormatError, needs

from ..mapping import LogMapping
from . import Format, RawTable
from ._foreign import foreign_reader, require_all
from ._topics import Messages, joined

_MARKS = b"#ROSBAG V2.0", b"SQLite format 3\0"
_WHOLE = "a complete recording with messages of known types"


def read(path: Path, mapping: LogMapping, max_bytes: int) -> tuple[list[RawTable], pd.DataFrame | None]:
    """Read all topics as one table of ``/topic.field``, timed as recorded; a ``.db3`` stands for its ROS 2 folder."""
    with needs("rosbags", "robot"):
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore
    two = path.suffix.lower() != ".bag"
    if two and not (path.parent / "metadata.yaml").is_file():
        raise LogFormatError(
            f"{path.name} is a database without a metadata.yaml beside it.",
            "the whole folder of a recording of ROS 2",
            "Copy the folder, and name its .db3.",
        )
    found, count = Messages(), 0
    with foreign_reader(path, _WHOLE):
        # Bags of ROS 2 before Iron do not say what their messages hold: those of the common packages are known.
        with AnyReader([path.parent if two else path], default_typestore=get_typestore(Stores.LATEST)) as reader:
            said = reader.message_count
            for connection, stamp, data in reader.messages():
                found.add(connection.topic, stamp, reader.deserialize(data, connection.msgtype))
                count += 1
        require_all(path, count, said, _WHOLE)
    return [joined(found.topics(), mapping, path, max_bytes)], None


FORMAT = Format("rosbag", (".bag", ".db3"), lambda head: head.startswith(_MARKS), read)
