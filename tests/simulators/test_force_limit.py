"""A servo whose force saturates: the limit is a number of the model, and an effect where the model has none."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from support.servo_logs import servo_log

from pamid.effects.limits import ForceLimit
from pamid.gap import diagnose_simulator
from pamid.gap.simulated import evidence_of
from pamid.simulators import page_text, port_effects, read_simulator

mujoco = pytest.importorskip("mujoco")

from pamid.simulators.mujoco_model import MujocoSimulator  # noqa: E402

ARM = """<mujoco><option timestep="0.0005"/><worldbody><body>
<joint name="arm" axis="0 1 0" armature="0.01" damping="0.2"/>
<geom type="capsule" fromto="0 0 0 0 0 -0.2" size="0.01" mass="0.2" contype="0" conaffinity="0"/></body></worldbody>
<actuator>{}</actuator></mujoco>"""
SERVO = '<position name="servo" joint="arm" kp="9" kv="0.2"{}/>'
WEAK = SERVO.format(' forcerange="-0.45 0.45" forcelimited="true"')
LIBRARY = ["force_limit", "parameter_deviation", "actuator_saturation", "actuator_slew_rate", "coulomb_friction",
           "viscous_friction", "hysteresis"]  # fmt: skip


def simulator_of(folder: Path, actuator: str = SERVO.format("")) -> MujocoSimulator:
    path = folder / "arm.xml"
    path.write_text(ARM.format(actuator))
    return MujocoSimulator(path)


def log_of(actuator: str, rows: int = 800) -> pd.DataFrame:
    return servo_log(mujoco.MjModel.from_xml_string(ARM.format(actuator)), amplitude=0.4, rows=rows)


def rates(simulator: MujocoSimulator, x: np.ndarray, u: np.ndarray) -> np.ndarray:
    n = x.shape[1]
    return simulator.rate(np.zeros(n), x, u, np.repeat(simulator.numbers[:, None], n, axis=1))


def test_the_tighter_of_two_limits_acts():
    limit = ForceLimit(limit=2.0)
    assert limit.adjust({"value": 0.0})["value"] == 2.0  # 0 is none
    assert limit.adjust({"value": 1.5})["value"] == 1.5
    assert limit.adjust({"value": 4.0})["value"] == 2.0
    assert port_effects()["force_limit"] == ("parameter", ForceLimit)


def test_a_limit_as_a_number_is_that_of_the_model(tmp_path):
    plain = simulator_of(tmp_path)
    assert plain.limits() == ("actuator_forcerange.servo",) and plain.get("actuator_forcerange.servo") == 0.0
    limited = plain.with_({"actuator_forcerange.servo": 0.45})
    (tmp_path / "weak").mkdir()
    true = simulator_of(tmp_path / "weak", WEAK)
    assert true.get("actuator_forcerange.servo") == 0.45
    x, u = np.random.default_rng(0).uniform(-1, 1, (2, 400)), np.random.default_rng(1).uniform(-1, 1, (2, 400))
    for _ in range(6):  # often enough for the pieces of the motion to be kept, with and without a limit in turn
        assert rates(limited, x, u) == pytest.approx(rates(true, x, u), rel=1e-9)
        assert not np.allclose(rates(plain, x, u), rates(true, x, u))


def test_the_largest_force_is_that_of_the_log(tmp_path):
    simulator = simulator_of(tmp_path)
    x, u = np.array([[0.1, 0.2], [0.0, 1.0]]), np.array([[0.5, -0.3], [0.0, 0.0]])
    (found,) = simulator.limited(x, u).values()
    assert found.largest == pytest.approx(9 * 0.5 + 0.2)


def test_a_limit_is_in_the_corrected_model_and_in_the_file(tmp_path):
    limited = simulator_of(tmp_path).with_({"actuator_forcerange.servo": 0.45})
    text, rest = limited.corrected_xml()
    model = mujoco.MjModel.from_xml_string(text)
    assert rest == [] and model.actuator_forcelimited[0] and model.actuator_forcerange[0].tolist() == [-0.45, 0.45]
    (tmp_path / "page.toml").write_text(page_text(limited, tmp_path))
    assert read_simulator(tmp_path / "page.toml").get("actuator_forcerange.servo") == 0.45
    assert "forcerange" not in page_text(simulator_of(tmp_path), tmp_path)


def test_a_range_about_another_centre_keeps_its_shape(tmp_path):
    simulator = simulator_of(tmp_path, SERVO.format(' forcerange="-1 3" forcelimited="true"'))
    assert simulator.get("actuator_forcerange.servo") == 3.0
    changed = simulator.with_({"actuator_forcerange.servo": 1.5})
    assert mujoco.MjModel.from_xml_string(changed.corrected_xml()[0]).actuator_forcerange[0].tolist() == [-0.5, 1.5]


def test_the_effect_is_where_no_limit_is_and_where_no_command_says_it(tmp_path):
    def places(actuator: str, name: str) -> list[str]:
        log = log_of(actuator, 100)
        there = evidence_of(log, simulator_of(tmp_path, actuator)).placements.values()
        return [p.port for p in there if p.name == name]

    assert places(SERVO.format(""), "force_limit") == ["servo"]
    assert places(WEAK, "force_limit") == []  # a wrong number then
    assert "actuator_forcerange.servo" in places(WEAK, "parameter_deviation")
    motor = '<motor name="servo" joint="arm"/>'
    assert places(motor, "force_limit") == [] and places(motor, "actuator_saturation") == ["servo"]


def test_a_servo_that_is_too_weak_is_named_with_its_torque(tmp_path):
    found = diagnose_simulator(log_of(WEAK), simulator_of(tmp_path), LIBRARY)
    (cause,) = found.causes
    assert (cause.effects, cause.where, cause.grade) == (("force_limit",), ("servo",), "sure")
    assert cause.parameters["limit"].value == pytest.approx(0.45, rel=0.03) and cause.parameters["limit"].unit == "N m"
    assert found.corrected.get("actuator_forcerange.servo") == pytest.approx(0.45, rel=0.03)


def test_a_servo_that_is_as_strong_as_the_model_says_has_none(tmp_path):
    assert diagnose_simulator(log_of(SERVO.format("")), simulator_of(tmp_path), LIBRARY).verdict == "none"
