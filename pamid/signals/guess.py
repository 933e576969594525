"""What the columns of an unknown log probably are: signals by their names, units by names and ranges."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd

from pamid.constants import ATMOSPHERIC_PRESSURE

from .headers import SIDES, Header, read_header
from .unit_names import unit_name
from .units import UNITS, base_name, dimension_of
from .vocabulary import kinds_of

_SIGNALS = ("time", "P", "F", "mdot", "eps", "L", "x", "q", "u", "voltage", "drive")  # the first that fits counts
_NUMBERED = frozenset(("P", "F", "mdot", "u"))
_BY_DIMENSION = {
    "time": "time", "pressure": "P", "force": "F", "mass flow": "mdot", "length": "x", "angle": "q", "torque": "drive",
    "voltage": "voltage",
}  # fmt: skip
_LOWEST = 0.8
"""Share of the ambient pressure below which an absolute pressure of a pressurised system does not fall."""


@dataclass(frozen=True)
class Guess:
    """What one column probably is."""

    column: str | int
    """Its name, or its position where the log names none."""
    signal: str = ""
    """Signal of the tidy log; ``"trajectory"`` for the names of runs, ``""`` where nothing is known."""
    unit: str | None = None
    """Unit of the column; None: SI."""
    gauge: bool | None = None
    """For pressures: whether it is gauge pressure."""
    source: str = "value"
    """As in `SignalMapping`: ``"value"``, ``"length"`` or ``"shortening"``."""
    scale: float = 1.0
    """Factor on the raw value."""
    allowed: tuple[float, ...] | None = None
    """Values that count."""
    sure: bool = True
    """Whether the unit follows from the name, not from the range alone."""
    why: str = ""
    """The reason for or against it."""
    low: float = float("nan")
    high: float = float("nan")
    """Range of the column."""
    question: str = ""
    """What has to be answered before the column can be used at all; empty where nothing has to."""
    settled: bool = False
    """For pressures: whether gauge or absolute is said by the name, the unit or the user rather than by the range."""
    own: bool = False
    """Whether its signal is a name of a simulator's own, which elsewhere stands for a quantity of another unit."""

    def settings(self) -> dict[str, Any]:
        """Return the entry of a mapping."""
        plain = Guess(self.column)
        entry: dict[str, Any] = {"column": self.column}
        for key in ("unit", "gauge", "source", "scale", "allowed", "own"):
            if (value := getattr(self, key)) != getattr(plain, key):
                entry[key] = list(value) if isinstance(value, tuple) else value
        return entry

    @property
    def is_pressure(self) -> bool:
        """Whether its signal is a pressure."""
        return self.source == "value" and dimension_of(self.signal) == "pressure"


def guess_columns(
    frame: pd.DataFrame, named: bool = True, kind: str = "", every: Callable[[str | int], pd.Series] | None = None
) -> list[Guess]:
    """Guess what each column of a raw table is."""
    if not named:
        return _nameless(frame)
    headers = [read_header(str(column)) for column in frame.columns]
    found = [
        _guess(frame.iloc[:, k], str(column), header, kind, frame.iloc[:, k] if every is None else every(str(column)))
        for k, (column, header) in enumerate(zip(frame.columns, headers, strict=True))
    ]
    for signal in dict.fromkeys(g.signal for g in found if g.signal):
        rivals = [k for k, g in enumerate(found) if g.signal == signal]
        ranks = {k: _rank(found[k], headers[k], frame.iloc[:, k]) for k in rivals}
        best = min(rivals, key=lambda k: ranks[k])
        alike = [k for k in rivals if ranks[k] == ranks[best]]
        if len(alike) > 1 and signal != "time":
            columns = " and ".join(repr(str(found[k].column)) for k in alike[:4])
            found[best] = replace(found[best], question=f"{columns} may each be {signal}")
        for k in rivals:
            if k != best:
                found[k] = replace(found[k], signal="", why=f"another column is {signal} already", question="")
    return found


def guess_kind(signals: set[str]) -> str:
    """Guess the kind of system from a log's signals; empty if they do not show it."""
    if "q" in signals and {"P1", "P2"} & signals:
        return "bench"
    if {"eps", "P"} <= signals:
        return "muscle"
    if {"x", "P", "F"} <= signals:
        return "cylinder"
    if "q" in signals and {"q_ref", "drive"} & signals:
        return "joint"
    return ""


