"""A corrected MuJoCo model runs in MuJoCo itself: what MJCF has no element for acts as a callback."""

import importlib.util

import numpy as np
import pandas as pd
import pytest

mujoco = pytest.importorskip("mujoco")

from pamid.cli import main  # noqa: E402
from pamid.simulators.mujoco_callback import MujocoCallbacks  # noqa: E402

ARM = """
<mujoco><compiler angle="radian"/><option timestep="0.002" integrator="RK4"/>
<worldbody><body name="arm"><joint name="hinge" axis="0 1 0"/>
<geom type="capsule" fromto="0 0 0 0 0 -0.3" size="0.02" mass="0.5"/></body></worldbody>
<actuator><motor name="motor" joint="hinge"/></actuator></mujoco>
"""
SAMPLES, DT = 400, 0.01


def currents(run):
    t = DT * np.arange(SAMPLES)
    return 0.5 * np.sin((1 + run) * t) + 0.4 * np.sin(3.1 * t + run)


def swung(model, u, before_step):
    data, rows = mujoco.MjData(model), []
    for current in u:
        rows.append((data.qpos[0], data.qvel[0]))
        for _ in range(5):
            data.ctrl[0] = current
            before_step(data)
            mujoco.mj_step(model, data)
    return np.array(rows)


def dragged(data):
    data.qfrc_applied[0] = -0.03 * data.qvel[0] * abs(data.qvel[0])


def weakened(data):
    data.ctrl[0] = np.sign(data.ctrl[0]) * max(abs(data.ctrl[0]) - 0.2, 0.0)


@pytest.mark.parametrize(("acts", "effect"), [(dragged, "quadratic_drag"), (weakened, "actuator_dead_zone")])
def test_running_the_corrected_model_closes_what_the_report_said(tmp_path, monkeypatch, capsys, acts, effect):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "arm.xml").write_text(ARM)
    model, rng, runs = mujoco.MjModel.from_xml_string(ARM), np.random.default_rng(0), []
    for run in range(4):
        angle, speed = swung(model, currents(run), acts).T
        noisy = {
            "hinge_q": angle + 1e-4 * rng.standard_normal(SAMPLES),
            "hinge_dq": speed + 5e-3 * rng.standard_normal(SAMPLES),
        }
        t = DT * np.arange(SAMPLES)
        runs.append(pd.DataFrame({"trajectory": str(run), "time": t, "motor": currents(run), **noisy}))
    pd.concat(runs).to_csv("arm.csv", index=False)
    few = f"{effect},coulomb_friction,actuator_gain"
    assert main(["diagnose", "arm.csv", "--sim", "arm.xml", "--out", "found", "--effects", few]) == 0
    capsys.readouterr()
    spec = importlib.util.spec_from_file_location("corrected", tmp_path / "found" / "corrected.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    corrected, acting = module.load()

    truth = swung(model, currents(7), acts)  # a run that nobody has seen
    plain = swung(model, currents(7), lambda data: None)
    with acting:
        closed = swung(corrected, currents(7), lambda data: None)
    off = [float(np.sqrt(np.mean(np.square(found[:, 0] - truth[:, 0])))) for found in (plain, closed)]
    assert off[1] < 0.1 * off[0]
    # Outside of it nothing acts.
    assert np.array_equal(swung(model, currents(7), lambda data: None), plain)


@pytest.mark.parametrize(
    ("effect", "own"),
    [
        (("actuator_dead_zone", {"width": 0.2, "stretch": 0.0, "skew": 0.0, "rounding": 0.0}),
         lambda u: np.sign(u) * max(abs(u) - 0.2, 0.0)),
        (("actuator_gain", {"deviation": 0.25}), lambda u: 1.25 * u),
    ],
)  # fmt: skip
def test_a_fault_of_an_actuator_acts_on_what_is_asked_once(effect, own):
    model = mujoco.MjModel.from_xml_string(ARM)
    u = currents(2)
    with MujocoCallbacks(model, [(effect[0], "motor", effect[1])]):
        found = swung(model, u, lambda data: None)
    assert np.allclose(found, swung(model, [own(v) for v in u], lambda data: None), atol=1e-9)


def test_a_dead_zone_needs_no_value_that_its_port_hides():
    model = mujoco.MjModel.from_xml_string(ARM)
    with MujocoCallbacks(model, [("actuator_dead_zone", "motor", {"width": 0.9, "skew": 0.0})]):
        acted = swung(model, currents(3), lambda data: None)
    dead = np.sign(currents(3)) * np.maximum(np.abs(currents(3)) - 0.9, 0.0)
    assert np.allclose(acted, swung(model, dead, lambda data: None), atol=1e-9)
