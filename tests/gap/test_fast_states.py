"""A state that is not logged and faster than the sampling does not run away before its initial value is fitted."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from pamid.gap import diagnose_simulator
from pamid.simulators import FunctionSimulator, Port

DT, FRICTION, INERTIA = 2e-3, 3e-3, 4e-5
MOTOR = FunctionSimulator(
    lambda t, x, u, p: [(u.volt - p.R * x.i - p.K * x.w) / p.L, (p.K * x.i - p.b * x.w) / p.J],
    [Port("volt", "input", "V"), Port("i", "state", "A"), Port("w", "state", "rad/s")],
    {
        "R": (1.2, 0.1, "ohm"), "L": (4e-4, 0.1, "H"), "K": (0.05, 0.03, "N m/A"), "J": (INERTIA, 0.05, "kg m^2"),
        "b": (2e-5, 0.2, "N m s/rad"),
    },
)  # fmt: skip


def speed_log() -> pd.DataFrame:
    """Return the speed of the motor with dry friction: its current settles in a sixth of a sample."""
    rng, frames, fine = np.random.default_rng(1), [], 40
    for k in range(5):  # short runs, which are simulated side by side
        t = np.arange(80) * DT
        volt = 6.0 * np.sin(2 * np.pi * (4.0 + k) * t) + 3.0 * np.sin(2 * np.pi * 11.0 * t)
        i, w, rows = 0.0, 0.0, []
        for now in volt:
            rows.append(w)
            for _ in range(fine):
                i += DT / fine * (now - 1.2 * i - 0.05 * w) / 4e-4
                w += DT / fine * (0.05 * i - 2e-5 * w - FRICTION * np.tanh(w / 0.5)) / INERTIA
        w = np.array(rows) + 0.05 * rng.standard_normal(len(t))
        frames.append(pd.DataFrame({"trajectory": f"run {k}", "time": t, "volt": volt, "w": w}))
    return pd.concat(frames, ignore_index=True)


def test_dry_friction_of_a_motor_is_found_from_its_speed_alone() -> None:
    found = diagnose_simulator(speed_log(), MOTOR, ["coulomb_friction", "viscous_friction", "nonlinear_stiffness"])
    assert [c.effects for c in found.causes] == [("coulomb_friction",)]
    assert found.causes[0].parameters["amplitude"].value == pytest.approx(FRICTION / INERTIA, rel=0.05)
    assert found.closure[0].closed_share > 0.98
