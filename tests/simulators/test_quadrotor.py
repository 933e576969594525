"""A quadrotor seen from the side: two rotors push one body, and nothing pushes it along x."""

import numpy as np
import pandas as pd
import pytest

from pamid.gap import diagnose_simulator
from pamid.gap.simulated import evidence_of
from pamid.simulators import EquationSimulator, Port

M, INERTIA, ARM, DRAG = 1.2, 0.012, 0.18, 0.25
SIDEWAYS = EquationSimulator(
    {
        "dx/dt": "vx", "dz/dt": "vz", "dth/dt": "om",
        "dvx/dt": "-(F1 + F2)*sin(th)/m - cx*vx/m", "dvz/dt": "(F1 + F2)*cos(th)/m - 9.81 - cx*vz/m",
        "dom/dt": "(F2 - F1)*l/J",
    },
    [
        Port("F1", "input", "N"), Port("F2", "input", "N"), Port("x", "state", "m"), Port("z", "state", "m"),
        Port("th", "state", "rad"), Port("vx", "state", "m/s"), Port("vz", "state", "m/s"),
        Port("om", "state", "rad/s"),
    ],
    {"m": M, "J": INERTIA, "l": ARM, "cx": DRAG},
)  # fmt: skip


def flown(wind=0.0, lag=0.0, dry=0.0, seconds=15.0, seed=0):
    """Two controlled flights, by Euler steps of 1 ms; positions are logged, speeds are not."""
    rng, runs, dt, h = np.random.default_rng(seed), [], 0.01, 1e-3
    for k in range(2):
        s, got, rows = np.zeros(6), np.full(2, M * 9.81 / 2), []
        w, phase = 2 * np.pi * rng.uniform(0.05, 0.4, (2, 3)), rng.uniform(0, 6, (2, 3))
        for t in dt * np.arange(round(seconds / dt)):
            aim = np.sin(w * t + phase).sum(axis=1) * (0.5, 0.3)
            x, z, th, vx, vz, om = s
            tilt = np.clip(-np.clip(3 * (aim[0] - x) - 2.5 * vx, -3, 3) / 9.81, -0.5, 0.5)
            lift = np.clip(M * (9.81 + 6 * (aim[1] - z) - 4 * vz) / max(np.cos(th), 0.5), 2, 30)
            turn = INERTIA * (120 * (tilt - th) - 18 * om) / (2 * ARM)
            u = np.clip(lift / 2 + np.array([-turn, turn]), 0.1, 14)
            rows.append([t, *u, x, z, th])
            for _ in range(10):
                got = got + h / lag * (u - got) if lag else u
                up, side = got.sum() * np.cos(s[2]), -got.sum() * np.sin(s[2])
                rates = (side - DRAG * s[3]) / M + wind, (up - DRAG * s[4]) / M - 9.81 - dry * np.tanh(s[4] / 1e-2)
                s = s + h * np.array([*s[3:], *rates, (got[1] - got[0]) * ARM / INERTIA])
        table = pd.DataFrame(rows, columns=["time", "F1", "F2", "x", "z", "th"])
        table[["x", "z", "th"]] += 2e-3 * rng.standard_normal((len(table), 3))
        runs.append(table.assign(trajectory=str(k)))
    return pd.concat(runs, ignore_index=True)


def test_forces_at_the_body_are_none_of_a_rotor():
    evidence = evidence_of(flown(seconds=5.0), SIDEWAYS)
    assert {j.position: j.through for j in evidence.joints} == {"x": "", "z": "", "th": ""}
    assert {p.port for p in evidence.placements.values() if p.name == "steady_force"} == {"x", "z", "th"}


def test_a_steady_wind_is_named():
    found = diagnose_simulator(flown(wind=0.33), SIDEWAYS)
    assert [(c.effects, c.where) for c in found.causes] == [(("steady_force",), ("x",))]
    assert found.causes[0].parameters["size"].value == pytest.approx(0.33, rel=0.1)


def test_dry_friction_of_the_body_tilts_nothing():
    found = diagnose_simulator(flown(dry=0.5), SIDEWAYS)
    assert [(c.effects[0], c.where[0]) for c in found.causes] == [("coulomb_friction", "z")]
    assert found.causes[0].parameters["amplitude"].value == pytest.approx(0.5, rel=0.1)


def test_lags_of_both_rotors_are_told_from_slow_sensors():
    found = diagnose_simulator(flown(lag=0.04), SIDEWAYS)
    named = {(c.effects[0], c.where[0]): c.parameters["time_constant"].value for c in found.causes}
    assert named.keys() == {("actuator_lag", "F1"), ("actuator_lag", "F2")}
    assert list(named.values()) == pytest.approx([0.04, 0.04], rel=0.15)
