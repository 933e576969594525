"""Whether `pamid init` finds the columns of a log: right, wrong and marked as doubtful, or wrong and unmarked."""

from __future__ import annotations

import contextlib
import io
import json
import tempfile
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd

from .held_out import Plant
from .names import ROBOTS, Style, recorded


class Mapped(NamedTuple):
    """What became of one log."""

    right: int
    marked: list[str]
    unmarked: list[str]
    missed: list[str]


def mapped(style: Style, seed: int = 0) -> Mapped:
    """Return what ``pamid init`` makes of a log under the names of a style."""
    frame, truth = recorded(style, seed)
    return tried(frame, truth, "robot.xml", ROBOTS[style.robot].xml)


def mapped_plant(plant: Plant, columns: dict[str, tuple[str, float]], seed: int = 0) -> Mapped:
    """Return what ``pamid init`` makes of a log of a plant under the names of some laboratory."""
    return tried(plant.recorded(columns, seed), columns, "plant.toml", plant.page)


def tried(frame: pd.DataFrame, truth: dict[str, tuple[str, float]], name: str, text: str) -> Mapped:
    """Write a simulator and a log, run ``pamid init`` on them and compare with the truth."""
    from pamid.cli import main

    with tempfile.TemporaryDirectory() as where:
        folder = Path(where)
        (folder / name).write_text(text, encoding="utf-8")
        frame.to_csv(folder / "log.csv", index=False)
        out, err = io.StringIO(), io.StringIO()
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            code = main(["init", str(folder / "log.csv"), "--sim", str(folder / name), "--out",
                         str(folder / "setup"), "--yes", "--json"])  # fmt: skip
        if code:
            raise RuntimeError(err.getvalue())
    return judged(json.loads(out.getvalue()), truth)


def judged(said: dict, truth: dict[str, tuple[str, float]]) -> Mapped:
    """Compare what ``pamid init --json`` said with the columns and units of the ports."""
    from pamid.signals.units import UNITS

    signals = said.get("signals") or {port: {"column": c} for port, c in said["columns"].items()}
    marks = said.get("assumed", {}).get("signals", {})
    result = Mapped(0, [], [], [])
    right = 0
    for port, (column, unit) in truth.items():
        entry = signals.get(port, {})
        found = entry.get("column", "")
        known = entry.get("unit", "")
        factor = 1.0 / UNITS[known].factor if known else 1.0
        if found == column and (not column or abs(np.log(factor / unit)) < 0.02):
            right += 1
            continue
        text = f"{port}: {found or '-'} [{known}], is {column or '-'} x {unit:.4g} {marks.get(port, '')}"
        (result.missed if not found else result.marked if port in marks else result.unmarked).append(text)
    return result._replace(right=right)
