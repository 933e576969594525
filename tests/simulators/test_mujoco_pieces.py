"""A MuJoCo model asked about one motion under many inputs: the same accelerations, most of them without asking it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

mujoco = pytest.importorskip("mujoco")

from pamid.simulators.mujoco_model import MujocoSimulator  # noqa: E402
from pamid.simulators.mujoco_pieces import WORTH, KeptPieces  # noqa: E402

ARM = """
<mujoco><compiler angle="radian"/>{option}<worldbody>{ground}
<body><joint name="lift" axis="0 1 0" frictionloss="0.3" damping="0.1" range="-0.6 0.6" limited="true"/>
<geom type="capsule" fromto="0 0 0 0.3 0 0" size="0.02" mass="0.6"/>
<body pos="0.3 0 0"><joint name="elbow" axis="0 1 0" frictionloss="0.05" armature="0.01"/>
<geom type="capsule" fromto="0 0 0 0.25 0 0" size="0.02" mass="0.3"/></body></body></worldbody>
<actuator><position name="up" joint="lift" kp="30" kv="1" forcerange="-6 6"/>{motor}</actuator></mujoco>
"""
MOTOR = '<motor name="bend" joint="elbow" gear="2" ctrlrange="-1 1" ctrllimited="true"/>'
GROUND = '<geom type="plane" size="3 3 0.1" pos="0 0 -0.2"/>'
ROWS = 600


def _arm(folder: Path, option: str = "", ground: str = "", motor: str = MOTOR) -> MujocoSimulator:
    (folder / "arm.xml").write_text(ARM.format(option=option, ground=ground, motor=motor))
    return MujocoSimulator(folder / "arm.xml")


def _motion(simulator: MujocoSimulator) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    t, rng = np.arange(ROWS) * 0.01, np.random.default_rng(0)
    x = np.stack([0.7 * np.sin(t), 0.7 * np.cos(t), np.sin(2.0 * t), 2.0 * np.cos(2.0 * t)])
    x[1::2, rng.random(ROWS) < 0.2] = 0.0  # at rest, as encoders of few steps say
    u = np.zeros((len(simulator.inputs), ROWS))
    u[0], u[1] = np.sin(t), 0.8 * np.cos(3.0 * t)
    return t, x, u, np.repeat(simulator.numbers[:, None], ROWS, axis=1)


def _rates_asked(
    simulator: MujocoSimulator, monkeypatch: pytest.MonkeyPatch, share: float
) -> tuple[np.ndarray, np.ndarray, int]:
    """Return the rates under other inputs of a known motion, those of the model itself, and rows it was asked."""
    t, x, u, p = _motion(simulator)
    for _ in range(WORTH):
        simulator.rate(t, x, u, p)
    other = u + share * np.cos(7.0 * t + np.arange(len(u))[:, None])
    asked, put = [], mujoco.mj_setState
    with monkeypatch.context() as patch:
        patch.setattr(mujoco, "mj_setState", lambda *given: (asked.append(1), put(*given))[1])
        found = simulator.rate(t, x, other, p)
    return found, MujocoSimulator(simulator.path).rate(t, x, other, p), len(asked)


@pytest.mark.parametrize("share", [0.01, 0.3, 3.0])
@pytest.mark.parametrize(
    ("option", "ground"),
    [("", ""), ("", GROUND), ('<option cone="elliptic"/>', GROUND), ('<option integrator="implicitfast"/>', "")],
)
def test_other_inputs_bring_the_accelerations_of_the_model(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, share: float, option: str, ground: str
) -> None:
    found, true, asked = _rates_asked(_arm(tmp_path, option, ground), monkeypatch, share)
    assert np.allclose(found, true, rtol=1e-7, atol=1e-6 * np.max(np.abs(true)))
    assert asked < ROWS
    if not ground and share < 0.1:
        assert asked < 0.05 * ROWS


def test_changed_numbers_are_another_motion(tmp_path: Path) -> None:
    simulator = _arm(tmp_path)
    t, x, u, p = _motion(simulator)
    for _ in range(WORTH):
        simulator.rate(t, x, u, p)
    heavier = p.copy()
    heavier[0] += 0.05
    fresh = MujocoSimulator(simulator.path)
    assert np.allclose(simulator.rate(t, x, u, heavier), fresh.rate(t, x, u, heavier), rtol=1e-7, atol=1e-7)
    grows = p.copy()
    grows[0] += np.linspace(0.0, 0.05, ROWS)
    assert np.allclose(simulator.rate(t, x, u, grows), fresh.rate(t, x, u, grows), rtol=1e-7, atol=1e-7)


def test_a_row_that_is_not_finite_stays_so_and_no_other(tmp_path: Path) -> None:
    simulator = _arm(tmp_path)
    t, x, u, p = _motion(simulator)
    x[0, 7], u[0, 9] = np.nan, np.inf
    for _ in range(WORTH):
        found = simulator.rate(t, x, u, p)
    lost = np.isnan(found[1])
    assert lost[[7, 9]].all() and lost.sum() == 2


def test_actuators_of_other_kinds_are_asked_for_row_by_row(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    motor = '<general name="bend" joint="elbow" gaintype="user" biastype="none"/>'
    simulator = _arm(tmp_path, motor=motor)
    assert KeptPieces(simulator._m, simulator._d, simulator._each).find(*_motion(simulator)[1:]) is None
    found, true, asked = _rates_asked(simulator, monkeypatch, 0.1)
    assert np.allclose(found, true) and asked == ROWS


def test_pieces_are_made_once_a_motion_was_asked_for_as_often_as_they_cost(tmp_path: Path) -> None:
    simulator = _arm(tmp_path)
    kept, motion = KeptPieces(simulator._m, simulator._d, simulator._each), _motion(simulator)[1:]
    assert [kept.find(*motion) is not None for _ in range(WORTH + 1)] == [False] * (WORTH - 1) + [True] * 2
    x, u, p = motion
    for more in 1.01 + 0.01 * np.arange(8):  # as sensitivities to numbers ask: a few times each
        assert all(kept.find(x, u, more * p) is None for _ in range(WORTH - 1))


def test_a_model_without_actuators_is_asked_as_often_as_any(tmp_path: Path) -> None:
    link = '<body><joint name="q" axis="0 1 0" damping="0.1"/><geom size="0.1" pos="0 0 -0.3" mass="1"/></body>'
    (tmp_path / "free.xml").write_text(f"<mujoco><worldbody>{link}</worldbody></mujoco>")
    simulator = MujocoSimulator(tmp_path / "free.xml")
    t = 0.01 * np.arange(ROWS)
    x, u, p = np.array([np.sin(t), np.cos(t)]), np.zeros((1, ROWS)), np.repeat(simulator.numbers[:, None], ROWS, axis=1)
    first = simulator.rate(t, x, u, p)
    for _ in range(WORTH):
        assert np.allclose(simulator.rate(t, x, u, p), first, rtol=1e-9)
