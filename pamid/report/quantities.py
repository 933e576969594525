"""What signals, equations and effects are called in text and on axes, and in which unit people read them."""

import math
import re
from typing import NamedTuple

from ..gap.diagnosis.findings import Cause
from ..plots.style import SHOWN
from ..simulators.between import ends_of

NOT_EFFECTS = ("none", "unknown")
"""Candidates that are no effects."""


class DisplayedQuantity(NamedTuple):
    """A signal as people read it."""

    words: str
    """What it is called."""
    factor: float
    """From SI to the unit shown."""
    unit: str
    """The unit shown; empty for a plain number."""

    @property
    def label(self) -> str:
        """Text for an axis."""
        unit = typeset(self.unit)
        return f"{self.words} / {f'({unit})' if '/' in unit else unit}" if unit else self.words


SIGNALS = {
    "eps": DisplayedQuantity("contraction", 100.0, "%"),
    "deps": DisplayedQuantity("contraction rate", 100.0, "%/s"),
    "P": DisplayedQuantity("pressure, absolute", 1e-5, "bar"),
    "dP": DisplayedQuantity("pressure rate", 1e-5, "bar/s"),
    "u": DisplayedQuantity("valve command", 1.0, ""),
    "F": DisplayedQuantity("tension", 1.0, "N"),
    "mdot": DisplayedQuantity("mass flow", 1e6, "mg/s"),
    "q": DisplayedQuantity("joint angle", 180.0 / math.pi, "deg"),
    "dq": DisplayedQuantity("joint speed", 180.0 / math.pi, "deg/s"),
    "x": DisplayedQuantity("stroke", 1e3, "mm"),
    "dx": DisplayedQuantity("speed", 1e3, "mm/s"),
    "drive": DisplayedQuantity("drive", 1.0, ""),
    "q_ref": DisplayedQuantity("reference joint angle", 180.0 / math.pi, "deg"),
    "time": DisplayedQuantity("time", 1.0, "s"),
}
"""Signals of a log and what follows from them."""


def capital(text: str) -> str:
    """Return a text that begins with a capital letter."""
    return text[:1].upper() + text[1:]


