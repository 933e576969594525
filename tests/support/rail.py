"""A mass on a rail with dry friction that its simulator lacks."""

from __future__ import annotations

import numpy as np
import pandas as pd

from pamid.simulators import EquationSimulator, Port

LIBRARY = ["coulomb_friction", "quadratic_drag", "actuator_gain"]


def rail(tolerance: float = 0.05) -> EquationSimulator:
    """Return a mass on a rail with viscous friction."""
    ports = [Port("F", "input", "N"), Port("x", "state", "m"), Port("v", "state", "m/s")]
    numbers = {"m": (2.0, tolerance, "kg"), "c": (3.0, 0.0, "N s/m")}
    return EquationSimulator({"dx/dt": "v", "dv/dt": "(F - c*v)/m"}, ports, numbers)


def log_of(dry: float, mass: float = 2.0, size: float = 1.0, seed: int = 0) -> pd.DataFrame:
    """Return a log of the rail with dry friction, in N."""
    rng, runs = np.random.default_rng(seed), []
    for k in range(4):
        t, x, v = np.arange(0, 8, 0.01), [0.0], [0.0]
        force = size * (5 * np.sin((1 + k) * t) + 3 * np.sin(0.7 * t))
        for f in force[:-1]:
            w = v[-1]
            for _ in range(10):
                w += 0.001 * (f - 3.0 * w - dry * np.tanh(w / 0.005)) / mass
            x.append(x[-1] + 0.005 * (w + v[-1]))
            v.append(w)
        noisy = {"x": x + 1e-5 * rng.standard_normal(800), "v": v + 1e-3 * rng.standard_normal(800)}
        runs.append(pd.DataFrame({"trajectory": str(k), "time": t, "F": force, **noisy}))
    return pd.concat(runs, ignore_index=True)
