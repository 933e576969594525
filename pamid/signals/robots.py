"""What logs of robots call their clock and their runs, where their other columns tell who wrote them."""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .formats import TRAJECTORY

if TYPE_CHECKING:
    import pandas as pd

    from .mapping import LogMapping

_SIGNS: tuple[tuple[frozenset[str], dict[str, str]], ...] = (
    (frozenset(("timestamp", "episode_index", "frame_index")), {"timestamp": "time", "episode_index": TRAJECTORY}),
    (frozenset(("timestamp", "actual_q_0")), {"timestamp": "time"}),
)
"""Columns that only LeRobot (s, from the start of each episode) and RTDE (s, since the controller started) write."""
_ABOVE = 4
_MOST = 2**22


def own_clock(columns: Iterable[Any], mapping: LogMapping) -> dict[str, str]:
    """Return what a robot's clock and runs are to be called, by their own names."""
    known = {str(c) for c in columns}
    named = {s.column for s in mapping.signals.values()} | {mapping.trajectory}
    for signs, called in _SIGNS:
        if signs <= known:
            return {k: v for k, v in called.items() if k not in named and v not in known}
    return {}


def with_own_clock(frame: pd.DataFrame, mapping: LogMapping) -> pd.DataFrame:
    """Return a table whose clock and runs are called as everywhere."""
    called = own_clock(frame.columns, mapping)
    return frame.rename(columns=called) if called else frame


def data_set_files(folder: Path) -> list[Path]:
    """Return the parquet files of a LeRobot data set, none where a folder is none."""
    if not (folder / "meta" / "info.json").is_file():
        return []
    return sorted((folder / "data").rglob("*.parquet"))


def places_of(path: Path) -> dict[str, list[str]]:
    """Return what the places of the lists in a file of a LeRobot data set are called, such as joints, by column."""
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
    """Return names as they stand in a list, in a list of one list, or in a table of one list."""
    if isinstance(said, dict):
        said = next(iter(said.values()), None)
    if isinstance(said, list) and len(said) == 1 and isinstance(said[0], list):
        said = said[0]
    return said if isinstance(said, list) and all(isinstance(n, str) for n in said) else []
