"""A payload that a model of a robot leaves out: a mass at a place, and servos that are fast for the sampling."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from pamid.gap import diagnose_simulator
from pamid.gap.simulated import evidence_of
from pamid.simulators import page_text, read_simulator

mujoco = pytest.importorskip("mujoco")

from pamid.simulators.mujoco_model import MujocoSimulator  # noqa: E402

PLACE = 0.03, 0.02, -0.2
ARM = """<mujoco><compiler angle="radian"/><option timestep="0.002"/><worldbody><body name="upper">
<joint name="shoulder" axis="0 1 0" armature="0.02" damping="{damping}"/>
<geom type="capsule" fromto="0 0 0 0 0 -0.2" size="0.02" mass="0.4" contype="0" conaffinity="0"/>
<body name="lower" pos="0 0 -0.2"><joint name="elbow" axis="1 0 0" armature="0.02" damping="{damping}"/>
<geom type="capsule" fromto="0 0 0 0 0 -0.15" size="0.02" mass="0.2" contype="0" conaffinity="0"/>{more}</body></body>
</worldbody><actuator><position name="a" joint="shoulder" kp="{kp}"/>
<position name="b" joint="elbow" kp="{kp}"/></actuator></mujoco>"""
LOAD = '<body pos="{} {} {}"><inertial pos="0 0 0" mass="0.3" diaginertia="0 0 0"/></body>'.format(*PLACE)
SLOW, FAST = {"kp": 20, "damping": 1.5}, {"kp": 600, "damping": 3.0}
"""Servos of 10 Hz, and of 170 rad/s at 125 Hz of sampling."""
LIBRARY = ["payload", "parameter_deviation", "coulomb_friction", "viscous_friction", "sensor_gain", "resonance"]


def simulator_of(folder: Path, servo: dict[str, float]) -> MujocoSimulator:
    path = folder / "arm.xml"
    path.write_text(ARM.format(more="", **servo))
    return MujocoSimulator(path)


def log_of(servo: dict[str, float], step: float, more: str = LOAD, xml: str = "") -> pd.DataFrame:
    """Return a log at 125 Hz of a model that takes steps of its own."""
    model = mujoco.MjModel.from_xml_string(xml or ARM.format(more=more, **servo))
    model.opt.timestep = step
    data, rng, t = mujoco.MjData(model), np.random.default_rng(5), np.arange(0.0, 5.0, 0.008)
    u, rows = np.empty((2, len(t))), []
    for k in range(2):
        rate, phase = 2 * np.pi * rng.uniform(0.1, 0.8, 3), rng.uniform(0, 6, 3)
        u[k] = 0.3 * sum(np.sin(w * t + p) - np.sin(p) for w, p in zip(rate, phase, strict=True))
    for now in u.T:
        angle, speed = (x + s * rng.standard_normal(2) for x, s in ((data.qpos, 2e-5), (data.qvel, 2e-3)))
        rows.append([*now, *angle, *speed])
        data.ctrl[:] = now
        mujoco.mj_step(model, data, nstep=round(0.008 / step))
    names = ["a", "b", "shoulder_q", "elbow_q", "shoulder_dq", "elbow_dq"]
    return pd.DataFrame(rows, columns=names).assign(time=t, trajectory="walk")


@pytest.mark.parametrize("servo", [SLOW, FAST])
def test_a_payload_is_named_with_its_mass_and_its_place(tmp_path: Path, servo: dict[str, float]) -> None:
    found = diagnose_simulator(log_of(servo, 0.001), simulator_of(tmp_path, servo), LIBRARY)
    (cause,) = found.causes
    assert (cause.effects, cause.where) == (("payload",), ("lower",))
    assert cause.parameters["mass"].value == pytest.approx(0.3, rel=0.05)
    assert [cause.parameters[axis].value for axis in "xyz"] == pytest.approx(PLACE, abs=0.006)
    assert cause.parameters["mass"].unit == "kg" and cause.parameters["z"].unit == "m"


def test_a_servo_that_is_fast_for_the_sampling_has_no_gap_by_itself(tmp_path: Path) -> None:
    """Its joint follows a command within the sample: a sixth of the motion between rows is missed by their speeds."""
    simulator = simulator_of(tmp_path, FAST)
    assert diagnose_simulator(log_of(FAST, 0.001, ""), simulator, LIBRARY).verdict == "none"


def test_a_servo_that_is_too_stiff_shows_within_the_sample(tmp_path: Path) -> None:
    """Two readings of one motion disagree by what the drive does between rows: its gain is the cause, not theirs."""
    simulator = MujocoSimulator(simulator_of(tmp_path, FAST).path, parameters={"actuator_kp.b": 600.0})
    xml = ARM.format(more="", **FAST).replace('joint="elbow" kp="600"', 'joint="elbow" kp="440"')
    (cause,) = diagnose_simulator(log_of(FAST, 0.001, xml=xml), simulator, LIBRARY).causes
    assert cause.where == ("actuator_kp.b",)
    assert 600.0 * (1.0 + cause.parameters["deviation"].value) == pytest.approx(440.0, rel=0.03)


@pytest.mark.parametrize("step", [0.002, 0.001, 0.0005])
def test_the_step_of_a_model_is_found_where_it_matters(tmp_path: Path, step: float) -> None:
    evidence = evidence_of(log_of(FAST, step, ""), simulator_of(tmp_path, FAST))
    left = [float(np.sqrt(np.mean(np.square(evidence.z0[part])))) for part in evidence.parts]
    assert max(left) < 1.2
    assert any(f"{1e3 * step:g} ms" in note for note in evidence.notes) == (step != 0.002)


def test_a_payload_is_in_the_corrected_model_as_a_body(tmp_path: Path) -> None:
    plain, place = simulator_of(tmp_path, SLOW), dict(zip("xyz", PLACE, strict=True))
    loaded = plain.with_({"payload_mass.lower": 0.3, **{f"payload_{k}.lower": v for k, v in place.items()}})
    text, rest = loaded.corrected_xml()
    assert rest == []
    (tmp_path / "loaded.xml").write_text(text)
    (tmp_path / "true.xml").write_text(ARM.format(more=LOAD, **SLOW))
    rng = np.random.default_rng(0)
    x, u, t = rng.uniform(-1, 1, (4, 5)), rng.uniform(-1, 1, (4, 5)), np.zeros(5)
    p = np.repeat(loaded.numbers[:, None], 5, axis=1)
    wanted = MujocoSimulator(tmp_path / "true.xml")
    rates = wanted.rate(t, x, u, np.repeat(wanted.numbers[:, None], 5, axis=1))
    assert loaded.rate(t, x, u, p) == pytest.approx(rates, rel=1e-6)
    again = MujocoSimulator(tmp_path / "loaded.xml")
    assert again.rate(t, x, u, np.repeat(again.numbers[:, None], 5, axis=1)) == pytest.approx(rates, rel=1e-6)
    (tmp_path / "page.toml").write_text(page_text(loaded, tmp_path))
    assert read_simulator(tmp_path / "page.toml").get("payload_mass.lower") == 0.3
    unloaded = plain.rate(t, x, u, np.repeat(plain.numbers[:, None], 5, axis=1))
    assert not np.allclose(unloaded, rates, rtol=1e-2)


CENTRED = """<mujoco><worldbody>{bodies}</worldbody></mujoco>"""
BODY = """<body name="{name}" pos="{at} 0 0"><joint name="{name}_turns" axis="0 1 0" stiffness="15"/>
<inertial pos="{place}" mass="{mass}" diaginertia="0.01 0.02 0.03"/></body>"""


def test_a_body_that_turns_about_its_own_centre_may_carry_a_load_off_it(tmp_path: Path) -> None:
    """MuJoCo compiles such a body as a simple one, and refuses that another centre is set."""
    bodies = [BODY.format(name=n, at=k, place="0 0 0", mass=2) for k, n in enumerate("abc")]
    (tmp_path / "plain.xml").write_text(CENTRED.format(bodies="".join(bodies)))
    plain = MujocoSimulator(tmp_path / "plain.xml")
    loaded = plain.with_({"payload_mass.b": 1.0, "payload_x.b": 0.3, "payload_z.b": -0.3})
    more = '<body pos="0.3 0 -0.3"><inertial pos="0 0 0" mass="1" diaginertia="0 0 0"/></body></body>'
    bodies[1] = bodies[1].replace("</body>", more)
    (tmp_path / "true.xml").write_text(CENTRED.format(bodies="".join(bodies)))
    true = MujocoSimulator(tmp_path / "true.xml")
    rng = np.random.default_rng(0)
    x, u, t = rng.uniform(-1, 1, (6, 5)), rng.uniform(-1, 1, (3, 5)), np.zeros(5)
    loaded_rates, true_rates, plain_rates = (
        s.rate(t, x, u, np.repeat(s.numbers[:, None], 5, axis=1)) for s in (loaded, true, plain)
    )
    assert loaded_rates == pytest.approx(true_rates, rel=1e-6)
    assert not np.allclose(plain_rates, true_rates, rtol=1e-2)


def test_joints_that_a_body_was_compiled_with_as_independent_carry_no_payload(tmp_path: Path) -> None:
    body = """<body name="stage"><joint name="x" type="slide" axis="1 0 0"/><joint name="y" type="slide" axis="0 1 0"/>
    <inertial pos="0 0 0" mass="2" diaginertia="0.01 0.01 0.01"/></body>"""
    (tmp_path / "stage.xml").write_text(CENTRED.format(bodies=body))
    assert MujocoSimulator(tmp_path / "stage.xml").carried() == {}


def test_a_spring_that_is_too_stiff_is_the_number_of_its_joint(tmp_path: Path) -> None:
    xml = CENTRED.format(bodies=BODY.format(name="a", at=0, place="0 0 -0.1", mass=2))
    (tmp_path / "a.xml").write_text(xml)
    simulator = MujocoSimulator(tmp_path / "a.xml")
    own = simulator.own_numbers()["jnt_stiffness.a_turns"]
    assert (own.value, own.unit) == (15.0, "N m/rad")
    text, rest = MujocoSimulator(tmp_path / "a.xml", parameters={"jnt_stiffness.a_turns": 18.0}).corrected_xml()
    assert rest == [] and mujoco.MjModel.from_xml_string(text).jnt_stiffness[0] == 18.0
