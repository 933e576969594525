"""Units of logs and their values in SI; the physical dimension of a signal's name."""

import re
from typing import NamedTuple

from pamid.constants import ATMOSPHERIC_PRESSURE, GRAVITY, REFERENCE_DENSITY

_NORMAL_DENSITY = 1.2929
"""Density of dry air at DIN 1343 normal conditions (0 °C, 1.01325 bar), kg/m³."""


class Unit(NamedTuple):
    """A unit: SI value = `factor` · value + `offset`."""

    dimension: str
    """Physical dimension, such as ``"pressure"``."""
    factor: float
    """SI units in one of this unit."""
    offset: float = 0.0
    """SI value of zero in this unit (°C only)."""
    gauge: bool | None = None
    """Pressure units only: True for gauge (``barg``), False for absolute (``bara``), None where the unit is silent."""


_INCH, _POUND, _DEGREE = 0.0254, 4.4482216152605, 0.017453292519943295
_NORMAL_LITRE, _REFERENCE_LITRE = _NORMAL_DENSITY * 1e-3, REFERENCE_DENSITY * 1e-3

UNITS_OF: dict[str, dict[str, float]] = {
    "time": {"s": 1, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "ns": 1e-9, "min": 60, "h": 3600},
    "pressure": {
        "Pa": 1,
        "hPa": 1e2,
        "kPa": 1e3,
        "MPa": 1e6,
        "bar": 1e5,
        "mbar": 1e2,
        "psi": 6894.757293168,
        "atm": ATMOSPHERIC_PRESSURE,
        "kgf/cm2": GRAVITY * 1e4,
        "N/cm2": 1e4,
        "mmHg": 133.322387415,
        "inHg": 3386.388640341,
        "mmH2O": GRAVITY,
        "cmH2O": GRAVITY * 10,
        "mH2O": GRAVITY * 1e3,
        "inH2O": GRAVITY * 25.4,
    },
    "length": {
        "m": 1,
        "dm": 0.1,
        "cm": 1e-2,
        "mm": 1e-3,
        "um": 1e-6,
        "µm": 1e-6,
        "in": _INCH,
        "inch": _INCH,
        "mil": _INCH * 1e-3,
        "ft": _INCH * 12,
        "km": 1e3,
    },
    "angle": {"rad": 1, "mrad": 1e-3, "deg": _DEGREE, "°": _DEGREE, "gon": 0.9 * _DEGREE, "rev": 360 * _DEGREE},
    "angular rate": {"rad/s": 1, "deg/s": _DEGREE, "°/s": _DEGREE, "rpm": 6 * _DEGREE, "rev/s": 360 * _DEGREE},
    "ratio": {"-": 1, "1": 1, "%": 1e-2, "percent": 1e-2, "‰": 1e-3},
    "ratio rate": {"1/s": 1, "%/s": 1e-2, "1/h": 1 / 3600},
    "pressure rate": {"Pa/s": 1, "kPa/s": 1e3, "bar/s": 1e5, "MPa/s": 1e6},
    "force": {
        "N": 1,
        "mN": 1e-3,
        "cN": 1e-2,
        "daN": 10,
        "kN": 1e3,
        "MN": 1e6,
        "kgf": GRAVITY,
        "gf": GRAVITY * 1e-3,
        "lbf": _POUND,
        "ozf": _POUND / 16,
    },
    "mass flow": {
        "kg/s": 1,
        "g/s": 1e-3,
        "mg/s": 1e-6,
        "kg/h": 1 / 3600,
        "kg/min": 1 / 60,
        "g/min": 1e-3 / 60,
        "L/min ANR": _REFERENCE_LITRE / 60,
        "L/s ANR": _REFERENCE_LITRE,
        "m3/h ANR": REFERENCE_DENSITY / 3600,
        "NL/min": _NORMAL_LITRE / 60,
        "NL/s": _NORMAL_LITRE,
        "NL/h": _NORMAL_LITRE / 3600,
        "Nm3/h": _NORMAL_DENSITY / 3600,
        "sccm": _NORMAL_LITRE * 1e-3 / 60,
    },
    "volume flow": {
        "m3/s": 1,
        "m3/h": 1 / 3600,
        "L/s": 1e-3,
        "L/min": 1e-3 / 60,
        "L/h": 1e-3 / 3600,
        "cm3/s": 1e-6,
        "mL/s": 1e-6,
        "mL/min": 1e-6 / 60,
    },
    "density": {"kg/m3": 1, "g/L": 1, "mg/L": 1e-3, "g/mL": 1e3, "g/cm3": 1e3},
    "concentration": {"mol/m3": 1, "mol/L": 1e3, "mmol/L": 1},
    "mass": {"kg": 1, "g": 1e-3, "lb": 0.45359237},
    "temperature": {"K": 1},
    "voltage": {"V": 1, "mV": 1e-3, "µV": 1e-6},
    "current": {"A": 1, "mA": 1e-3},
    "torque": {
        "N m": 1,
        "Nm": 1,
        "N cm": 1e-2,
        "Ncm": 1e-2,
        "N mm": 1e-3,
        "Nmm": 1e-3,
        "mN m": 1e-3,
        "mNm": 1e-3,
        "lbf in": _POUND * _INCH,
    },
    "speed": {
        "m/s": 1,
        "mm/s": 1e-3,
        "cm/s": 1e-2,
        "m/min": 1 / 60,
        "km/h": 1 / 3.6,
        "in/s": _INCH,
        "ft/s": 12 * _INCH,
        "mph": 0.44704,
    },
    "acceleration": {"m/s2": 1, "mm/s2": 1e-3},
    "frequency": {"Hz": 1, "kHz": 1e3},
    "angular acceleration": {"rad/s2": 1, "deg/s2": _DEGREE, "°/s2": _DEGREE},
    "area": {"m2": 1, "cm2": 1e-4, "mm2": 1e-6},
    "volume": {"m3": 1, "cm3": 1e-6, "mL": 1e-6},
    "power": {"W": 1, "kW": 1e3},
}
"""Units of each dimension with their factors to SI; the first one is the SI unit."""
SI_UNITS = {dimension: next(iter(units)) for dimension, units in UNITS_OF.items()}

