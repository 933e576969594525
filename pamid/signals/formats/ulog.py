"""ULog, the log of PX4 flight controllers: topics with fields, times in microseconds."""

import struct
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from pamid.errors import needs

from ..mapping import LogMapping
from . import Format, RawTable
from ._foreign import foreign_reader
from ._topics import joined

_MARK = b"ULog\x01\x12\x35"
_HEADER = 16
_KINDS = frozenset(bytes([k]) for k in b"BFIMPQARDLCSO")


def read(path: Path, mapping: LogMapping, max_bytes: int) -> tuple[list[RawTable], pd.DataFrame | None]:
    """Read all topics as one table; of several instances of a topic the later ones are ``topic_1``, ``topic_2``."""
    with needs("pyulog", "robot"):
        from pyulog import ULog
    topics = {}
    with foreign_reader(path, "a complete ULog"):
        log = ULog(str(path))
        for data in log.data_list:
            times = np.asarray(data.data["timestamp"], dtype=float) * 1e-6
            fields = {k: np.asarray(v, dtype=float) for k, v in data.data.items() if k != "timestamp"}
            topics[f"{data.name}_{data.multi_id}" if data.multi_id else data.name] = times, fields
    table = joined(topics, mapping, path, max_bytes)
    read = sum(len(times) for times, _ in topics.values())
    return [replace(table, lost=(*_lost(path, log, read), *table.lost))], None


def _lost(path: Path, log: Any, read: int) -> list[str]:
    """Describe the losses of a ULog: messages after a cut, damaged ones, and those dropped by its recorder."""
    data, ends, told = _messages(path)
    said = []
    if not ends:
        said.append("its last message is cut off, and what followed is lost (copy the log again)")
    if log.file_corruption or told or data != read:
        count = f"{data - read} of {data} data messages" if data > read else "some messages"
        said.append(f"{count} are damaged and left out")
    if log.dropouts:
        lost = sum(float(d.duration) for d in log.dropouts)
        said.append(f"its recorder dropped messages {len(log.dropouts)} times, for {lost:.0f} ms in all")
    return said


def _messages(path: Path) -> tuple[int, bool, bool]:
    """Count the data messages of a ULog; return whether the last one is complete and whether a kind is unknown."""
    count, odd, size = 0, False, path.stat().st_size
    with path.open("rb") as stream:
        at = stream.seek(_HEADER)
        while len(head := stream.read(3)) == 3:
            length, kind = struct.unpack("<Hc", head)
            count += kind == b"D"
            odd |= kind not in _KINDS
            at = stream.seek(length, 1)
    return count, not head and at == size, odd


FORMAT = Format("ULog", (".ulg", ".ulog"), lambda head: head.startswith(_MARK), read)
