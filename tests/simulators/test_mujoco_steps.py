"""Samples of a MuJoCo model by its own integrator, many at once."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pamid.simulators import MujocoSimulator

ARM = """<mujoco><compiler angle="radian"/><option timestep="0.002"/><worldbody>
<body><joint name="shoulder" axis="0 1 0" damping="0.1"/>
<geom type="capsule" fromto="0 0 0 0 0 -.3" size=".02" mass=".4" contype="0"/>
<body pos="0 0 -.3"><joint name="elbow" axis="0 1 0" armature="0.003" frictionloss="0.02"/>
<geom type="capsule" fromto="0 0 0 0 0 -.2" size=".02" mass=".2" contype="0"/></body></body></worldbody>
<actuator><position name="servo" joint="shoulder" kp="200" kv="3"/>
<motor name="motor" joint="elbow"/></actuator></mujoco>"""
DT = 0.008


@pytest.fixture
def arm(tmp_path: Path) -> MujocoSimulator:
    (tmp_path / "arm.xml").write_text(ARM)
    return MujocoSimulator(tmp_path / "arm.xml")


def rows_of(arm: MujocoSimulator, n: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(0)
    x, starts = rng.uniform(-1.0, 1.0, (4, n)), rng.uniform(-0.5, 0.5, (4, n))
    return x, starts, starts + rng.uniform(-0.1, 0.1, (4, n)), np.repeat(arm.numbers[:, None], n, axis=1)


@pytest.mark.parametrize("step", [0.002, 0.001])
def test_a_sample_is_as_by_single_steps(arm: MujocoSimulator, step: float) -> None:
    import mujoco

    x, starts, ends, p = rows_of(arm, 50)
    found = arm.own_steps(x, starts, ends, p, DT, step)
    model = mujoco.MjModel.from_xml_string(ARM)
    model.opt.timestep, count = step, round(DT / step)
    for k in range(x.shape[1]):
        data = mujoco.MjData(model)
        data.qpos[:], data.qvel[:] = x[0::2, k], x[1::2, k]
        for j in range(count):
            u = starts[:, k] + (j + 0.5) / count * (ends[:, k] - starts[:, k])
            data.ctrl[:], data.qfrc_applied[:] = u[:2], u[2:]
            mujoco.mj_step(model, data)
        np.testing.assert_allclose(found[0::2, k], data.qpos, atol=1e-12)
        np.testing.assert_allclose(found[1::2, k], data.qvel, atol=1e-10)


def test_rows_do_not_depend_on_their_neighbours(arm: MujocoSimulator) -> None:
    x, starts, ends, p = rows_of(arm, 301)
    whole = arm.own_steps(x, starts, ends, p, DT, 0.0)
    some = [v[:, 17:40] for v in (x, starts, ends, p)]
    np.testing.assert_array_equal(arm.own_steps(*some, DT, 0.0), whole[:, 17:40])


def test_a_row_without_an_answer_has_none(arm: MujocoSimulator) -> None:
    x, starts, ends, p = rows_of(arm, 5)
    x[0, 1], ends[1, 2] = np.nan, np.inf
    x[1, 3] = 1e15  # runs away at once; begun anew at rest it would look like an answer
    found = arm.own_steps(x, starts, ends, p, DT, 0.002)
    assert np.isnan(found[:, [1, 2, 3]]).all()
    assert np.isfinite(found[:, [0, 4]]).all()
