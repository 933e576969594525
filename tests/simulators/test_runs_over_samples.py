"""Runs over each sample, where servos are fast: as few as say the same."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from pamid.gap.at_ports import diagnose_evidence
from pamid.gap.residuals import part
from pamid.gap.residuals.bends import fewest
from pamid.gap.residuals.direct import DirectEvidence
from pamid.gap.residuals.ports import PortEvidence
from pamid.gap.settings import EXCESS
from pamid.gap.simulated import evidence_of
from pamid.simulators.integrate import STEPS

mujoco = pytest.importorskip("mujoco")

from pamid.simulators.mujoco_model import MujocoSimulator  # noqa: E402

ARM = """<mujoco><compiler angle="radian"/><worldbody><body>
<joint name="arm" axis="0 1 0" armature="0.02" damping="0.1"/>
<geom type="capsule" fromto="0 0 0 0 0 -0.15" size="0.02" mass="0.2"/></body></worldbody>
<actuator><position name="a" joint="arm" kp="40" kv="2"/></actuator></mujoco>"""


@pytest.fixture
def evidence(tmp_path: Path) -> DirectEvidence:
    """A log of 5 s at 100 Hz of an arm that answers a command within two samples."""
    (tmp_path / "arm.xml").write_text(ARM)
    model, rows = mujoco.MjModel.from_xml_string(ARM), []
    data, rng, t = mujoco.MjData(model), np.random.default_rng(0), np.arange(0.0, 5.0, 0.01)
    for a in 0.2 * np.sin(3.0 * t) + 0.2 * np.sin(5.0 * t):
        rows.append([a, data.qpos[0] + 5e-4 * rng.standard_normal(), data.qvel[0] + 2e-3 * rng.standard_normal()])
        data.ctrl[0] = a
        mujoco.mj_step(model, data, nstep=5)
    log = pd.DataFrame(rows, columns=["a", "arm_q", "arm_dq"]).assign(time=t, trajectory="walk")
    found = evidence_of(log, MujocoSimulator(tmp_path / "arm.xml"))
    assert isinstance(found, DirectEvidence) and found.runs_within_steps
    return found


def test_a_reading_that_moves_little_is_followed_by_slopes(
    evidence: DirectEvidence, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of a small fault the arm is asked at some instants alone, of a large one at all."""
    name, asked, run = "sensor_bias@arm_q", [], evidence.simulator.own_steps

    def counted(x: np.ndarray, *more: object, **named: object) -> np.ndarray | None:
        asked.append(x.shape[1])
        return run(x, *more, **named)  # type: ignore[arg-type]

    def left(offset: float) -> np.ndarray:
        evidence._kept.clear()
        asked.clear()
        return evidence.z({name: evidence.placements[name].inward({"offset": offset})})

    left(1e-3)  # learns the slopes
    monkeypatch.setattr(evidence.simulator, "own_steps", counted)
    small = left(1e-3)
    assert 0 < sum(asked) < 0.5 * evidence.log.n
    left(2.0)
    assert sum(asked) > evidence.log.n
    monkeypatch.setattr(evidence, "_turns_little", lambda x, p: False)
    np.testing.assert_allclose(small, left(1e-3), atol=EXCESS)
    assert np.max(np.abs(small - evidence.z0)) > 10 * EXCESS


def test_a_whole_log_is_not_asked_for_what_a_part_has_shown(
    evidence: DirectEvidence, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked, touched = list[int](), PortEvidence._touched
    monkeypatch.setattr(part, "MOST_ANSWERS", 300)
    monkeypatch.setattr(PortEvidence, "_touched", lambda self, name: asked.append(self.log.n) or touched(self, name))
    found = diagnose_evidence(evidence, ["viscous_friction"], 0).found
    assert found.verdict == "none" and not found.cannot_show
    assert evidence.log.n not in asked


def test_a_sample_takes_as_few_steps_as_readings_can_tell() -> None:
    exact = np.zeros((2, 50))
    assert fewest(lambda n: exact + n**-4.0, exact, np.array([np.inf, 1e-2])) == 4
    assert fewest(lambda n: exact + n**-4.0, exact, np.array([1e-9, np.inf])) == STEPS
    assert fewest(lambda n: exact, exact, np.array([1e-9, 1e-9])) == 1
