"""Samples of a MuJoCo model by its own integrator, many at once."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pamid.simulators import MujocoSimulator, mujoco_model, mujoco_samples
from pamid.simulators.mujoco_versions import rolls_out

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


@pytest.mark.skipif(not rolls_out(), reason="MuJoCo before 3.2.7 takes one set of data")
@pytest.mark.parametrize("threads", ["1", "2"])
def test_samples_are_the_same_together_and_one_by_one(
    arm: MujocoSimulator, threads: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("OMP_NUM_THREADS", threads)
    asked = []
    together = mujoco_model.rolled
    monkeypatch.setattr(mujoco_model, "rolled", lambda *given: asked.append(given) or together(*given))
    monkeypatch.setattr(mujoco_samples, "CHUNK", 2**14)  # several calls
    given = rows_of(arm, 101)
    found = arm.own_steps(*given, DT, 0.002)
    assert asked
    monkeypatch.setattr(mujoco_model, "rolls_out", lambda: False)
    np.testing.assert_array_equal(arm.own_steps(*given, DT, 0.002), found)
    assert len(asked) == 1


def test_a_row_with_a_mere_warning_has_an_answer(arm: MujocoSimulator, monkeypatch: pytest.MonkeyPatch) -> None:
    given = rows_of(arm, 9)
    found = arm.own_steps(*given, DT, 0.002)
    monkeypatch.setattr(mujoco_model, "rolled", lambda m, x, *rest: np.full_like(x, np.nan))
    np.testing.assert_array_equal(arm.own_steps(*given, DT, 0.002), found)


def test_parameters_that_differ_by_row_act_row_by_row(tmp_path: Path) -> None:
    (tmp_path / "arm.xml").write_text(ARM)
    arm = MujocoSimulator(tmp_path / "arm.xml", parameters={"dof_damping.shoulder": (0.1, 0.5)})
    x, starts, ends, p = rows_of(arm, 6)
    p[list(arm.parameters).index("dof_damping.shoulder")] = [0.1, 0.1, 0.1, 0.4, 0.4, 0.4]
    found = arm.own_steps(x, starts, ends, p, DT, 0.002)
    for some in (slice(0, 3), slice(3, 6)):
        same = arm.own_steps(x[:, some], starts[:, some], ends[:, some], p[:, some], DT, 0.002)
        np.testing.assert_array_equal(same, found[:, some])


@pytest.mark.parametrize(
    ("beside", "size", "number"),
    [
        ("", "", 3),
        ('<geom type="plane" size="1 1 .1"/>', "", 1),  # contacts may go beyond the memory
        ('<geom type="plane" size="1 1 .1" contype="0" conaffinity="0"/>', "", 3),
        ("", '<size memory="4K"/>', 1),
    ],
)
def test_threads_only_where_no_error_of_mujoco_can_end_the_process(
    beside: str, size: str, number: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    import mujoco

    monkeypatch.setenv("OMP_NUM_THREADS", "3")
    text = ARM.replace("<worldbody>", f"{size}<worldbody>{beside}")
    assert mujoco_samples.threads_for(mujoco.MjModel.from_xml_string(text)) == number
