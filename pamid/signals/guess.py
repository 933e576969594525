"""What the columns of an unknown log probably are: signals by their names, units by names and ranges."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from pamid.constants import ATMOSPHERIC_PRESSURE

from .units import UNITS, base_name, dimension_of

if TYPE_CHECKING:
    import pandas as pd

_VOCABULARY = """
time: t time zeit timestamp clock sec secs seconds tempo temps stamp ms
P: p pressure press pres druck
F: f force kraft loadcell cell tension zugkraft
mdot: mdot flow massflow durchfluss massenstrom
eps: eps epsilon contraction strain kontraktion
L: l length len laenge länge
x: x position pos stroke disp displacement weg hub travel shortening extension
q: q angle theta phi winkel joint encoder
u: u cmd command valve duty pwm stellsignal
voltage: voltage volts volt vin spannung
drive: torque tau drive current strom drehmoment effort
enabled: enable enabled
trajectory: trajectory run trial experiment test
wanted: ref goal target set setpoint soll desired wanted demand
rate: speed velocity vel rate omega dot geschwindigkeit dq deps dp
"""
_WORDS = {line.split(":")[0]: frozenset(line.split(":")[1].split()) for line in _VOCABULARY.strip().splitlines()}
_NO_SIGNALS = ("trajectory", "enabled", "wanted", "rate")
_SIDES = {
    "1": 1, "2": 2, "a": 1, "b": 2, "left": 1, "right": 2, "agonist": 1, "antagonist": 2, "flexor": 1, "extensor": 2,
}  # fmt: skip
_NUMBERED = frozenset(("P", "F", "mdot", "u"))
_UNIT_WORDS = {
    "degree": "deg", "degrees": "deg", "grad": "deg", "pct": "%", "prozent": "%", "newton": "N", "pascal": "Pa",
    "sec": "s", "second": "s", "seconds": "s", "barg": "barg", "bara": "bara", "kpa": "kPa", "mpa": "MPa", "hpa": "hPa",
    "pa": "Pa", "n": "N", "kn": "kN",
}  # fmt: skip


@dataclass(frozen=True)
class Guess:
    """What one column probably is.

    Parameters
    ----------
    column : str or int
        Its name, or its position where the log names none.
    signal : str
        Signal of the tidy log; ``"trajectory"`` for the names of runs, ``""`` where nothing is known.
    unit : str or None
        Unit of the column; None: SI.
    gauge : bool or None
        For pressures: whether it is gauge pressure.
    source : str
        As in `SignalMapping`: ``"value"``, ``"length"`` or ``"shortening"``.
    scale : float
        Factor on the raw value.
    allowed : tuple of float or None
        Values that count.
    sure : bool
        Whether the unit follows from the name or is plain from the range.
    why : str
        What speaks for it.
    low, high : float
        Range of the column.
    """

    column: str | int
    signal: str = ""
    unit: str | None = None
    gauge: bool | None = None
    source: str = "value"
    scale: float = 1.0
    allowed: tuple[float, ...] | None = None
    sure: bool = True
    why: str = ""
    low: float = float("nan")
    high: float = float("nan")

    def settings(self) -> dict[str, Any]:
        """Return the entry of a mapping."""
        plain = Guess(self.column)
        entry: dict[str, Any] = {"column": self.column}
        for key in ("unit", "gauge", "source", "scale", "allowed"):
            if (value := getattr(self, key)) != getattr(plain, key):
                entry[key] = list(value) if isinstance(value, tuple) else value
        return entry


def guess_columns(frame: pd.DataFrame, named: bool = True, kind: str = "") -> list[Guess]:
    """Say what each column of a raw table probably is.

    Parameters
    ----------
    frame : DataFrame
        The table as it stands in the file.
    named : bool, default=True
        Whether the columns have names of their own; without names only time is recognised.
    kind : str, default=""
        What the log is of: ``"bench"``, ``"muscle"``, ``"cylinder"``, ``"joint"``, or not known.

    Returns
    -------
    list of Guess
        One a column, in order. No two have the same signal: the first column keeps it.

    Examples
    --------
    >>> import pandas as pd
    >>> from pamid.signals.guess import guess_columns
    >>> table = pd.DataFrame({"t [ms]": range(0, 500, 10), "pressure (bar)": 2.0, "stroke_mm": 12.5, "load cell": 80.0})
    >>> [(g.signal, g.unit) for g in guess_columns(table, kind="cylinder")]
    [('time', 'ms'), ('P', 'bar'), ('x', 'mm'), ('F', None)]
    """
    found: list[Guess] = []
    taken: set[str] = set()
    for position, column in enumerate(frame.columns):
        name: str | int = str(column) if named else position
        guess = _guess(frame.iloc[:, position], name, named, kind)
        if not named and guess.signal == "" and "time" not in taken and _is_clock(frame.iloc[:, position]):
            guess = with_unit(replace(guess, signal="time", why="grows steadily"), frame.iloc[:, position])
        if guess.signal in taken:
            guess = replace(guess, signal="", why=f"another column is {guess.signal} already")
        if guess.signal:
            taken.add(guess.signal)
        found.append(guess)
    return found


def guess_kind(signals: set[str]) -> str:
    """Say what a log is of by its signals; empty where they do not tell."""
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
    """Return a guess with the unit that its column's values look like, where its name does not say one."""
    values = _numbers(column)
    if not values.size:
        return guess
    low, high = (float(v) for v in np.quantile(values, [0.002, 0.998], method="inverted_cdf"))
    guess = replace(guess, low=low, high=high)
    unit, sure, scale = (guess.unit, True, 1.0) if guess.unit else _unit_of(guess, values, low, high)
    gauge = guess.gauge
    if _dimension(guess) == "pressure" and gauge is None:
        ambient = ATMOSPHERIC_PRESSURE / (UNITS[unit].factor if unit else 1.0)
        of_unit = UNITS[unit].gauge if unit else None
        gauge = of_unit if of_unit is not None else low < 0.8 * ambient or low > 1.2 * ambient
        # A sensor that never sees the ambient pressure does not say which it is; most sensors read gauge pressure.
        sure = sure and (of_unit is not None or low < 0.8 * ambient or low <= 1.2 * ambient)
        if of_unit is not None:
            gauge = None
    return replace(
        guess, unit=unit, gauge=gauge, sure=guess.sure and sure, scale=scale if scale != 1.0 else guess.scale
    )


