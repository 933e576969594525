"""What acts at all times alike where no input acts: an inflow of the second tank, a source of heat behind a wall."""

import numpy as np
import pandas as pd
import pytest

from pamid.gap import diagnose_simulator
from pamid.simulators import EquationSimulator, Port

TANKS = EquationSimulator(
    {"dh1/dt": "0.02*u - 0.03*sqrt(h1)", "dh2/dt": "0.03*sqrt(h1) - 0.025*sqrt(h2)"},
    [Port("u", "input", "V"), Port("h1", "state", "m"), Port("h2", "state", "m")],
    {},
)
ROOMS = EquationSimulator(
    {"dT1/dt": "1e-4*P - 2e-3*(T1 - T2) - 1e-3*(T1 - 10)", "dT2/dt": "1e-3*(T1 - T2) - 5e-4*(T2 - 10)"},
    [Port("P", "input", "W"), Port("T1", "state", "degC"), Port("T2", "state", "degC")],
    {},
)


def run(rate, start, drive, dt, rows, noise, names):
    """Two runs by Euler steps of a tenth of a sample."""
    rng, runs = np.random.default_rng(0), []
    for k in range(2):
        x, out = np.array(start, dtype=float), []
        held = drive(rng, rows)
        for i in range(rows):
            out.append([i * dt, held[i], *x])
            for _ in range(10):
                x = x + 0.1 * dt * np.array(rate(x, held[i]))
        table = np.array(out)
        table[:, 2:] += noise * rng.standard_normal((rows, 2))
        runs.append(pd.DataFrame(table, columns=["time", *names]).assign(trajectory=str(k)))
    return pd.concat(runs, ignore_index=True)


def steps(low, high):
    return lambda rng, rows: np.repeat(rng.uniform(low, high, rows // 50), 50)


def test_a_steady_inflow_is_named():
    def rate(h, u):
        h = np.maximum(h, 0.0)
        return 0.02 * u - 0.03 * np.sqrt(h[0]), 0.03 * np.sqrt(h[0]) - 0.025 * np.sqrt(h[1]) + 0.004

    log = run(rate, (0.5, 0.6), steps(0.6, 1.6), 1.0, 600, 2e-3, ("u", "h1", "h2"))
    found = diagnose_simulator(log, TANKS)
    assert (found.causes[0].effects[0], found.causes[0].where[0]) == ("steady_inflow", "h2")
    assert found.causes[0].parameters["size"].value == pytest.approx(0.004, rel=0.1)


def test_a_steady_source_of_heat_is_named():
    def rate(T, P):
        return 1e-4 * P - 2e-3 * (T[0] - T[1]) - 1e-3 * (T[0] - 10), 1e-3 * (T[0] - T[1]) - 5e-4 * (T[1] - 10) + 2e-3

    log = run(rate, (16.0, 13.0), steps(0.0, 600.0), 30.0, 800, 0.02, ("P", "T1", "T2"))
    found = diagnose_simulator(log, ROOMS)
    assert ("steady_heating", "T2") in zip(found.causes[0].effects, found.causes[0].where, strict=True)


CART_POLE = """<mujoco><option timestep="0.002"/><worldbody><body>
<joint name="cart" type="slide" axis="1 0 0" damping="0.5"/>
<geom type="box" size="0.1 0.05 0.05" mass="1" contype="0" conaffinity="0"/>
<body><joint name="pole" axis="0 1 0" damping="0.02"/>
<geom type="capsule" fromto="0 0 0 0 0 -0.6" size="0.02" mass="0.4" contype="0" conaffinity="0"/>
</body></body></worldbody>
<actuator><motor name="push" joint="cart" gear="1"/></actuator></mujoco>"""


def test_a_steady_torque_at_a_joint_without_a_drive_is_named(tmp_path):
    mujoco = pytest.importorskip("mujoco")
    from pamid.simulators.mujoco_model import MujocoSimulator

    (tmp_path / "cart.xml").write_text(CART_POLE)
    rng, model, runs = np.random.default_rng(1), mujoco.MjModel.from_xml_string(CART_POLE), []
    model.opt.timestep = 0.001
    for k in range(2):
        data, rows = mujoco.MjData(model), []
        for i in range(800):
            push = 3.0 * np.sin((2 + k) * 0.01 * i) + 2.0 * np.sin(4.1 * 0.01 * i + k)
            rows.append([0.01 * i, push, *data.qpos])
            data.ctrl[0], data.qfrc_applied[1] = push, 0.05
            mujoco.mj_step(model, data, 10)
        table = pd.DataFrame(rows, columns=["time", "push", "cart_q", "pole_q"])
        table[["cart_q", "pole_q"]] += 2e-4 * rng.standard_normal((800, 2))
        runs.append(table.assign(trajectory=str(k)))
    found = diagnose_simulator(pd.concat(runs, ignore_index=True), MujocoSimulator(tmp_path / "cart.xml"))
    assert [(c.effects[0], c.where[0]) for c in found.causes] == [("steady_force", "pole")]
    assert found.causes[0].parameters["size"].value == pytest.approx(0.05, rel=0.1)
