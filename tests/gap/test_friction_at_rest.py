"""Dry friction of what often rests: the noise of speeds hides its sign in the equations, predictions show it."""

import numpy as np
import pandas as pd

from pamid.gap import diagnose_simulator
from pamid.simulators import EquationSimulator, Port

DT, MASS, LIFTED, DRY = 0.02, 2200.0, 2350.0, 380.0
STOPS = ((0.0, 0.0), (4.0, 9.0), (16.0, 3.0), (30.0, 12.0), (48.0, 6.0))


def hoist(rows: int = 3000) -> pd.DataFrame:
    """Return a log of a lift with a counterweight that stands at floors, under a noisy controller."""
    rng, wanted_z, wanted_v, z, v, total, out = np.random.default_rng(11), 0.0, 0.0, 0.0, 0.0, 0.0, []
    for k in range(rows):
        floor = [z for begin, z in STOPS if begin <= k * DT][-1]
        read_z, read_v = z + 0.012 * rng.standard_normal(), v + 0.004 * rng.standard_normal()
        wanted_v += float(np.clip(np.clip(1.1 * (floor - wanted_z), -1.6, 1.6) - wanted_v, -0.8 * DT, 0.8 * DT))
        wanted_z += wanted_v * DT
        off = wanted_v - read_v + 0.8 * (wanted_z - read_z)
        total = float(np.clip(total + off * DT, -5.0, 5.0))
        push = round(4000.0 * off + 2300.0 * total + 0.9 * LIFTED, 1)
        out.append((k * DT, push, read_z, read_v))
        for _ in range(80):
            v += DT / 80 * (push - LIFTED - DRY * np.tanh(v / 0.002)) / MASS
            z += DT / 80 * v
    return pd.DataFrame(out, columns=["time", "push", "z", "v"])


def test_dry_friction_of_a_hoist_that_stands_at_floors_is_named_without_reservations():
    ports = [Port("push", "input", "N"), Port("z", "state", "m"), Port("v", "state", "m/s")]
    simulator = EquationSimulator({"dz/dt": "v", "dv/dt": "(push - w)/m"}, ports,
                                  {"m": (MASS, 0.05, "kg"), "w": (LIFTED, 0.0, "N")})  # fmt: skip
    effects = ["coulomb_friction", "viscous_friction", "steady_force", "actuator_gain", "parameter_deviation"]
    found = diagnose_simulator(hoist(), simulator, effects, seed=0)
    assert [cause.effects[0] for cause in found.causes] == ["coulomb_friction"] and not found.with_reserve
    assert abs(found.causes[0].parameters["amplitude"].value / DRY - 1.0) < 0.05