def _guess(column: pd.Series, name: str | int, named: bool, kind: str) -> Guess:
    values = _numbers(column)
    guess = Guess(name)
    if values.size:
        guess = replace(guess, low=float(values.min()), high=float(values.max()))
    if not named:
        return guess
    words, unit = split_name(str(name))
    signal = _signal(str(name), words, column, kind)
    if not signal:
        return guess
    if signal in ("trajectory", "enabled"):
        allowed = (1.0,) if signal == "enabled" else None
        return replace(guess, signal=signal, allowed=allowed, why="its name")
    source = "value"
    if kind == "muscle" and signal in ("L", "x"):
        source = "length" if signal == "L" or "length" in words else "shortening"
        signal = "eps"
    if unit and _dimension(replace(guess, signal=signal, source=source)) not in (None, UNITS[unit].dimension):
        unit = None
    gauge = True if re.fullmatch(r"p_?\d?|.*gauge.*", str(name)) else None
    return with_unit(replace(guess, signal=signal, unit=unit, source=source, gauge=gauge, why="its name"), column)


def split_name(name: str) -> tuple[list[str], str | None]:
    """Split a column's name into words and the unit that it states.

    Examples
    --------
    >>> from pamid.signals.guess import split_name
    >>> split_name("Pressure_1 [bar]"), split_name("strokeMm"), split_name("F / kN")
    ((['pressure', '1'], 'bar'), (['stroke'], 'mm'), (['f'], 'kN'))
    """
    unit = None
    if bracket := re.search(r"[\[(]\s*([^\[\]()]+?)\s*[\])]\s*$|\s(?:/|in)\s*([^\s]+)\s*$", name):
        unit = _known_unit(bracket[1] or bracket[2])
        name = name[: bracket.start()]
    spaced = re.sub(r"(?<=[a-zäöü])(?=[A-Z])|(?<=[A-Za-z])(?=\d)", " ", name)
    raw = [w for w in re.split(r"[^\w°%]+|_", spaced) if w]
    if unit is None and len(raw) > 1 and (unit := _known_unit(raw[-1])) is not None and raw[-1] not in _SIDES:
        raw = raw[:-1]
    return [w.lower() for w in raw], unit


def _known_unit(text: str) -> str | None:
    text = text.strip()
    for candidate in (text, text.lower(), _UNIT_WORDS.get(text.lower(), "")):
        if candidate in UNITS and candidate not in ("1", "-"):
            return candidate
    return None


