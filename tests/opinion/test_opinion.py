"""A second opinion on fits: absorbed, open, held, off; files of other tools; the passport and other rigs."""

from __future__ import annotations

import json
import tomllib
from dataclasses import replace
from pathlib import Path

import pandas as pd
import pytest
from support.rail import LIBRARY, log_of, rail

from pamid.errors import ParameterError, SimulatorSyntaxError
from pamid.opinion import Opinion, Passport, read_fit, second_opinion
from pamid.opinion.estimates import estimates, freed
from pamid.opinion.judge import LEVEL
from pamid.simulators import EquationSimulator, Port, Simulator


@pytest.fixture(scope="module")
def absorbed() -> Opinion:
    return second_opinion(log_of(1.5), rail(), {"m": 2.02, "c": 4.4, "delay": 0.009}, LIBRARY)


def test_a_number_that_took_up_dry_friction_is_told(absorbed: Opinion) -> None:
    assert "c" in absorbed.absorbed and absorbed.missing == ["coulomb_friction@x"]
    c = next(j for j in absorbed.numbers if j.name == "c")
    assert c.value == pytest.approx(3.0, rel=0.03) and c.fitted == 4.4
    assert absorbed.unmatched == ("delay",)
    said = " ".join(absorbed.sentences())
    assert "c absorbed the missing physics: 4.4 as fitted" in said and "Missing in the simulator" in said


def test_a_clean_fit_is_not_accused() -> None:
    said = second_opinion(log_of(0.0), rail(), {"m": 2.0, "c": 3.0}, LIBRARY)
    assert not said.absorbed and not said.missing and {j.status for j in said.numbers} == {"holds"}
    assert said.sentences()[-1] == "No further run is needed."
    assert said.agreement > LEVEL and "disagree" not in " ".join(said.sentences())


def test_runs_that_disagree_about_a_number_are_told() -> None:
    parts = [log_of(0.0).query("trajectory < '2'"), log_of(0.0, mass=2.02, seed=5).query("trajectory > '1'")]
    said = second_opinion(pd.concat(parts).query("time < 4"), rail(), {"m": 2.01, "c": 3.0}, ["coulomb_friction"])
    assert said.agreement < LEVEL
    assert "Runs of this log disagree about the numbers (p < 1e-06)." in said.sentences()
    assert Passport.of(said).agreement == said.agreement


def test_a_fit_that_misses_the_log_is_off_and_one_outside_its_tolerance_absorbed() -> None:
    said = second_opinion(log_of(0.0), rail(), {"m": 2.4, "c": 3.3}, LIBRARY)
    found = {j.name: j.status for j in said.numbers}
    assert found == {"m": "absorbed", "c": "off"}, "2.4 kg is 20 % off what is known to 5 %"


def test_a_direction_that_the_log_leaves_open_is_a_combination() -> None:
    ports = [Port("F", "input", "N"), Port("v", "state", "m/s")]
    numbers = {"g": (2.0, 0.0, "-"), "c": (3.0, 0.0, "N s/m"), "m": (2.0, 0.0, "kg")}
    free = EquationSimulator({"dv/dt": "(g*F - c*v)/m"}, ports, numbers)
    log = log_of(0.0).assign(F=lambda d: d["F"] / 2.0)
    said = second_opinion(log, free, {"g": 2.0, "c": 3.0, "m": 2.0}, ["coulomb_friction"])
    assert not said.absorbed and {j.status for j in said.numbers} == {"open"}
    assert len(said.flat) == 1 and set(said.flat[0].weights) == {"g", "c", "m"}
    assert all(w == pytest.approx(1.0, abs=0.1) for w in said.flat[0].weights.values()), "all by the same share"
    assert said.next_run


# --- files ---------------------------------------------------------------------------------------------------
def test_files_of_other_tools_are_read(tmp_path: Path) -> None:
    sysid = "m: {name: m, value: [2.1], nominal: [2.0], min_value: [1.0], max_value: [3.0], frozen: false}\n"
    (tmp_path / "params_x_hat.yaml").write_text(sysid + "g: {value: [9.81], frozen: true}\n")
    fit = read_fit(tmp_path / "params_x_hat.yaml")
    assert set(fit.numbers) == {"m"} and fit.numbers["m"].value == 2.1 and fit.numbers["m"].upper == 3.0
    (tmp_path / "bam.json").write_text(json.dumps({"kt": 0.3, "friction_base": 0.01, "model": "m1"}))
    assert set(read_fit(tmp_path / "bam.json").numbers) == {"kt", "friction_base"}
    (tmp_path / "fit.toml").write_text("[parameters]\nm = { value = 2.2, unit = 'kg' }\n")
    assert read_fit(tmp_path / "fit.toml").of(rail()).numbers["m"].value == 2.2
    (tmp_path / "start_values.json").write_text(json.dumps({"m": "2.3", "c": 3.1, "on": True, "label": "fast"}))  # FMPy
    fit = read_fit(tmp_path / "start_values.json").of(rail())
    assert {k: v.value for k, v in fit.numbers.items()} == {"m": 2.3, "c": 3.1} and fit.unmatched == ()
    (tmp_path / "best.pt").write_bytes(b"x")
    with pytest.raises(SimulatorSyntaxError, match="can carry code"):
        read_fit(tmp_path / "best.pt")
    with pytest.raises(ParameterError, match="none of which is a parameter"):
        read_fit({"stiffness": 3.0}).of(rail())


