"""The FMU of two tanks, compiled where the benchmark runs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from pamid.export.ode_fmu import ode_fmu


def build(folder: Path) -> Path:
    """Write ``tanks.fmu`` into a folder and return its path."""

    def rates(t: Any, x: Any, u: Any, p: Any) -> Any:
        upper = p.k2 * np.sqrt(np.maximum(x.h1, 1e-9))
        return [p.k1 * u.pump - upper, upper - p.k3 * np.sqrt(np.maximum(x.h2, 1e-9))]

    path = folder / "tanks.fmu"
    path.write_bytes(
        ode_fmu(
            "tanks", rates, {"h1": 3.0, "h2": 3.0}, {"pump": 0.0}, {"k1": 0.06, "k2": 0.05, "k3": 0.05},
            lambda t, x, u, p: {"level": x.h2}, substeps=4,
        )
    )  # fmt: skip
    return path
