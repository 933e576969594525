"""Servos that answer a command within a sample or two: what they do between the rows is no cause, and friction is."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from pamid.gap import diagnose_simulator
from pamid.gap.residuals.direct import DirectEvidence
from pamid.gap.residuals.states import measured_states
from pamid.simulators import FunctionSimulator, Port
from pamid.simulators.port_log import port_log

mujoco = pytest.importorskip("mujoco")

from pamid.simulators.mujoco_model import MujocoSimulator  # noqa: E402

ARM = """<mujoco><compiler angle="radian"/><worldbody><body>
<joint name="shoulder" axis="0 1 0" armature="0.02" damping="0.1"/>
<geom type="capsule" fromto="0 0 0 0 0 -0.15" size="0.02" mass="0.2" contype="0" conaffinity="0"/>
<body pos="0 0 -0.15"><joint name="elbow" axis="1 0 0" armature="0.02" damping="0.1"/>
<geom type="capsule" fromto="0 0 0 0 0 -0.15" size="0.02" mass="0.2" contype="0" conaffinity="0"/></body></body>
</worldbody>
<actuator><position name="a" joint="shoulder" kp="40" kv="2"/>
<position name="b" joint="elbow" kp="40" kv="2"/></actuator>
</mujoco>"""
LIBRARY = ["sensor_gain", "parameter_deviation", "coulomb_friction", "viscous_friction", "actuator_backlash", "creep"]


def log_of(xml: str, seed: int, play: float = 0.0, seconds: float = 10.0) -> pd.DataFrame:
    """Return a log at 100 Hz, encoders of 12 bits; the elbow's command may have a play before it acts."""
    model = mujoco.MjModel.from_xml_string(xml)
    data, rng, t = mujoco.MjData(model), np.random.default_rng(seed), np.arange(0.0, seconds, 0.01)
    u, rows, followed = np.empty((2, len(t))), [], 0.0
    for k in range(2):
        rate, phase = 2 * np.pi * rng.uniform(0.1, 0.8, 3), rng.uniform(0, 6, 3)
        u[k] = 0.2 * sum(np.sin(w * t + p) - np.sin(p) for w, p in zip(rate, phase, strict=True))
    step = 2 * np.pi / 4096
    for a, b in u.T:
        speed = data.qvel + 2e-3 * rng.standard_normal(2)
        rows.append([a, b, *(np.round(data.qpos / step) * step), *speed])
        followed = min(max(followed, b - play), b + play)
        data.ctrl[:] = a, followed
        mujoco.mj_step(model, data, nstep=5)
    names = ["a", "b", "shoulder_q", "elbow_q", "shoulder_dq", "elbow_dq"]
    return pd.DataFrame(rows, columns=names).assign(time=t, trajectory="walk")


@pytest.fixture(scope="module")
def arm(tmp_path_factory: pytest.TempPathFactory) -> MujocoSimulator:
    path = Path(tmp_path_factory.mktemp("arm")) / "arm.xml"
    path.write_text(ARM)
    return MujocoSimulator(path)


def test_the_right_arm_has_no_gap_and_no_sensor_a_gain(arm: MujocoSimulator) -> None:
    """The servos' own time is that of a sample: speeds at the rows miss up to 2 % of what positions move."""
    assert diagnose_simulator(log_of(ARM, 2), arm, LIBRARY).verdict == "none"


def test_dry_friction_is_no_play_of_its_servos_command(arm: MujocoSimulator) -> None:
    """While it holds the joint, both say the same force; the joint goes on when its command turns, though."""
    rough = ARM.replace('<joint name="elbow"', '<joint name="elbow" frictionloss="0.15"')
    (cause,) = diagnose_simulator(log_of(rough, 1, seconds=6.0), arm, LIBRARY).causes
    assert cause.effects[0] == "coulomb_friction" and cause.where[0] == "elbow"
    assert cause.parameters["amplitude"].value == pytest.approx(0.15, rel=0.05)


def test_a_play_of_the_command_is_no_dry_friction(arm: MujocoSimulator) -> None:
    (cause,) = diagnose_simulator(log_of(ARM, 1, 0.004), arm, LIBRARY).causes
    assert cause.effects[0] == "actuator_backlash" and cause.where[0] == "b"
    assert cause.parameters["half_width"].value == pytest.approx(0.004, rel=0.05)


@pytest.mark.parametrize(("rate", "runs", "most"), [(10.0, False, 1.2), (200.0, True, 1.2), (5000.0, False, 3.0)])
def test_a_simulator_is_run_over_each_sample_where_that_says_more(rate: float, runs: bool, most: float) -> None:
    """A drive of 1/rate s at 100 Hz: too slow to need it, fast, and so stiff that a run of eight steps runs away."""
    ports = [Port("u", "input", "m/s"), Port("q", "state", "m"), Port("v", "state", "m/s")]
    drive = FunctionSimulator(lambda t, x, u, p: [x.v, p.k * (u.u - x.v)], ports, {"k": rate})
    rng, rows, v, q = np.random.default_rng(0), [], 0.0, 0.0
    for k, u in enumerate(0.05 * np.cumsum(rng.standard_normal(600))):
        rows.append(("0", 0.01 * k, u, q + 1e-5 * rng.standard_normal(), v + 1e-3 * rng.standard_normal()))
        left = np.exp(-0.01 * rate)
        q, v = q + 0.01 * u + (v - u) * (1.0 - left) / rate, u + (v - u) * left
    log = port_log(pd.DataFrame(rows, columns=["trajectory", "time", "u", "q", "v"]), drive)
    evidence = DirectEvidence(log, drive, measured_states(drive, log))
    assert evidence.runs_within_steps == runs
    assert all(float(np.sqrt(np.mean(np.square(evidence.z0[part])))) < most for part in evidence.parts)
