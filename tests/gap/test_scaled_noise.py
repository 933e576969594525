"""A fault that scales readings scales their noise: a residual that shrinks with it is no evidence."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from pamid.gap import diagnose_simulator
from pamid.gap.simulated import evidence_of
from pamid.simulators import FunctionSimulator, Port

INERTIA, DAMPING, FRICTION, DELAY = 1200.0, 900.0, 250.0, 6
LIBRARY = [
    "encoder_gain",
    "parameter_deviation",
    "coulomb_friction",
    "viscous_friction",
    "actuator_lag",
    "actuator_delay",
]


def rotor() -> FunctionSimulator:
    ports = [Port("i", "input", "A"), Port("q", "state", "rad"), Port("dq", "state", "rad/s")]
    numbers = {"k": (120.0, 0.0, "N m/A"), "b": (DAMPING, 0.1, "N m s/rad"), "J": (INERTIA, 0.05, "kg m^2")}
    return FunctionSimulator(lambda t, x, u, p: [x.dq, (p.k * u.i - p.b * x.dq) / p.J], ports, numbers)


@pytest.fixture(scope="module")
def log() -> pd.DataFrame:
    rng, runs, h, m = np.random.default_rng(1), [], 0.02, 10
    for run in range(3):
        t, q, v, rows = h * np.arange(500), 0.0, 0.0, []
        sines = zip((2.0, 2.0, 2.0, 1.5), (0.8, 2.3, 4.5, 8.2), rng.uniform(0.0, 2.0 * np.pi, 4), strict=True)
        u = 4.0 * np.sin((0.8 + 0.5 * run) * t) + sum(size * np.sin(w * t + phase) for size, w, phase in sines)
        for k in range(len(t)):
            rows.append((t[k], u[k], q, v))
            for _ in range(m):
                v += h / m * (120.0 * u[max(k - DELAY, 0)] - DAMPING * v - FRICTION * np.tanh(v / 4e-5)) / INERTIA
                q += h / m * v
        table = np.array(rows) + rng.standard_normal((len(t), 4)) * [0.0, 0.0, 1.7e-4, 1.7e-3]
        runs.append(pd.DataFrame(table, columns=["time", "i", "q", "dq"]).assign(trajectory=run))
    return pd.concat(runs, ignore_index=True)


def test_angles_and_inertias_that_are_scaled_alike_change_nothing(log: pd.DataFrame) -> None:
    evidence = evidence_of(log, rotor())
    larger = {name: {"deviation": 0.5} for name in ("encoder_gain@q", "parameter_deviation@J", "parameter_deviation@b")}
    np.testing.assert_allclose(evidence.z(larger), evidence.z0, atol=1e-3 * np.max(np.abs(evidence.z0)))
    nothing = np.zeros(len(evidence.free))
    np.testing.assert_allclose(evidence.slopes(larger, nothing)[:, 0], 0.0)  # of b, which its deviation contains
    np.testing.assert_allclose(evidence.spread(larger, nothing), 1.0)


def test_friction_and_delay_are_named_without_a_gain_that_inertia_and_damping_cancel(log: pd.DataFrame) -> None:
    found = diagnose_simulator(log, rotor(), LIBRARY)
    assert {c.effects[0] for c in found.causes} == {"coulomb_friction", "actuator_delay"}
