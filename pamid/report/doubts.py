"""Whether an answer looks like a wrong unit, or like gauge pressure read as absolute: asked before anything else."""

import math
from typing import Any

import numpy as np
import pandas as pd

from ..constants import ATMOSPHERIC_PRESSURE
from ..gap.diagnosis.result import Diagnosis
from .quantities import amount
from .words import Words

NEAR = 0.1
"""How near, as a share, an offset comes to the ambient pressure, or a factor to a power of ten, to be asked about."""
_TOLD = 0.8  # share of the variance that a factor must explain
_FEW = 20  # windows
_FACTOR = "deviation"
"""Parameter of effects that are factors: gains, and numbers of a simulator."""


def question(d: Diagnosis) -> str:
    r"""Ask whether a pressure's reference or a unit is wrong.

    An offset is within 10 % of the ambient pressure (or its force), or a gain g is a power of ten,
    :math:`|\log_{10} g - k| < \log_{10} 1.1` with an integer :math:`k \ne 0`.
    """
    return _reference(d) or _unit(d)


def _reference(d: Diagnosis) -> str:
    ambient = _ambient(d.corrected)
    area = float(getattr(d.corrected, "area", 0.0) or 0.0)
    asked = "Is gauge pressure read as absolute, or the reverse?"
    for p in (p for cause in d.added for p in cause.parameters.values()):
        if p.unit == "Pa" and _close(p.value, ambient):
            return f"{asked} The offset of {amount(p.value, p.unit)} is close to the ambient pressure."
    off = float(d.windows["before"].mean()) if area and d.gap and len(d.windows) else 0.0
    if area and _close(off, area * ambient):
        return f"{asked} The force is off by {amount(off, 'N')}: the ambient pressure on {1e6 * area:.4g} mm²."
    return ""


def _ambient(simulator: Any) -> float:
    """Return the ambient pressure of a simulator, Pa."""
    values = getattr(simulator, "values", None)
    found = values() if callable(values) else values
    return float(found.get("atmospheric_pressure", ATMOSPHERIC_PRESSURE)) if found else ATMOSPHERIC_PRESSURE


def _close(value: float, size: float) -> bool:
    return abs(abs(value) - size) < NEAR * size


def _unit(d: Diagnosis) -> str:
    for name, part in d.windows.groupby("equation", sort=False) if len(d.windows) else ():
        y = part["measured"].to_numpy(dtype=float)
        x = y - part["before"].to_numpy(dtype=float)
        known = np.isfinite(x) & np.isfinite(y)
        x, y = x[known], y[known]
        if len(x) < _FEW or np.std(x) == 0 or np.std(y) == 0:
            continue
        r = float(np.corrcoef(x, y)[0, 1])
        gain = r * float(np.std(y) / np.std(x))
        power = round(math.log10(gain)) if gain > 0 else 0
        if power and r**2 > _TOLD and abs(gain / 10.0**power - 1.0) < NEAR and not _explained(d, part, 1.0 - r**2):
            what = f"The measured {Words.of(d).equation(str(name))}"
            return f"Is a unit wrong? {what} varies {gain:.3g} times as much as the simulated one."
    return ""


def _explained(d: Diagnosis, part: pd.DataFrame, left: float) -> bool:
    """Return whether causes that are no factors leave less than a factor does, as a share of the variance."""
    factors = any(_FACTOR in cause.parameters for cause in d.added)
    after, y = (part[name].to_numpy(dtype=float) for name in ("after", "measured"))
    return bool(d.added) and not factors and float(np.nanvar(after)) < left * float(np.nanvar(y))