def with_unit(guess: Guess, column: pd.Series) -> Guess:
    """Return a guess with the unit that its column's values suggest, if its name has none."""
    values = _numbers(column)
    if not values.size:
        return guess
    low, high = (float(v) for v in np.quantile(values, [0.002, 0.998], method="inverted_cdf"))
    guess = _ranged(guess, values)
    if guess.own:
        return guess
    unit, sure, scale = (guess.unit, True, 1.0) if guess.unit else _unit_of(guess, values, low, high)
    guess = replace(guess, unit=unit, sure=guess.sure and sure, scale=scale if scale != 1.0 else guess.scale)
    if not guess.is_pressure:
        return guess
    if unit and UNITS[unit].gauge is not None:
        return replace(guess, gauge=None, settled=True)
    if guess.settled and guess.gauge is not None and guess.why == "given":
        return guess
    if low < _LOWEST * ATMOSPHERIC_PRESSURE / (UNITS[unit].factor if unit else 1.0):
        return replace(guess, gauge=True, settled=True)  # whatever its name: no absolute pressure falls so low
    return guess


# --- by name ------------------------------------------------------------------------------------------------
def _nameless(frame: pd.DataFrame) -> list[Guess]:
    """Return guesses for columns without names: the first that increases steadily is the clock."""
    found: list[Guess] = []
    for position in range(frame.shape[1]):
        column, values = frame.iloc[:, position], _numbers(frame.iloc[:, position])
        guess = _ranged(Guess(position), values)
        if not any(g.signal for g in found) and _is_clock(column):
            guess = with_unit(replace(guess, signal="time", why="grows steadily"), column)
        found.append(guess)
    return found


def _guess(column: pd.Series, name: str, header: Header, kind: str, every: pd.Series) -> Guess:
    guess = _ranged(Guess(name), _numbers(every))
    signal = _signal(header, column, kind)
    if not signal:
        return guess
    if signal in ("trajectory", "enabled"):
        return replace(guess, signal=signal, allowed=(1.0,) if signal == "enabled" else None, why="its name")
    source, unit = "value", header.unit
    if kind == "muscle" and (signal in ("L", "x") or (signal == "eps" and unit and UNITS[unit].dimension == "length")):
        source = "length" if signal == "L" or "length" in header.words else "shortening"
        signal = "eps"
    guess = replace(guess, signal=signal, source=source, why="its name")
    dimension = _dimension(guess)
    if header.unread and dimension is not None:
        return replace(guess, question=f"the unit {header.unread!r} of column {name!r} is not known")
    if unit and dimension not in (None, UNITS[unit].dimension):
        unit = unit_name(unit, dimension)
        if unit and UNITS[unit].dimension != dimension:
            return _of_another_dimension(guess, header, every)
    gauge = header.gauge if guess.is_pressure else None  # "rel. time" begins at 0
    if guess.is_pressure and gauge is None:
        gauge = {"P": False, "p": True}.get(header.bare.rstrip("0123456789_"))
    own = dimension_of(header.bare) is not None and header.bare == signal
    told = with_unit(replace(guess, unit=unit, gauge=gauge, settled=gauge is not None), every)
    return replace(told, sure=True) if own and told.unit is None and told.scale == 1.0 else told


def _of_another_dimension(guess: Guess, header: Header, every: pd.Series) -> Guess:
    """Return the guess for a column whose unit contradicts the signal of its name."""
    dimension = UNITS[str(header.unit)].dimension
    if dimension == "time" and header.bracketed:  # whatever its name: a column that counts seconds is the clock
        return with_unit(replace(guess, signal="time", unit=header.unit, source="value"), every)
    if not header.bracketed:  # the last word of the name is no unit after all
        return with_unit(guess, every)
    if guess.signal == "mdot" and dimension == "volume flow":
        return replace(
            guess,
            question=f"the unit {header.unit!r} of column {guess.column!r} does not say at which conditions the volume "
            "counts ('L/min ANR': 20 °C and 1 bar, 'NL/min': 0 °C and 1.013 bar)",
        )
    if base_name(guess.signal) == "u" and dimension == "voltage":
        return with_unit(guess, every)
    return replace(guess, signal="", why=f"its unit {header.unit} is a unit of {dimension}, not of {guess.signal}")


