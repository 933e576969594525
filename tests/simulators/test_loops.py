"""Joints in a loop move only together: where a log lacks some of them, runs begin where the loop is closed."""

import numpy as np
import pandas as pd
import pytest

mujoco = pytest.importorskip("mujoco")

from pamid.gap.residuals.shooting import ShootingEvidence  # noqa: E402
from pamid.simulators.mujoco_model import MujocoSimulator  # noqa: E402
from pamid.simulators.port_log import port_log  # noqa: E402

FIVE_BAR = """
<mujoco><compiler angle="radian"/><option timestep="0.001" integrator="RK4"/>
<default><geom contype="0" conaffinity="0"/></default><worldbody>
<body name="la" pos="-.05 0 0"><joint name="left" axis="0 1 0" armature=".002" damping=".02"/>
<geom type="capsule" fromto="0 0 0 -.06 0 -.1" size=".008" mass=".12"/>
<body name="lb" pos="-.06 0 -.1"><joint name="left_elbow" axis="0 1 0" damping=".002"/>
<geom type="capsule" fromto="0 0 0 .11 0 -.14" size=".007" mass=".1"/></body></body>
<body name="ra" pos=".05 0 0"><joint name="right" axis="0 1 0" armature=".002" damping=".02"/>
<geom type="capsule" fromto="0 0 0 .06 0 -.1" size=".008" mass=".12"/>
<body name="rb" pos=".06 0 -.1"><joint name="right_elbow" axis="0 1 0" damping=".002"/>
<geom type="capsule" fromto="0 0 0 -.11 0 -.14" size=".007" mass=".1"/></body></body></worldbody>
<equality><connect body1="lb" body2="rb" anchor=".11 0 -.14" solref=".004 1"/></equality>
<actuator><motor name="left_motor" joint="left"/><motor name="right_motor" joint="right"/></actuator></mujoco>
"""
JOINTS = "left", "left_elbow", "right", "right_elbow"
STEP = 0.005
MEASURED = {"left_q", "left_dq", "right_q", "right_dq"}


@pytest.fixture(scope="module")
def five_bar(tmp_path_factory):
    path = tmp_path_factory.mktemp("loop") / "model.xml"
    path.write_text(FIVE_BAR)
    return MujocoSimulator(path)


@pytest.fixture(scope="module")
def moved():
    model = mujoco.MjModel.from_xml_string(FIVE_BAR)
    data, rows = mujoco.MjData(model), []
    for k in range(400):
        u = 0.08 * np.sin(3.0 * k * STEP), 0.06 * np.sin(4.3 * k * STEP)
        rows.append([k * STEP, *data.qpos, *data.qvel, *u])
        for _ in range(5):
            data.ctrl[:] = u
            mujoco.mj_step(model, data)
    names = ["time", *(f"{j}_q" for j in JOINTS), *(f"{j}_dq" for j in JOINTS), "left_motor", "right_motor"]
    return pd.DataFrame(rows, columns=names)


def states_of(log, simulator):
    return np.stack([log[name].to_numpy() for name in simulator.states])


def without_elbows(x, simulator):
    return x * np.array([name in MEASURED for name in simulator.states])[:, None]


def test_joints_that_are_not_known_follow_the_others(five_bar, moved):
    x = states_of(moved, five_bar)
    found = five_bar.closed(without_elbows(x, five_bar), MEASURED, along=True)
    np.testing.assert_allclose(found[0::2], x[0::2], atol=2e-3)
    np.testing.assert_allclose(found[1::2], x[1::2], atol=0.02 * np.max(np.abs(x[1::2])))


def test_known_joints_stay_where_they_are(five_bar, moved):
    x = states_of(moved, five_bar)[:, ::40]
    assert five_bar.closed(x, set(five_bar.states)) is x
    found = five_bar.closed(x + 0.01, MEASURED)
    np.testing.assert_array_equal(found[[0, 1, 4, 5]], x[[0, 1, 4, 5]] + 0.01)
    np.testing.assert_allclose(five_bar.closed(found, MEASURED), found, atol=1e-8)


def test_a_model_without_loops_begins_where_it_is_told(tmp_path, five_bar, moved):
    (tmp_path / "open.xml").write_text(FIVE_BAR[: FIVE_BAR.index("<equality>")] + "</mujoco>")
    x = states_of(moved, five_bar)
    assert MujocoSimulator(tmp_path / "open.xml").closed(x, MEASURED) is x


def test_stretches_begin_with_the_loop_closed(five_bar, moved):
    log = moved[:200].drop(columns=[f"{j}_elbow_{end}" for j in ("left", "right") for end in ("q", "dq")])
    evidence = ShootingEvidence(port_log(log.assign(trajectory="run"), five_bar), five_bar, longest=100)
    firsts = [s.first for s in evidence.stretches]
    assert len(firsts) == 2
    begun, true = evidence._starts(), states_of(moved, five_bar)[:, firsts]
    np.testing.assert_allclose(begun[0::2], true[0::2], atol=2e-3)