UNITS: dict[str, Unit] = {
    name: Unit(dimension, factor) for dimension, units in UNITS_OF.items() for name, factor in units.items()
}
UNITS |= {
    name + suffix: unit._replace(gauge=suffix == "g")
    for name, unit in list(UNITS.items())
    if unit.dimension == "pressure" and "/" not in name
    for suffix in "ga"
}
UNITS["degC"] = UNITS["°C"] = Unit("temperature", 1.0, 273.15)
UNITS["°F"] = Unit("temperature", 5 / 9, 273.15 - 32 * 5 / 9)
"""Every known unit by name. ``L/min ANR`` follows ISO 8778 (1.185 kg/m³), ``NL/min`` DIN 1343 (1.2929 kg/m³)."""

_SIGNALS = {
    "time": "time",
    "pressure": "P p p_gauge P_supply",
    "pressure rate": "dP",
    "force": "F",
    "ratio": "eps u",
    "ratio rate": "deps",
    "angle": "q",
    "angular rate": "dq",
    "mass flow": "mdot",
    "length": "L length rest_length x stroke",
    "temperature": "T",
    "mass": "load_mass",
}
DIMENSIONS = {name: dimension for dimension, names in _SIGNALS.items() for name in names.split()}


def base_name(signal: str) -> str:
    """Remove the muscle's number and the suffix of a reference: ``P1`` and ``P_ref`` both are ``P``."""
    if signal in DIMENSIONS:
        return signal
    return re.sub(r"(_ref|_cmd|_set)$", "", re.sub(r"_?\d+$", "", re.sub(r"(_ref|_cmd|_set)$", "", signal)))


def dimension_of(signal: str) -> str | None:
    """Return the physical dimension of a signal's name; None if the name does not show it."""
    return DIMENSIONS.get(base_name(signal))


def is_gauge_name(signal: str) -> bool:
    """Return whether a name stands for gauge pressure (``p``, ``p1``, ``p_gauge``); ``P`` is absolute."""
    return base_name(signal) in ("p", "p_gauge")