def _signal(header: Header, column: pd.Series, kind: str) -> str:
    own = base_name(header.bare)
    if own != "p" and dimension_of(header.bare) is not None and own not in (
        "length", "rest_length", "T", "load_mass", "dq", "deps", "dP", "P_supply",
    ):  # fmt: skip
        return header.bare if own not in ("x", "L", "stroke") else _by_kind(own.replace("stroke", "x"), header, kind)
    kinds = {"time"} if header.words == ["x", "value"] else kinds_of(header.words)  # as LabVIEW calls its clock
    if "enabled" in kinds:
        return "enabled" if set(np.unique(_numbers(column))) <= {0.0, 1.0} else ""
    if "trajectory" in kinds and _names_runs(column):
        return "trajectory"
    if kinds & {"rate", "elsewhere"} and "time" not in kinds:
        return ""
    signal = next((s for s in _SIGNALS if s in kinds), "")
    if "load" in header.words and signal in ("", "u") and kind != "joint":
        signal = "F"
    if not signal and header.unit and not kinds & {"trajectory"}:
        signal = _BY_DIMENSION.get(UNITS[header.unit].dimension, "")
    commanded = bool({"cmd", "command", "commanded"} & set(header.words)) and signal not in ("u", "drive", "voltage")
    wanted = "wanted" in kinds or commanded
    signal = _by_kind(signal, header, kind)
    if wanted:
        return "q_ref" if signal == "q" else ""
    if signal in _NUMBERED and kind in ("", "bench"):
        side = next((SIDES[w] for w in header.words if w in SIDES), 0)
        return f"{signal}{side or ''}"
    return signal


def _by_kind(signal: str, header: Header, kind: str) -> str:
    """Return the signal that a word stands for in a log of a kind."""
    angle = header.unit is not None and UNITS[header.unit].dimension == "angle"
    if kind == "joint":
        return {"x": "q", "F": "drive", "u": "drive"}.get(signal, signal)
    if signal == "x" and angle:
        return "q"
    if signal in ("voltage", "drive"):
        return ""
    return "x" if signal == "L" and kind == "cylinder" else signal


def _rank(guess: Guess, header: Header, column: pd.Series) -> tuple[bool, bool, bool, int]:
    """Return how poorly a column matches its signal; the lowest gets it."""
    treated = "treated" in kinds_of(header.words)
    if guess.signal == "time":
        return (not _is_clock(column), treated, header.unit is None, 0)
    return (header.bare != guess.signal, treated, header.unit is None, len(header.words))


# --- by range -----------------------------------------------------------------------------------------------
def _dimension(guess: Guess) -> str | None:
    return "length" if guess.source != "value" else dimension_of(guess.signal)


def _unit_of(guess: Guess, values: np.ndarray, low: float, high: float) -> tuple[str | None, bool, float]:
    """Return unit, whether no other is likely, and a factor, by the values."""
    size = max(abs(low), abs(high))
    dimension = _dimension(guess)
    if dimension == "time":
        steps = np.diff(values)
        step = float(np.median(steps[steps > 0])) if np.any(steps > 0) else 0.0
        if step >= 1e5:
            return "ns", False, 1.0
        if step > 500:
            return "us", False, 1.0
        return ("ms", False, 1.0) if step >= 0.99 else (None, step <= 0.05, 1.0)
    if dimension == "pressure":
        limits = ((1.5, "MPa"), (25.0, "bar"), (1_500.0, "kPa"), (20_000.0, "mbar"))
        return next(((u, False, 1.0) for limit, u in limits if size < limit), (None, True, 1.0))
    if dimension == "length":
        return ("mm", False, 1.0) if size > 2.0 else (None, False, 1.0)
    if dimension == "angle":
        return ("deg", False, 1.0) if size > 3.5 else (None, False, 1.0)
    if dimension == "ratio" and base_name(guess.signal) == "eps":
        return ("%", False, 1.0) if size >= 1.0 else (None, True, 1.0)
    if dimension == "ratio":
        if size <= 1.5:
            return None, True, 1.0
        return (None, False, 0.1) if size <= 12.0 else ("%", False, 1.0)
    if dimension == "mass flow":
        return (None, False, 1.0) if size < 0.05 else ("g/s", False, 1.0) if size < 5.0 else ("L/min ANR", False, 1.0)
    if dimension == "force":
        return ("mN", False, 1.0) if size > 1e5 else (None, False, 1.0)
    return None, True, 1.0


def _numbers(column: pd.Series) -> np.ndarray:
    if not (pd.api.types.is_numeric_dtype(column) or pd.api.types.is_bool_dtype(column)):
        return np.zeros(0)
    values = column.to_numpy(dtype=float, na_value=np.nan)
    return np.asarray(values[np.isfinite(values)])


def _ranged(guess: Guess, values: np.ndarray) -> Guess:
    """Return a guess with the range of its column."""
    return replace(guess, low=float(values.min()), high=float(values.max())) if values.size else guess


def _is_clock(column: pd.Series) -> bool:
    values = _numbers(column)
    steps = np.diff(values)
    if len(values) < 10 or np.ptp(values) == 0.0:
        return False
    return bool(np.mean(steps > 0) > 0.99 and np.median(steps) * len(steps) > 0.3 * np.ptp(values))


def _names_runs(column: pd.Series) -> bool:
    changes = int((column != column.shift()).sum())
    return changes == column.nunique() and changes < max(2, len(column) / 20)
