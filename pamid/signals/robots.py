"""Names of clock and runs in robot logs, whose other columns show which program wrote them."""

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import pandas as pd

from .formats import TRAJECTORY
from .mapping import LogMapping

_SIGNS: tuple[tuple[frozenset[str], dict[str, str]], ...] = (
    (frozenset(("timestamp", "episode_index", "frame_index")), {"timestamp": "time", "episode_index": TRAJECTORY}),
    (frozenset(("timestamp", "actual_q_0")), {"timestamp": "time"}),
)
"""Columns that only LeRobot (s, from the start of each episode) and RTDE (s, since the controller started) write."""
_ABOVE = 4
_MOST = 2**22


def own_clock(columns: Iterable[Any], mapping: LogMapping) -> dict[str, str]:
    """Return the standard names of a robot's clock and runs, by their own names."""
    known = {str(c) for c in columns}
    named = {s.column for s in mapping.signals.values()} | {mapping.trajectory}
    for signs, called in _SIGNS:
        if signs <= known:
            return {k: v for k, v in called.items() if k not in named and v not in known}
    return {}


def with_own_clock(frame: pd.DataFrame, mapping: LogMapping) -> pd.DataFrame:
    """Return a table with standard names of clock and runs."""
    called = own_clock(frame.columns, mapping)
    return frame.rename(columns=called) if called else frame


def data_set_files(folder: Path) -> list[Path]:
    """Return the parquet files of a LeRobot data set; none if a folder is no such data set."""
    if not (folder / "meta" / "info.json").is_file():
        return []
    return sorted((folder / "data").rglob("*.parquet"))


def places_of(path: Path) -> dict[str, list[str]]:
    """Return the names of the list elements in a file of a LeRobot data set, such as joints, by column."""
    for folder in list(path.resolve().parents)[:_ABOVE]:
        info = folder / "meta" / "info.json"
        if not info.is_file() or info.stat().st_size > _MOST:
            continue
        try:
            features = json.loads(info.read_text(encoding="utf-8"))["features"]
            return {str(k): names for k, v in features.items() if (names := _names(v.get("names")))}
        except (ValueError, KeyError, TypeError, AttributeError, OSError, RecursionError):
            return {}
    return {}


def _names(said: Any) -> list[str]:
    """Return names from a list, a list of one list, or a table of one list."""
    if isinstance(said, dict):
        said = next(iter(said.values()), None)
    if isinstance(said, list) and len(said) == 1 and isinstance(said[0], list):
        said = said[0]
    return said if isinstance(said, list) and all(isinstance(n, str) for n in said) else []
