"""ULog, the log of PX4 flight controllers: topics with fields, times in microseconds."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pamid.errors import MissingDependencyError, TruncatedLogError

from . import Format, RawTable
from ._topics import joined

if TYPE_CHECKING:
    import pandas as pd

    from ..mapping import LogMapping

_MARK = b"ULog\x01\x12\x35"


def read(path: Path, mapping: LogMapping, max_bytes: int) -> tuple[list[RawTable], pd.DataFrame | None]:
    """Read all topics as one table; of several instances of a topic the later ones are ``topic_1``, ``topic_2``."""
    try:
        from pyulog import ULog
    except ImportError:
        raise MissingDependencyError(
            "pyulog is not installed.", "the package pyulog", "Install it: pip install 'pamid[robot]'."
        ) from None
    try:
        log = ULog(str(path))
        topics = {}
        for data in log.data_list:
            times = np.asarray(data.data["timestamp"], dtype=float) * 1e-6
            fields = {k: np.asarray(v, dtype=float) for k, v in data.data.items() if k != "timestamp"}
            topics[f"{data.name}_{data.multi_id}" if data.multi_id else data.name] = times, fields
    except (ValueError, TypeError, KeyError, IndexError, OSError, OverflowError, MemoryError) as error:
        raise TruncatedLogError(
            f"{path.name} is damaged or cut off: {type(error).__name__}: {str(error)[:120]}.",
            "a whole ULog",
            "Copy the log again.",
        ) from None
    return [joined(topics, mapping, path, max_bytes)], None


FORMAT = Format("ULog", (".ulg", ".ulog"), lambda head: head.startswith(_MARK), read)