_RAISED = str.maketrans("0123456789-", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻")
_POWER = re.compile(r"(?<=\d)e([+-]?)0*(\d+)")


def typeset(text: str) -> str:
    """Write powers as such: ``2e-10 m^3`` becomes 2 · 10⁻¹⁰ m³."""
    text = _POWER.sub(lambda m: f" · 10{(m[1].replace('+', '') + m[2]).translate(_RAISED)}", text)
    return re.sub(r"\^(-?\d+)", lambda m: m[1].translate(_RAISED), text)


NAMES = ("coulomb", "stribeck", "bouc", "wen", "maxwell", "prandtl", "ishlinskii")
"""Words in names of effects that are names of people."""


def effect(name: str) -> str:
    """Return an effect's name as words: ``coulomb_friction`` is Coulomb friction."""
    words = re.split("[_ ]", name)  # several stand beside each other with "and"
    said = " ".join(w.capitalize() if w in NAMES else w for w in words)
    return said.replace(" dependent", "-dependent")


_SAID = {
    "settled": "relaxed share of the springs at the start of a run",
    "unknown": "unknown share of the initial state",
    "carried": "share of its excess temperature that leaving gas keeps",
}
"""Parameters whose names alone say nothing."""


def parameter(name: str) -> str:
    """Return the name of an effect's parameter in words."""
    return _SAID.get(name, name.replace("_", " "))


def placed(name: str, port: str) -> str:
    """Return an effect as words, with the port of a simulator at which it acts, or the two between which it does."""
    return said_at(effect(name), port)


def said_at(name: str, port: str) -> str:
    """Return a name with the port at which it is, or the two between which it is; alone where there is none."""
    if not port:
        return name
    if ends_of(port) is None:
        return f"{name} at {port}"
    return f"{name.replace('heat loss', 'heat exchange')} between {port}"  # what one loses, the other gains


def places(cause: Cause) -> tuple[str, ...]:
    """Return the port of each effect of a cause; empty where the effect itself says where it acts."""
    return cause.where or ("",) * len(cause.effects)


def amount(value: float, unit: str = "", digits: int = 3) -> str:
    """Return a number with its unit, in plain characters."""
    if not math.isfinite(value):
        return "unknown"
    factor, shown = SHOWN.get(unit, (1.0, unit))
    text = f"{value * factor:.{digits}g}"
    return text if shown in ("", "-") else f"{text} {shown}"


def error_size(value: float, unit: str) -> str:
    """Return an error of a signal with its unit; a signal without one, such as a pH, is no share."""
    return amount(value, "" if unit == "-" else unit)


def percent(share: float) -> str:
    """Return a share as a whole per cent, rounded to 0 or 100 only where it is exactly that."""
    if not math.isfinite(share):
        return "an unknown share"
    if 0.0 < share < 0.005:
        return "under 1 %"
    if 0.995 < share < 1.0:
        return "over 99 %"
    return f"{100 * share:.0f} %"


def at_least(share: float) -> str:
    """Return the least of several shares as a bound."""
    text = percent(share)
    return text if text.startswith("over") else f"{text} or more"


def span(low: float, high: float, unit: str = "") -> str:
    """Return an interval; an end that is not finite is said to be open."""
    if not (math.isfinite(low) or math.isfinite(high)):
        return "not bounded by this log"
    if not math.isfinite(low):
        return f"up to {amount(high, unit)}"
    if not math.isfinite(high):
        return f"from {amount(low, unit)}, no upper bound"
    _, shown = SHOWN.get(unit, (1.0, unit))
    tail = "" if shown in ("", "-") else f" {shown}"
    ends = [amount(v, unit, _digits(low, high, unit)).removesuffix(tail) for v in (low, high)]
    return f"{ends[0]} to {ends[1]}{tail}"


def amount_within(value: float, low: float, high: float, unit: str = "") -> str:
    """Return a number with its unit, in as many digits as its interval, which otherwise may seem not to hold it."""
    return amount(value, unit, _digits(low, high, unit))


def _digits(low: float, high: float, unit: str) -> int:
    """Return the digits that show the width of an interval; 3 of an open one."""
    if not (math.isfinite(low) and math.isfinite(high)):
        return 3
    return next((n for n in (3, 4) if amount(low, unit, n) != amount(high, unit, n)), 5)


def cell(share: float) -> str:
    """Return a share as a whole per cent, short enough for a table."""
    return percent(share).replace("under ", "<").replace("over ", ">").replace("an unknown share", "")


def share_span(low: float, high: float) -> str:
    """Return an interval of shares."""
    if not (math.isfinite(low) and math.isfinite(high)):
        return "not bounded by this log"
    if low == high:
        return f"{100 * low:.0f} %"
    if 0.9995 < low < high <= 1.0:
        return "over 99.9 %"
    digits = _decimals(low, high)
    return f"{100 * low:.{digits}f} to {100 * high:.{digits}f} %"


def percent_within(share: float, low: float, high: float) -> str:
    """Return a share in as many decimals as its interval, which otherwise may seem not to hold it."""
    digits = _decimals(low, high)
    return f"{100 * share:.{digits}f} %" if digits and math.isfinite(share) else percent(share)


def interval_of(share: float, low: float, high: float) -> str:
    """Return a share with its interval in brackets."""
    return f"{percent_within(share, low, high)} (90 % interval {share_span(low, high)})"


def _decimals(low: float, high: float) -> int:
    """Return the decimals of per cents that show the width of an interval; 0 where none does."""
    if not (math.isfinite(low) and math.isfinite(high)) or 0.9995 < low < high <= 1.0:
        return 0
    return next((n for n in (0, 1, 2) if f"{100 * low:.{n}f}" != f"{100 * high:.{n}f}"), 0)


def probability(p: float) -> str:
    """Return a p value."""
    if not math.isfinite(p):
        return "p unknown"
    return "p < 0.001" if p < 0.001 else f"p = {p:.2g}"


def run_named(name: str) -> str:
    """Return a run's name in a sentence: ``run 2`` is called so, ``2`` as well, and ``sine`` is the run sine."""
    if name.isdecimal():
        return f"run {name}"
    return name if name.lower().startswith("run") else f"the run {name}"


def listed(words: list[str], last: str = "and") -> str:
    """Return words as a list of a sentence."""
    if len(words) < 2:
        return "".join(words)
    return f"{', '.join(words[:-1])} {last} {words[-1]}"
