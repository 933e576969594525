"""A leg as robots log it: position servos called as their joints, a clock called t, the rotor's inertia left out."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from pamid.cli import main
from pamid.gap import diagnose_simulator
from pamid.gap.residuals.choice import PULLED
from pamid.gap.simulated import evidence_of
from pamid.simulators import read_simulator

mujoco = pytest.importorskip("mujoco")

from pamid.simulators.mujoco_callback import MujocoCallbacks  # noqa: E402
from pamid.simulators.mujoco_model import MujocoSimulator  # noqa: E402

LEG = """
<mujoco><compiler angle="radian"/><worldbody><body name="shank"><joint name="knee" axis="0 1 0"{}/>
<geom type="capsule" fromto="0 0 0 0 0 -0.3" size="0.02" mass="0.4"/></body></worldbody>
<actuator><position name="knee" joint="knee" kp="8" kv="0.4"/></actuator></mujoco>
"""


@pytest.fixture(scope="module")
def leg(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("leg")
    (folder / "leg.xml").write_text(LEG.format(""))
    model = mujoco.MjModel.from_xml_string(LEG.format(' armature="0.02" damping="0.1"'))
    model.opt.timestep, model.opt.integrator = 0.001, mujoco.mjtIntegrator.mjINT_RK4
    rng, rows = np.random.default_rng(0), []
    for run in range(4):
        data = mujoco.MjData(model)
        for k in range(800):
            t = 0.005 * k
            u = 0.5 * np.sin((1 + run) * t) + 0.3 * np.sin(5.0 * t + run)
            angle, speed = data.qpos[0] + 1e-4 * rng.standard_normal(), data.qvel[0] + 5e-3 * rng.standard_normal()
            rows.append((f"walk {run}", t, np.degrees(u), np.degrees(angle), speed))
            data.ctrl[0] = u
            mujoco.mj_step(model, data, nstep=5)
    names = ["run", "t", "knee_des", "knee_pos", "knee_vel"]
    pd.DataFrame(rows, columns=names).to_csv(folder / "leg.csv", index=False)
    return folder


def _named(leg: Path) -> pd.DataFrame:
    """Return the log under the names of the model's ports, in radians."""
    names = {"run": "trajectory", "t": "time", "knee_des": "knee_ctrl", "knee_pos": "knee_q", "knee_vel": "knee_dq"}
    log = pd.read_csv(leg / "leg.csv").rename(columns=names)
    log[["knee_ctrl", "knee_q"]] = np.radians(log[["knee_ctrl", "knee_q"]])
    return log


def test_a_servo_that_is_fifty_times_too_stiff_is_named_with_its_gain(leg: Path) -> None:
    log = _named(leg)
    xml = LEG.format(' armature="0.02" damping="0.1"')
    (leg / "stiff.xml").write_text(xml.replace('kp="8"', 'kp="400"'))
    stiff = MujocoSimulator(leg / "stiff.xml", parameters={"actuator_kp.knee": 400.0})
    (cause,) = diagnose_simulator(log, stiff, ["parameter_deviation", "coulomb_friction", "sensor_bias"]).causes
    low, high = (400.0 * (1.0 + end) for end in cause.parameters["deviation"].ci90)
    assert cause.where == ("actuator_kp.knee",) and 6.5 < low < 8.0 < high < 9.5


