"""Servos that answer a command within a sample or two: what they do between the rows is no cause, and friction is."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from pamid.gap import diagnose_simulator
from pamid.gap.at_ports import diagnose_evidence
from pamid.gap.residuals import part
from pamid.gap.residuals.bends import fewest
from pamid.gap.residuals.direct import DirectEvidence
from pamid.gap.residuals.ports import PortEvidence
from pamid.gap.settings import EXCESS
from pamid.gap.simulated import evidence_of
from pamid.simulators import FunctionSimulator, Port
from pamid.simulators.integrate import STEPS

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
    evidence = evidence_of(pd.DataFrame(rows, columns=["trajectory", "time", "u", "q", "v"]), drive)
    assert isinstance(evidence, DirectEvidence) and evidence.runs_within_steps == runs
    assert all(float(np.sqrt(np.mean(np.square(evidence.z0[part])))) < most for part in evidence.parts)


def test_a_reading_that_moves_little_is_followed_by_slopes(
    arm: MujocoSimulator, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A run over each sample is dear: of a small fault it is asked at some instants alone, of a large one at all."""
    evidence = evidence_of(log_of(ARM, 2, seconds=5.0), arm)
    assert isinstance(evidence, DirectEvidence) and evidence.runs_within_steps
    name, asked, run = "sensor_bias@elbow_q", [], arm.own_steps

    def counted(x: np.ndarray, *more: object, **named: object) -> np.ndarray:
        asked.append(x.shape[1])
        return run(x, *more, **named)  # type: ignore[arg-type]

    def left(offset: float) -> np.ndarray:
        evidence._kept.clear()
        asked.clear()
        return evidence.z({name: evidence.placements[name].inward({"offset": offset})})

    left(5e-4)  # learns the slopes
    monkeypatch.setattr(evidence.simulator, "own_steps", counted)
    small = left(5e-4)
    assert 0 < sum(asked) < 0.5 * evidence.log.n
    left(2.0)
    assert sum(asked) > evidence.log.n
    monkeypatch.setattr(evidence, "_turns_little", lambda x, p: False)
    np.testing.assert_allclose(small, left(5e-4), atol=EXCESS)
    assert np.max(np.abs(small - evidence.z0)) > 10 * EXCESS


def test_a_sample_takes_as_few_steps_as_readings_can_tell() -> None:
    exact = np.zeros((2, 50))
    assert fewest(lambda n: exact + n**-4.0, exact, np.array([np.inf, 1e-2])) == 4
    assert fewest(lambda n: exact + n**-4.0, exact, np.array([1e-9, np.inf])) == STEPS
    assert fewest(lambda n: exact, exact, np.array([1e-9, 1e-9])) == 1


def test_a_whole_log_is_not_asked_for_what_a_part_has_shown(
    arm: MujocoSimulator, monkeypatch: pytest.MonkeyPatch
) -> None:
    evidence, asked, touched = evidence_of(log_of(ARM, 2, seconds=5.0), arm), [], PortEvidence._touched
    monkeypatch.setattr(part, "MOST_ANSWERS", 600)
    monkeypatch.setattr(PortEvidence, "_touched", lambda self, name: asked.append(self.log.n) or touched(self, name))
    found, _ = diagnose_evidence(evidence, ["viscous_friction", "quadratic_drag"], 0)
    assert found.verdict == "none" and not found.cannot_show
    assert evidence.log.n not in asked