ARM = """
<mujoco><compiler angle="radian"/><worldbody>
<body name="a"><joint name="hip" axis="0 1 0" damping="0.1"/><geom type="capsule" fromto="0 0 0 0 0 -.3" size=".02"/>
<body name="b" pos="0 0 -.3"><joint name="knee" axis="0 1 0"/><geom type="capsule" fromto="0 0 0 0 0 -.3" size=".02"/>
</body></body></worldbody></mujoco>
"""


def test_lists_by_joint_and_a_fitted_model_go_by_the_numbers_of_mujoco(tmp_path: Path) -> None:
    pytest.importorskip("mujoco")
    from pamid.simulators import MujocoSimulator

    (tmp_path / "arm.xml").write_text(ARM)
    arm = MujocoSimulator(tmp_path / "arm.xml")
    pace = {"joint_order": ["hip", "knee"], "armature": [0.01, 0.02], "viscous_friction": [0.1, 0.3], "delay": 0.0095}
    fit = read_fit(pace).of(arm)
    assert fit.numbers["dof_armature.knee"].value == 0.02 and fit.numbers["dof_damping.hip"].value == 0.1
    assert fit.unmatched == ("delay",)
    (tmp_path / "fitted.xml").write_text(ARM.replace('damping="0.1"', 'damping="0.4" frictionloss="0.02"'))
    fit = read_fit(tmp_path / "fitted.xml").of(arm)
    assert {k: v.value for k, v in fit.numbers.items()} == {"dof_damping.hip": 0.4, "dof_frictionloss.hip": 0.02}
    vector = {"joint_order": ["hip", "knee"], "mean": [0.01, 0.02, 0.1, 0.3, 0.4, 0.5, 0.0, 0.01, 4.2]}  # PACE's own
    fit = read_fit(vector).of(arm)
    assert fit.numbers["dof_frictionloss.hip"].value == 0.4 and fit.numbers["dof_damping.knee"].value == 0.3
    assert fit.unmatched == ("bias.hip", "bias.knee", "delay")


def test_gains_of_a_servo_are_numbers_of_it(tmp_path: Path) -> None:
    mujoco = pytest.importorskip("mujoco")
    from pamid.simulators import MujocoSimulator

    servo = '</worldbody><actuator><position name="act" joint="hip" kp="50" kv="2"/></actuator>'
    (tmp_path / "arm.xml").write_text(ARM.replace("</worldbody>", servo))
    arm = MujocoSimulator(tmp_path / "arm.xml")
    sysid = "act_pgain: {value: [23.0], frozen: false}\nact_dgain: {value: [0.7], frozen: false}\n"
    (tmp_path / "params_x_hat.yaml").write_text(sysid)
    fit = read_fit(tmp_path / "params_x_hat.yaml").of(arm)
    assert {k: v.value for k, v in fit.numbers.items()} == {"actuator_kp.act": 23.0, "actuator_kv.act": 0.7}
    gains = MujocoSimulator(tmp_path / "arm.xml", parameters={"actuator_kp.act": 23.0, "actuator_kv.act": 0.7})
    assert arm.own_numbers()["actuator_kp.act"].unit == "N m/rad"
    for model in (gains.compiled(), mujoco.MjModel.from_xml_string(gains.corrected_xml()[0])):
        assert model.actuator_gainprm[0, 0] == 23.0 and model.actuator_biasprm[0, 1:3].tolist() == [-23.0, -0.7]


# --- the passport --------------------------------------------------------------------------------------------
def test_the_passport_states_how_far_runs_agree() -> None:
    log = log_of(0.0)
    log["x"] = log["x"].round(2)  # so coarse that the speed shows the motion, and the runs differ by its noise
    said = second_opinion(log, rail(), {"m": 2.0, "c": 3.0}, ["coulomb_friction"])
    judged = freed(rail(), {j.name: j.value for j in said.numbers})
    computed = estimates(log, judged, ["m", "c"]).agreement
    stated = tomllib.loads(Passport.of(said).text())["passport"]["agreement_of_runs"]
    assert stated == pytest.approx(computed) and LEVEL < stated < 1.0
    one = estimates(log.query("trajectory == '0'"), judged, ["m", "c"]).agreement
    assert one != one, "a single run agrees with no other"
    assert "agreement_of_runs" not in Passport.of(replace(said, agreement=one)).text()


def test_a_second_rig_tests_the_passport(absorbed: Opinion) -> None:
    passport = Passport.of(absorbed, "first.csv")
    assert absorbed.diagnosis.corrected is not None
    model: Simulator = absorbed.diagnosis.corrected
    same = passport.check(log_of(1.5, seed=1), model, "same")
    assert set(same.rigs[0].status.values()) == {"agrees"} and not same.rigs[0].outside
    other = same.check(log_of(1.5, mass=2.3, size=1.5, seed=2), model, "other")
    assert other.rigs[1].status["m"] == "differs" and other.rigs[1].values["m"][0] == pytest.approx(2.3, rel=0.03)
    assert "F" in other.rigs[1].outside
    assert Passport.from_text(other.text()) == other
    page = other.page()
    assert page.startswith("<!doctype html>") and "differs" in page and "other leaves the range of F" in page