def test_an_actuator_called_as_its_joint_is_an_input_of_its_own(leg: Path) -> None:
    simulator = MujocoSimulator(leg / "leg.xml")
    assert simulator.inputs == ("knee_ctrl", "knee_tau") and simulator.port("knee").kind == "joint"
    assert simulator.port("knee_ctrl").unit == "rad"
    still = simulator.rate(np.zeros(1), np.zeros((2, 1)), np.array([[0.1], [0.0]]), simulator.numbers[:, None])
    assert still[1, 0] > 0.0  # 8 N m/rad on 0.1 rad, the arm hanging down
    gained = simulator.with_(effects=[("actuator_gain", "knee_ctrl", {"deviation": 0.5})])
    text, rest = gained.corrected_xml()
    assert rest == []
    (leg / "gained.xml").write_text(text)
    x, u = np.array([[0.3], [0.0]]), np.array([[0.1], [0.0]])
    found = MujocoSimulator(leg / "gained.xml").rate(np.zeros(1), x, u, np.zeros((0, 1)))
    asked = simulator.rate(np.zeros(1), x, 1.5 * u, simulator.numbers[:, None])
    assert found[1, 0] == pytest.approx(asked[1, 0], rel=1e-6)  # the command counts more, what is fed back does not
    model = mujoco.MjModel.from_xml_path(str(leg / "leg.xml"))
    data = mujoco.MjData(model)
    data.ctrl[0] = 0.2
    with MujocoCallbacks(model, [("actuator_bias", "knee_ctrl", {"offset": 0.1})]):
        mujoco.mj_forward(model, data)
    assert data.actuator_force[0] == pytest.approx(8 * 0.3)


def test_a_robots_log_is_drafted_with_its_clock_its_runs_and_its_units(
    leg: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log, out = str(leg / "leg.csv"), leg / "setup"
    command = ["init", log, "--sim", str(leg / "leg.xml"), "--out", str(out), "--json"]
    assert main([*command, "--signal", "knee_ctrl=knee_des:deg", "--signal", "knee_q=knee_pos:deg"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["trajectories"] == [f"walk {k}" for k in range(4)]
    assert {k: v["column"] for k, v in said["signals"].items()} == {
        "time": "t", "knee_ctrl": "knee_des", "knee_q": "knee_pos", "knee_dq": "knee_vel",
    }  # fmt: skip
    assert "--trust" not in said["next"]
    options = ["--columns", str(out / "columns.toml"), "--sim", str(out / "sim.toml"), "--json"]
    found = ["--out", str(leg / "found"), "--effects", "added_inertia,viscous_friction,coulomb_friction,actuator_gain"]
    assert main(["diagnose", log, *options, *found]) == 0
    causes = json.loads(capsys.readouterr().out)["causes"]
    inertia = next(c for c in causes if c["effects"] == ["added_inertia"])
    assert inertia["where"] == ["knee"] and inertia["parameters"]["inertia"]["unit"] == "kg m^2"
    corrected = mujoco.MjModel.from_xml_path(str(leg / "found" / "corrected.xml"))
    assert corrected.dof_armature[0] == pytest.approx(0.02, rel=0.05)
    assert corrected.dof_damping[0] == pytest.approx(0.1, rel=0.1)
    page = read_simulator(leg / "found" / "corrected.toml")
    assert page.get("dof_armature.knee") == pytest.approx(corrected.dof_armature[0], rel=1e-5)


def test_no_joint_has_more_inertia_where_none_is_missing(leg: Path) -> None:
    """The same log against the model as it is."""
    (leg / "true.xml").write_text(LEG.format(' armature="0.02" damping="0.1"'))
    found = diagnose_simulator(_named(leg), MujocoSimulator(leg / "true.xml"), ["added_inertia", "parameter_deviation"])
    assert found.verdict == "none"


@pytest.mark.parametrize(("noise", "told"), [(0.02, False), (1.0, True)])
def test_noise_that_biases_a_parameter_is_told(leg: Path, noise: float, told: bool) -> None:
    """A model of MuJoCo is not simulated over stretches, as others then are."""
    page = leg / "page.toml"
    known = "\n".join(
        f'[parameters."{k}.knee"]\nvalue = {v}\ntolerance = 0.5'
        for k, v in (("actuator_kp", 8.0), ("dof_damping", 0.1))
    )
    page.write_text(f'kind = "mujoco"\n[mujoco]\nmodel = "true.xml"\n{known}\n')
    (leg / "true.xml").write_text(LEG.format(' armature="0.02" damping="0.1"'))
    log = _named(leg)
    log[["knee_q", "knee_dq", "knee_ctrl"]] *= 0.2  # a small motion
    log["knee_dq"] += noise * np.random.default_rng(1).standard_normal(len(log))
    log["knee_q"] = np.round(log["knee_q"], 2)  # steps too coarse for the position to show the motion
    assert (PULLED in evidence_of(log, read_simulator(page), refit=True).notes) == told
