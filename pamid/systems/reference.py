"""Whether a pressure is gauge or absolute, by the force that it makes; whether force, pressure and size agree."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd

from ..constants import ATMOSPHERIC_PRESSURE
from ..errors import PamidError
from ..signals.thinning import spaced

_TIMES = 3.0
"""How many times larger the error under one reading has to be than under the other: offsets of load cells and the
threshold of a bladder, a few tenths of a bar each, stay below that in informative runs."""
_GOOD = 0.15  # of the force's standard deviation: largest error of a credible reading
_LEAST = 50  # rows
_MOST = 20_000
_FAR = 3.0  # times: units are off by 9.8 and more, shapes of muscles by less


def zero_of_force(log: pd.DataFrame, zeros: Sequence[float] = (0.0, ATMOSPHERIC_PRESSURE)) -> float | None:
    r"""Return the pressure at which the force vanishes, :math:`F = (P - P_0)\,a(\varepsilon)` plus friction, or None.

    A candidate counts if it leaves little, and every other several times as much.
    """
    position = next((name for name in ("eps", "x") if name in log.columns), None)
    if position is None or not {"P", "F"} <= set(log.columns):
        return None
    known = log.dropna(subset=["time", "P", "F", position])
    known = known.iloc[spaced(len(known), _MOST)]
    F = known["F"].to_numpy(dtype=float)
    if len(known) < _LEAST or np.std(F) == 0:
        return None
    P, place = known["P"].to_numpy(dtype=float), known[position].to_numpy(dtype=float)
    way = _way(known, position)
    powers = [np.ones(len(F))]
    if position == "eps" and np.ptp(place) > 0.01:
        powers += [place, np.square(place)]
    left = []
    for zero in zeros:
        p = P - zero
        A = np.column_stack([*(p * power for power in powers), way, way * p])
        A /= np.maximum(np.abs(A).max(axis=0), 1e-300)
        left.append(float(np.sqrt(np.mean(np.square(F - A @ np.linalg.lstsq(A, F, rcond=None)[0])))))
    best, second = np.argsort(left, kind="stable")[:2]
    sure = left[best] < _GOOD * np.std(F) and left[second] > _TIMES * left[best]
    return zeros[best] if sure else None


def _way(log: pd.DataFrame, position: str) -> np.ndarray:
    """Return the direction of the motion, zero at rest."""
    parts = []
    for _, run in log.groupby("trajectory", sort=False):
        x = run[position].to_numpy(dtype=float)
        width = max(1, len(x) // 100)
        mean = np.convolve(np.pad(x, width, mode="edge"), np.ones(2 * width + 1) / (2 * width + 1), "valid")
        rate = np.gradient(mean) if len(x) > 1 else np.zeros(len(x))
        top = float(np.quantile(np.abs(rate), 0.99)) if len(x) else 0.0
        parts.append(np.tanh(rate / (0.1 * top)) if top > 0 else np.zeros(len(x)))
    return np.concatenate(parts)


def disagreement(log: pd.DataFrame, system: Any) -> str:
    """Say that the measured force is far from that of the nominal equation; nothing where the two roughly agree."""
    if not {"P", "F"} <= set(log.columns):
        return ""
    try:
        problem = system.problem(log.dropna().reset_index(drop=True))
        nominal = np.asarray(problem.nominal(problem.X), dtype=float)
    except PamidError:
        return ""
    power = float(nominal @ nominal)
    if len(nominal) < _LEAST or power == 0:
        return ""
    if not np.any(problem.y):
        return "The force reads 0 in all rows: its sensor is unplugged, or another column holds it"
    ratio = float(problem.y @ nominal) / power
    left = float(np.sqrt(np.mean(np.square(problem.y - ratio * nominal))))
    if left > 0.5 * float(np.sqrt(np.mean(np.square(problem.y)))) or 1 / _FAR < ratio < _FAR:
        return ""
    size = next((q.name for q in system.quantities if q.default is None and q.unit == "m"), "size")
    if ratio < 0:
        return (
            "The force has the opposite sign of what pressure and size make it: its sign, or the column or kind of the "
            "position (length or shortening), is wrong"
        )
    times = f"{ratio:.2g} times larger" if ratio > 1 else f"{1 / ratio:.2g} times smaller"
    return f"The force is {times} than pressure and size make it: a unit of F or P, or the {size}, is wrong"


def doubts(log: pd.DataFrame, system: Any) -> list[str]:
    """Return doubts about the units and the pressure reference of a tidy log, from force, pressure and size."""
    ambient = float(system.values.get("atmospheric_pressure", ATMOSPHERIC_PRESSURE))
    zero = zero_of_force(log, (ambient, 0.0, 2 * ambient))
    found = []
    if zero == 0.0:
        found.append(
            "The force vanishes one atmosphere below the ambient pressure: P seems to be gauge pressure that was taken "
            "for absolute (gauge = true in the mapping)."
        )
    elif zero == 2 * ambient:
        found.append(
            "The force vanishes one atmosphere above the ambient pressure: P seems to be absolute pressure that was "
            "taken for gauge (gauge = false in the mapping)."
        )
    elif said := disagreement(log, system):
        found.append(f"{said}.")
    return found
