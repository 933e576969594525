"""Quantities in units that are made of others, with prefixes, in SI: ``47 µH``, ``4.2 MJ/K``, ``0.42 1/h``."""

from __future__ import annotations

import re

import numpy as np

from .dimensions import unit_text

_PREFIXES = {
    "p": 1e-12, "n": 1e-9, "u": 1e-6, "µ": 1e-6, "m": 1e-3, "c": 1e-2, "d": 0.1, "": 1.0, "h": 1e2, "k": 1e3, "M": 1e6,
    "G": 1e9,
}  # fmt: skip
_SI = "m s N Pa V A J W K Hz H F C S T Wb mol rad"
_SCALED = {
    "g": (1e-3, "kg", 1), "t": (1e3, "kg", 1), "L": (1e-3, "m", 3), "l": (1e-3, "m", 3), "bar": (1e5, "Pa", 1),
    "ohm": (1.0, "ohm", 1), "Ohm": (1.0, "ohm", 1), "Ω": (1.0, "ohm", 1), "Nm": (1.0, "N m", 1),
    "Wh": (3600.0, "J", 1), "Ah": (3600.0, "A s", 1), "deg": (np.pi / 180.0, "rad", 1),
    "rpm": (np.pi / 30.0, "rad/s", 1),
}  # fmt: skip
_PLAIN = {
    "min": (60.0, "s", 1), "h": (3600.0, "s", 1), "d": (86400.0, "s", 1), "1": (1.0, "-", 1),
}  # fmt: skip
_BASES = {name: (1.0, name, 1) for name in _SI.split()} | _SCALED
_PREFIXED = {
    prefix + name: (size * factor, si, power)
    for name, (factor, si, power) in _BASES.items()
    for prefix, size in _PREFIXES.items()
}
_WORDS = _PREFIXED | _BASES | _PLAIN
"""Factor to SI, SI unit and its power of each word; what is a word itself is no prefix with another."""
_WORD = re.compile(r"\s*(?P<mark>[*·/.]?)\s*(?P<word>1|[A-Za-zµΩ]+)(?:(?:\^|\*\*)?(?P<power>-?\d+(?:\.\d+)?))?")
_SIGNS = str.maketrans("μΩ²³⁻¹−⋅", "µΩ23-1-·")


def in_si(text: str) -> tuple[float, str] | None:
    """Return the factor of a written unit to SI, and the SI unit; None where a word of it is not known."""
    unit = text.strip().translate(_SIGNS)
    if bracketed := re.fullmatch(r"(.*)/\s*\((.*)\)", unit):
        unit = f"{bracketed[1]}/{bracketed[2]}"
    factor, found, at, sign = 1.0, list[tuple[str, float]](), 0, 1
    while at < len(unit):
        match = _WORD.match(unit, at)
        if match is None or match["word"] not in _WORDS:
            return None
        at, sign = match.end(), -1 if match["mark"] == "/" else sign  # what is below stays there
        size, si, own = _WORDS[match["word"]]
        power = sign * (float(match["power"]) if "." in (match["power"] or "") else int(match["power"] or 1))
        factor *= size**power
        found.append((si, own * power))
    return (factor, text.strip() if factor == 1.0 else unit_text(found)) if found else None
