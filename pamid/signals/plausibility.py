"""Whether values look like the unit they should be in: plain cases only, worded as "looks like mm; expected m"."""

import warnings
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from pamid.constants import ATMOSPHERIC_PRESSURE
from pamid.errors import PressureReferenceError, UnitError, UnitWarning

from .units import DIMENSIONS, base_name


class UnitFinding(NamedTuple):
    """One signal whose values are plainly not in the unit expected."""

    signal: str
    """Name of the signal."""
    found: str
    """What was seen, with its value: "P1 reaches 6.2: that looks like bar"."""
    expected: str
    """What was expected."""
    reference: bool = False
    """Whether it is about gauge against absolute pressure."""

    @property
    def text(self) -> str:
        """The finding as one sentence."""
        return f"{self.found}; expected {self.expected}."


class _Range(NamedTuple):
    """Order statistics of a signal that no single outlier moves."""

    low: float
    high: float
    size: float


def _range(values: np.ndarray) -> _Range:
    low, high = np.quantile(values, [0.002, 0.998], method="inverted_cdf")
    return _Range(float(low), float(high), float(max(abs(low), abs(high))))


_PRESSURES = ((1.5, "MPa"), (25.0, "bar"), (250.0, "kPa or psi"), (1_500.0, "kPa"), (20_000.0, "mbar"))
"""Units by the largest reading that they give at the pressures of muscles, up to 15 bar."""

_VENTED = {"MPa": 1e6, "bar": 1e5, "psi": 6894.757, "kPa": 1e3, "mbar": 1e2}
_NEAR = 0.08  # of the ambient pressure: how near the lowest reading of a vented muscle comes to it


def _pressure_unit(r: _Range, ambient: float) -> str:
    """Return the unit in which the lowest reading is the ambient pressure, else the one that fits the sizes."""
    for unit, factor in _VENTED.items():
        if abs(r.low * factor - ambient) < _NEAR * ambient and r.high * factor < 1.5e6:
            return unit
    return next((unit for limit, unit in _PRESSURES if r.size < limit), "another unit")


def _absolute_pressure(name: str, r: _Range, ambient: float) -> UnitFinding | None:
    if r.size == 0.0:
        return UnitFinding(name, f"{name} reads 0 throughout: that looks like an unplugged sensor", "Pa, absolute")
    if r.high < 0.5 * ambient:
        if r.size >= 20_000.0:
            return UnitFinding(
                name,
                f"{name} goes from {r.low:.4g} to {r.high:.4g} Pa: that looks like gauge pressure",
                "absolute pressure",
                True,
            )
        return UnitFinding(
            name, f"{name} reaches {r.size:.4g}: that looks like {_pressure_unit(r, ambient)}", "Pa, absolute"
        )
    if r.low < 0.8 * ambient:
        return UnitFinding(
            name,
            f"{name} falls to {r.low:.4g} Pa, below the ambient {ambient:.6g} Pa: that looks like gauge pressure",
            "absolute pressure",
            True,
        )
    if r.high > 1e8:
        return UnitFinding(name, f"{name} reaches {r.high:.3g} Pa", "at most some MPa")
    return None


def _gauge_pressure(name: str, r: _Range, ambient: float) -> UnitFinding | None:
    if 1e-9 < r.size < 1_500.0 and r.high > 0.05:
        unit = _pressure_unit(r, ambient)
        if unit != "kPa" or r.size > 20.0:
            return UnitFinding(name, f"{name} reaches {r.size:.4g}: that looks like {unit}", "Pa, gauge")
    return None


def _too_large(base: str, size: float) -> tuple[str, str] | None:
    """Return the unit that readings of a size look like, and the one expected; None where they may be in SI."""
    match base:
        case "eps" if size >= 1.0:
            return "percent" if size <= 100.0 else "a length in mm", "the contraction ratio (below 1)"
        case "deps" if size > 100.0:
            return "percent or mm per second", "1/s"
        case "q" if size > 3.5:
            return "degrees", "rad"
        case "F" if size > 1e5:
            return "mN", "N"
        case "mdot" if size > 0.5:
            return "g/s" if size < 5 else "L/min", "kg/s"
        case "u" if size > 1.5:
            return "volts" if size <= 12 else "percent", "a command from -1 to 1"
    return None


