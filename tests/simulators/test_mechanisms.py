"""Forces at joints that a mechanism couples: a damping coefficient shows how all of it responds."""

import numpy as np
import pandas as pd
import pytest

import pamid
from pamid.gap.simulated import evidence_of
from pamid.simulators import FunctionSimulator, Port
from pamid.simulators.damped import levers_of
from pamid.simulators.structure import JointPort

G, M1, M2, L1, L2, D1, D2 = 9.81, 0.3, 0.2, 0.25, 0.2, 2e-3, 1.5e-3
PORTS = [
    Port("a", "state", "rad"),
    Port("b", "state", "rad"),
    Port("va", "state", "rad/s"),
    Port("vb", "state", "rad/s"),
]


def mass(a, b):
    c = np.cos(a - b)
    return np.array([[(M1 + M2) * L1**2 + 0 * c, M2 * L1 * L2 * c], [M2 * L1 * L2 * c, M2 * L2**2 + 0 * c]])


def acceleration(x, torque):
    """Of a double pendulum with absolute angles, under torques on both."""
    a, b, va, vb = x
    s = np.sin(a - b)
    one = torque[0] - M2 * L1 * L2 * vb**2 * s - (M1 + M2) * G * L1 * np.sin(a)
    two = torque[1] + M2 * L1 * L2 * va**2 * s - M2 * G * L2 * np.sin(b)
    (m11, m12), (_, m22) = mass(a, b)
    det = m11 * m22 - m12 * m12
    return (m22 * one - m12 * two) / det, (m11 * two - m12 * one) / det


def rates(t, x, u, p):
    between = p.d2 * (x.vb - x.va)
    return [x.va, x.vb, *acceleration((x.a, x.b, x.va, x.vb), (between - p.d1 * x.va, -between))]


PENDULUM = FunctionSimulator(
    rates, PORTS, {"d1": (D1, 0.3, "N m s"), "d2": (D2, 0.3, "N m s"), "unused": (1.0, 0.0, "kg")}
)
JOINTS = [JointPort("a", "a", "va", "", "rad/s^2"), JointPort("b", "b", "vb", "", "rad/s^2")]


def log_of(friction, where, seed=0):
    """Free swings of the pendulum, with dry friction at its support or at its elbow; two encoders are read."""
    rng, runs, h = np.random.default_rng(seed), [], 1e-3
    count = 2 * np.pi / 16384

    def rate(x):
        between = D2 * (x[3] - x[2])
        t1, t2 = between - D1 * x[2], -between
        dry = friction * np.tanh((x[2] if where == "a" else x[3] - x[2]) / 5e-3)
        t1, t2 = (t1 - dry, t2) if where == "a" else (t1 + dry, t2 - dry)
        return np.array([x[2], x[3], *acceleration(x, (t1, t2))])

    for k in range(4):
        x, rows = np.array([rng.uniform(-1, 1), rng.uniform(-1.2, 1.2), 0.0, 0.0]), []
        for n in range(6000):
            if n % 4 == 0:
                rows.append(x[:2])
            one = rate(x)
            two = rate(x + 0.5 * h * one)
            three = rate(x + 0.5 * h * two)
            x = x + h / 6 * (one + 2 * two + 2 * three + rate(x + h * three))
        a, b = count * np.round(np.array(rows).T / count)
        runs.append(pd.DataFrame({"trajectory": str(k), "time": 4e-3 * np.arange(len(a)), "a": a, "b": b}))
    return pd.concat(runs, ignore_index=True)


def test_the_response_to_a_force_is_that_of_the_inverse_mass_matrix():
    rng = np.random.default_rng(1)
    x, u, t = rng.uniform(-1, 1, (4, 50)), np.zeros((0, 50)), np.zeros(50)
    found = {lever.velocities: lever for lever in levers_of(PENDULUM, JOINTS, t, x, u)}
    assert found.keys() == {("va",), ("va", "vb")}
    p = np.repeat(PENDULUM.numbers[:, None], 50, axis=1)
    for velocities, torque in ((("va",), (1.0, 0.0)), (("va", "vb"), (1.0, -1.0))):
        moved = found[velocities].rates(t, x, u, p)
        wanted = np.stack([np.linalg.solve(mass(a, b), torque) for a, b in x[:2].T], axis=1)
        assert found[velocities].unit == "N m" and np.allclose(moved[2:], wanted, rtol=1e-8) and not moved[:2].any()


def test_what_no_speed_alone_multiplies_is_no_damping():
    def drag(t, x, u, p):
        va, vb = acceleration((x.a, x.b, x.va, x.vb), (-p.c * x.va * np.abs(x.va), -p.k * x.b))
        return [x.va, x.vb, va, vb]

    other = FunctionSimulator(drag, PORTS, {"c": 1e-3, "k": 0.1})
    x = np.random.default_rng(1).uniform(-1, 1, (4, 50))
    assert levers_of(other, JOINTS, np.zeros(50), x, np.zeros((0, 50))) == []


def test_effects_at_a_coupled_joint_are_torques():
    places = evidence_of(log_of(0.0, "a"), PENDULUM).placements
    assert places["coulomb_friction@a"].units["amplitude"] == "N m"
    assert places["coulomb_friction@a and b"].units["amplitude"] == "N m"


@pytest.mark.parametrize("where", ["a", "a and b"])
def test_dry_friction_of_a_double_pendulum_is_named_with_its_torque(where):
    log = log_of(5e-3, where)
    found = pamid.diagnose(log, PENDULUM)
    [cause] = found.causes
    assert (cause.effects[0], cause.where, cause.grade) == ("coulomb_friction", (where,), "sure")
    assert abs(cause.parameters["amplitude"].value - 5e-3) < 3e-4
    before, after = (evidence_of(log, one) for one in (PENDULUM, found.corrected))
    assert np.std(after.raw(after.z0)) < 0.5 * np.std(before.raw(before.z0))
    assert np.median(np.abs(after.raw(after.z0))) < 0.9


def test_a_right_double_pendulum_has_no_gap():
    assert pamid.diagnose(log_of(0.0, "a", seed=3), PENDULUM).verdict == "none"
