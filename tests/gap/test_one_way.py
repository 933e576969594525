"""Motion that never turns back: dry friction is then a steady force, and no log tells the two apart."""

from __future__ import annotations

import numpy as np
import pandas as pd

from pamid.gap import diagnose
from pamid.simulators import FunctionSimulator, Port

DRAG, ROLLING = 5e-4, 0.03


def rates(t, x, u, p):
    """Return the rate of a car that coasts, with the drag of air alone."""
    return [-p.drag * x.v * abs(x.v)]


def coasting() -> pd.DataFrame:
    """Return two runs from two speeds, with rolling resistance."""
    rng, runs = np.random.default_rng(2), []
    for run, v in enumerate((9.0, 7.5)):
        rows = []
        for _ in range(160):
            rows.append(v)
            for _ in range(10):
                v -= 0.1 * (DRAG * v * v + ROLLING)
        noisy = np.array(rows) + 0.03 * rng.standard_normal(len(rows))
        runs.append(pd.DataFrame({"trajectory": str(run), "time": np.arange(160.0), "v": noisy}))
    return pd.concat(runs, ignore_index=True)


def test_friction_of_a_motion_that_never_turns_is_named_beside_a_steady_force() -> None:
    car = FunctionSimulator(rates, [Port("v", "state", "m/s")], {"drag": (DRAG, 0.0, "1/m")})
    found = diagnose(coasting(), car, ["steady_force", "coulomb_friction", "viscous_friction", "hysteresis"])
    [cause] = found.causes
    assert set(cause.effects) == {"steady_force", "coulomb_friction"}
    sizes = {e: p for e, p in zip(cause.effects, (cause.parameters, *cause.others), strict=True)}

    assert abs(sizes["coulomb_friction"]["amplitude"].value - ROLLING) < 0.003
    assert abs(sizes["steady_force"]["size"].value + ROLLING) < 0.003
