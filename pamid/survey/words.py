"""A survey in words and cells, for the terminal and for the page."""

import math

from .channels import Channel
from .sampling import Sampling

_SHOWN = {"Pa": (1e-5, "bar"), "rad": (180 / math.pi, "deg"), "m": (1e3, "mm"), "kg/s": (1e6, "mg/s"), "-": (1.0, "")}


def shown(value: float, unit: str) -> str:
    """Return a value in the unit that people read it in, without the unit."""
    factor, _ = _SHOWN.get(unit, (1.0, unit))
    return f"{value * factor:.4g}" if math.isfinite(value) else "-"


def shown_unit(unit: str) -> str:
    """Return the unit that people read a quantity in."""
    return _SHOWN.get(unit, (1.0, unit))[1]


def channel_rows(channels: list[Channel]) -> tuple[list[str], list[list[str]]]:
    """Return header and rows of the table of channels."""
    header = ["signal", "unit", "lowest", "highest", "noise", "step", "missing"]
    rows = [
        [
            c.name,
            shown_unit(c.unit) or "-",
            shown(c.low, c.unit),
            shown(c.high, c.unit),
            shown(c.noise, c.unit),
            shown(c.step, c.unit) if c.step > 0 else "-",
            f"{100 * c.missing:.3g} %" if c.missing else "-",
        ]
        for c in channels
    ]
    return header, rows


def sampling_sentence(s: Sampling) -> str:
    """Return rows, runs, kinds, rate and length in one sentence."""
    kinds = ", ".join(f"{n} {name}" for name, n in list(s.kinds.items())[:6]) + (" ..." if len(s.kinds) > 6 else "")
    runs = f"{s.runs} run{'' if s.runs == 1 else 's'} ({kinds})"
    rate = f"{s.rate:.4g} samples a second" if math.isfinite(s.rate) else "no usable clock"
    steady = f"varying by {s.jitter:.0%}" if s.jitter > 0.01 else "steady"
    return f"{s.rows:,} rows in {runs}, {s.seconds:.3g} s, {rate}, {steady}."