def _finding(name: str, base: str, values: np.ndarray, ambient: float) -> UnitFinding | None:
    if base == "time":
        return _time(name, values)
    r = _range(values)
    if base in ("P", "P_supply"):
        return _absolute_pressure(name, r, ambient)
    if base in ("p", "p_gauge"):
        return _gauge_pressure(name, r, ambient)
    if base in _LENGTHS and r.size > 5.0:
        return UnitFinding(name, f"{name} {r.size:.4g} looks like mm", "m")
    if base == "T" and r.size < 150:
        return UnitFinding(name, f"{name} is {r.high:.4g}: that looks like °C", "K")
    if base == "dP" and 0.0 < r.size < 100.0:
        return UnitFinding(name, f"{name} stays below {r.size:.4g}: that looks like bar/s or kPa/s", "Pa/s")
    if (found := _too_large(base, r.size)) is not None:
        return UnitFinding(name, f"{name} reaches {r.size:.4g}: that looks like {found[0]}", found[1])
    return None


_LENGTHS = ("L", "length", "rest_length", "x", "stroke")
_ANY_SIZE = ("dq", "load_mass")


def implausible_units(table: Mapping[str, Any], *, ambient_pressure: float = ATMOSPHERIC_PRESSURE) -> list[UnitFinding]:
    """List the signals of a table whose values are plainly in another unit than SI."""
    if hasattr(table, "_asdict"):
        table = table._asdict()
    findings = []
    for name in table.keys():  # noqa: SIM118 - a DataFrame iterates over names too, a NamedTuple's dict as well
        base = base_name(str(name))
        if base not in DIMENSIONS or base in _ANY_SIZE:
            continue
        values = np.asarray(table[name], dtype=float).ravel()
        if not (finite := np.isfinite(values)).all():
            values = values[finite]
        if values.size and (finding := _finding(str(name), base, values, ambient_pressure)) is not None:
            findings.append(finding)
    return findings


def _time(name: str, time: np.ndarray) -> UnitFinding | None:
    steps = np.diff(time)
    steps = steps[steps > 0]
    if steps.size and (step := float(np.median(steps))) >= 0.99:
        return UnitFinding(name, f"{name} advances by {step:.4g} per sample: that looks like ms", "s")
    return None


def require_plausible(table: Mapping[str, Any], *, ambient_pressure: float = ATMOSPHERIC_PRESSURE, where: str) -> None:
    """Raise if signals are clearly not in SI."""
    findings = implausible_units(table, ambient_pressure=ambient_pressure)
    if not findings:
        return
    only_reference = all(f.reference for f in findings)
    kind = PressureReferenceError if only_reference else UnitError
    key = "gauge = true" if only_reference else "unit"
    raise kind(
        f"{where}: " + "; ".join(f"{f.found}" for f in findings) + ".",
        "; ".join(dict.fromkeys(f.expected for f in findings)),
        f"State {key} in the mapping of these signals, or override with check = false there "
        "(check_units=False for the whole log).",
    )


def check_units(table: Mapping[str, Any], *, ambient_pressure: float = ATMOSPHERIC_PRESSURE) -> list[UnitFinding]:
    """Warn of signals whose values are plainly not in SI; meant for the start of a fit.

    Parameters
    ----------
    table : DataFrame, State, or mapping of names to arrays
        Signals by name (``eps``, ``deps``, ``P``, ``dP``, ``F``, ...).
    ambient_pressure : float, default=101325.0
        Ambient pressure, Pa, absolute.

    Returns
    -------
    list of UnitFinding
        What was found; one `UnitWarning` has been issued for each.

    Examples
    --------
    >>> import warnings
    >>> from pamid.signals import check_units
    >>> with warnings.catch_warnings(record=True) as caught:
    ...     warnings.simplefilter("always")
    ...     found = check_units({"eps": [0.0, 12.0], "P": [2e5, 3e5]})
    >>> str(caught[0].message)
    'eps reaches 12: that looks like percent; expected the contraction ratio (below 1).'
    """
    findings = implausible_units(table, ambient_pressure=ambient_pressure)
    for finding in findings:
        warnings.warn(finding.text, UnitWarning, stacklevel=2)
    return findings
