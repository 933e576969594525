"""Whether forces, flows and pressures of a log are consistent: the piston and the volume that they imply."""

import re

import numpy as np
import pandas as pd

from ..constants import ATMOSPHERIC_PRESSURE, GAS_CONSTANT, TEMPERATURE
from ..signals.units import base_name, is_gauge_name

_LEAST_PISTON = 2e-6
"""m²: a seventh of what a muscle of 2 mm makes at 4 bar (6 N); in kN a muscle of 30 mm comes as far."""
_LARGEST_VOLUME = 5e-3
"""m³: five times that of the largest muscles sold (40 mm by 0.5 m, bulged); in g/s one of 5 mL comes as far."""
_LEAST_RISE = 2e4  # Pa above the ambient pressure, below which nothing can be told


def scale_doubts(log: pd.DataFrame) -> list[str]:
    """List the forces and flows of a log that are far from what its pressures can make, for any muscle."""
    found = []
    for pressure in (c for c in map(str, log.columns) if base_name(c) in ("P", "p", "p_gauge") and _is_reading(c)):
        P = log[pressure].to_numpy(dtype=float)
        gauge = P if is_gauge_name(pressure) else P - ATMOSPHERIC_PRESSURE
        top = float(np.nanmax(gauge)) if np.isfinite(gauge).any() else 0.0
        if top < _LEAST_RISE:
            continue
        number = "".join(re.findall(r"\d+$", pressure))
        if (force := f"F{number}") in log.columns:
            found += _force_doubt(log[force].to_numpy(dtype=float), force, pressure, top)
        if (flow := f"mdot{number}") in log.columns:
            found += _flow_doubt(log, flow, pressure, top + ATMOSPHERIC_PRESSURE)
    return found


def _is_reading(column: str) -> bool:
    return not column.endswith(("_ref", "_cmd", "_set"))


def _force_doubt(F: np.ndarray, force: str, pressure: str, top: float) -> list[str]:
    known = np.abs(F[np.isfinite(F)])
    largest = float(known.max()) if len(known) else 0.0
    if not 0 < largest < _LEAST_PISTON * top:
        return []
    return [
        f"{force} stays below {largest:.3g} N while {pressure} reaches {top / 1e5:.3g} bar above the ambient pressure, "
        f"as if the piston had {1e6 * largest / top:.2g} mm²: either nothing pulls, or {force} is in kN."
    ]


def _flow_doubt(log: pd.DataFrame, flow: str, pressure: str, top: float) -> list[str]:
    from scipy.integrate import cumulative_trapezoid

    volume = 0.0
    for _, run in log.groupby("trajectory", sort=False):
        known = run.dropna(subset=["time", flow])
        t, mdot = known["time"].to_numpy(dtype=float), known[flow].to_numpy(dtype=float)
        if len(t) < 3:
            continue
        mass = cumulative_trapezoid(mdot, t, initial=0.0)
        held = mass - np.polynomial.Polynomial.fit(t, mass, 1)(t)  # leaked gas is not stored
        volume = max(volume, GAS_CONSTANT * TEMPERATURE * float(np.ptp(held)) / top)
    if volume < _LARGEST_VOLUME:
        return []
    return [
        f"The gas that {flow} moves takes {1e3 * volume:.3g} L at the pressures of {pressure}: {flow} seems not to be "
        "in kg/s, but for instance in g/s."
    ]