def _signal(name: str, words: list[str], column: pd.Series, kind: str) -> str:
    own = base_name(name)
    if own != "p" and dimension_of(name) is not None and own not in ("length", "rest_length", "T", "load_mass", "dq"):
        return name if own not in ("x", "L", "stroke") else _by_kind(own.replace("stroke", "x"), kind)
    every = set(words)
    if every & _WORDS["enabled"]:
        return "enabled" if _is_switch(column) else ""
    if every & _WORDS["rate"]:
        return ""
    if every & _WORDS["trajectory"] and _names_runs(column):
        return "trajectory"
    signal = next((s for s in _WORDS if s not in _NO_SIGNALS and every & _WORDS[s]), "")
    if "load" in every and not signal and kind != "joint":
        signal = "F"
    signal = _by_kind(signal, kind)
    if every & _WORDS["wanted"]:
        return "q_ref" if signal == "q" else ""
    if signal in _NUMBERED and kind in ("", "bench"):
        side = next((_SIDES[w] for w in words if w in _SIDES), 0)
        return f"{signal}{side or ''}"
    return signal


def _by_kind(signal: str, kind: str) -> str:
    """Return the signal that a word stands for in a log of a kind."""
    if kind == "joint":
        return {"x": "q", "F": "drive", "u": "drive"}.get(signal, signal)
    if signal in ("voltage", "drive"):
        return ""
    return "x" if signal == "L" and kind == "cylinder" else signal


def _dimension(guess: Guess) -> str | None:
    return "length" if guess.source != "value" else dimension_of(guess.signal)


def _unit_of(guess: Guess, values: np.ndarray, low: float, high: float) -> tuple[str | None, bool, float]:
    """Return unit, whether it is plain, and a factor, by the values."""
    size = max(abs(low), abs(high))
    dimension = _dimension(guess)
    if dimension == "time":
        steps = np.diff(values)
        step = float(np.median(steps[steps > 0])) if np.any(steps > 0) else 0.0
        if step >= 1e5:
            return "ns", False, 1.0
        if step > 500:
            return "us", False, 1.0
        return ("ms", True, 1.0) if step >= 0.99 else (None, True, 1.0)
    if dimension == "pressure":
        limits = ((1.5, "MPa", True), (25.0, "bar", True), (1_500.0, "kPa", size > 200), (20_000.0, "mbar", False))
        return next(((u, sure, 1.0) for limit, u, sure in limits if size < limit), (None, True, 1.0))
    if dimension == "length":
        return ("mm", size > 5.0, 1.0) if size > 2.0 else (None, size < 1.0, 1.0)
    if dimension == "angle":
        return ("deg", True, 1.0) if size > 3.5 else (None, size > 0.02, 1.0)
    if dimension == "ratio" and base_name(guess.signal) == "eps":
        return ("%", True, 1.0) if size >= 1.0 else (None, True, 1.0)
    if dimension == "ratio":
        if size <= 1.5:
            return None, True, 1.0
        return (None, False, 0.1) if size <= 12.0 else ("%", size <= 101.0, 1.0)
    if dimension == "mass flow":
        return (None, True, 1.0) if size < 0.05 else ("g/s", False, 1.0) if size < 5.0 else ("L/min ANR", False, 1.0)
    if dimension == "force":
        return ("mN", True, 1.0) if size > 1e5 else (None, True, 1.0)
    return None, True, 1.0


def _numbers(column: pd.Series) -> np.ndarray:
    import pandas as pd

    if not (pd.api.types.is_numeric_dtype(column) or pd.api.types.is_bool_dtype(column)):
        return np.zeros(0)
    values = column.to_numpy(dtype=float, na_value=np.nan)
    return np.asarray(values[np.isfinite(values)])


def _is_clock(column: pd.Series) -> bool:
    values = _numbers(column)
    steps = np.diff(values)
    if len(values) < 10 or np.ptp(values) == 0.0:
        return False
    return bool(np.mean(steps > 0) > 0.99 and np.median(steps) * len(steps) > 0.3 * np.ptp(values))


def _is_switch(column: pd.Series) -> bool:
    return set(np.unique(_numbers(column))) <= {0.0, 1.0}


def _names_runs(column: pd.Series) -> bool:
    changes = int((column != column.shift()).sum())
    return changes == column.nunique() and changes < max(2, len(column) / 20)
