"""Findings in the readings of a log as text: how often, where first, and what is done about it."""

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
import pandas as pd

from .units import SI_UNITS, base_name, dimension_of

MISSING, USED = "taken as missing", "used as it is"

_NOISY = frozenset(("P", "p", "p_gauge", "F", "mdot"))  # a live sensor of these never repeats one value for a whole run
_SHOWN = 6


class _Place(NamedTuple):
    row: int
    time: float
    run: str

    def __str__(self) -> str:
        return f"row {self.row + 1}, {self.time:.6g} s of '{self.run[:40]}'"


@dataclass
class _Found:
    value: float
    place: _Place
    done: str
    count: int = 0


@dataclass
class Readings:
    """What was found in the readings of one or several logs."""

    found: dict[tuple[str, str], _Found] = field(default_factory=dict)
    """For each signal and kind (``"impossible"``, ``"glitch"``, ``"end"``): how many, the first one, what is done."""
    still: dict[str, dict[str, float]] = field(default_factory=dict)
    """For each signal the runs in which it reads one value throughout, with that value."""
    runs: int = 0
    """Runs looked at."""
    rows: int = 0
    """Rows looked at."""
    columns: dict[str, str] = field(default_factory=dict)
    """Columns that look like a signal and cannot be read as one, with the reason."""
    seen: dict[str, str] = field(default_factory=dict)
    """Name of each run by its mark."""
    repeated: list[tuple[str, str]] = field(default_factory=list)
    """Runs that read the same as an earlier one, sample by sample."""

    def note(
        self, signal: str, kind: str, frame: pd.DataFrame, bad: np.ndarray, done: str, origin: pd.DataFrame
    ) -> None:
        """Note readings of a frame; `origin` is the frame before rows were sorted or left out."""
        first = frame.iloc[int(bad.argmax())]
        same = (origin["time"] == first["time"]) & (origin[signal] == first[signal])
        place = _Place(int(same.to_numpy().argmax()), float(first["time"]), str(first["trajectory"]))
        entry = self.found.setdefault((signal, kind), _Found(float(first[signal]), place, done))
        entry.count += int(bad.sum())

    def words(self, signal: str, kind: str) -> str:
        """Return a finding as text, without the remedy."""
        f = self.found[signal, kind]
        value = f"{f.value:.6g}{_unit(signal)}"
        where = str(f.place) if f.count == 1 else f"{f.count} readings, the first in {f.place}"
        if kind == "impossible":
            return f"{signal} cannot be {value} ({where})"
        if kind == "end":
            return f"{signal} begins or ends a run with {value}, far from the readings beside it ({where})"
        return f"{signal} jumps to {value} and back at once ({where})"

    def sentences(self) -> list[str]:
        """Return the findings as text, one per signal and kind: what, where, how often, and what is done about it."""
        said = [f"{self.words(*key)}: {f.done}" for key, f in self.found.items()]
        for signal, runs in self.still.items():
            value = f"{next(iter(runs.values())):.6g}{_unit(signal)}"
            if len(runs) == self.runs and len(set(runs.values())) == 1:
                said.append(f"{signal} reads {value} in all {self.rows:,} rows while others move: {USED}")
            elif base_name(signal) in _NOISY:
                share = f"{len(runs)} of {self.runs} runs"
                said.append(
                    f"{signal} reads one value throughout in {share} while others move, such as {value} in "
                    f"'{next(iter(runs))[:40]}': {USED}"
                )
        if self.repeated:
            again, first = self.repeated[0]
            more = f", and {len(self.repeated) - 1} more runs repeat others" if len(self.repeated) > 1 else ""
            said.append(f"the run '{again[:40]}' repeats '{first[:40]}' sample by sample{more}: {USED}")
        return said + [f"column '{name[:60]}' is {why}" for name, why in self.columns.items()]

    def summary(self) -> str:
        """Return the findings as one sentence, the first ones in full; empty if there are none."""
        said = self.sentences()
        more = f"; and {len(said) - _SHOWN} more ('pamid check' names them)" if len(said) > _SHOWN else ""
        return "; ".join(said[:_SHOWN]) + more + "." if said else ""


def _unit(signal: str) -> str:
    unit = SI_UNITS.get(dimension_of(signal) or "", "-")
    return "" if unit == "-" else f" {unit}"
