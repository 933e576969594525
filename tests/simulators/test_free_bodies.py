"""A body that moves freely in a MuJoCo model moves alike on six joints, and forces on it have names."""

import numpy as np
import pandas as pd
import pytest

from pamid.gap import diagnose_simulator
from pamid.simulators import Port

mujoco = pytest.importorskip("mujoco")
if tuple(int(part) for part in mujoco.__version__.split(".")[:2]) < (3, 3):
    pytest.skip("free joints need MuJoCo 3.3", allow_module_level=True)

from pamid.simulators.mujoco_model import MujocoSimulator  # noqa: E402

THRUST = '<motor name="r{}" site="r{}" gear="0 0 1 0 0 {}" ctrlrange="0 8" ctrllimited="true"/>'
SITE = '<site name="r{}" pos="{} {} 0"/>'
PLACES = [(0.15, 0.15), (-0.15, 0.15), (-0.15, -0.15), (0.15, -0.15)]
QUADROTOR = f"""<mujoco><default><joint damping="1" armature="0.1"/></default><worldbody>
<body name="quad" pos="0 0 1"><freejoint name="root"/><inertial pos="0 0 0" mass="1.2" diaginertia="0.012 0.012 0.022"/>
{"".join(SITE.format(k + 1, *place) for k, place in enumerate(PLACES))}</body></worldbody>
<actuator>{"".join(THRUST.format(k, k, 0.02 * (-1) ** k) for k in (1, 2, 3, 4))}</actuator>
<keyframe><key qpos="0 0 1 1 0 0 0"/></keyframe></mujoco>"""
WAYS = ["x", "y", "z", "yaw", "pitch", "roll"]


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    file = tmp_path_factory.mktemp("free") / "quad.xml"
    file.write_text(QUADROTOR)
    return file


def turned(yaw, pitch, roll):
    (c, s), (d, t), (e, u) = ((np.cos(a), np.sin(a)) for a in (yaw, pitch, roll))
    about = [[c, -s, 0], [s, c, 0], [0, 0, 1]], [[d, 0, t], [0, 1, 0], [-t, 0, d]], [[1, 0, 0], [0, e, -u], [0, u, e]]
    return np.array(about[0]) @ about[1] @ about[2]


def test_its_joints_are_those_of_a_body_in_the_world(path):
    simulator = MujocoSimulator(path)
    assert [p.name for p in simulator.ports if p.kind == "joint"] == WAYS
    assert [p.begins for p in simulator.ports if p.kind == "state"][:6:2] == [0.0, 0.0, 1.0]
    rates = dict(zip(simulator.states, simulator.rate(*at(simulator, np.zeros(12)))[:, 0], strict=True))
    assert rates["z_dq"] == pytest.approx(-9.81)


def at(simulator, x, u=None):
    inputs = np.zeros((len(simulator.inputs), 1))
    inputs[:4, 0] = 0.0 if u is None else u
    return np.zeros(1), np.asarray(x, float)[:, None], inputs, np.asarray(simulator.numbers)[:, None]


def test_it_accelerates_as_the_free_body(path):
    rng, simulator = np.random.default_rng(0), MujocoSimulator(path)
    free = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(free)
    for _ in range(5):
        q, dq, u = 0.5 * rng.standard_normal(6), rng.standard_normal(6), rng.uniform(2, 4, 4)
        R = turned(*q[3:])
        quaternion = np.zeros(4)
        mujoco.mju_mat2Quat(quaternion, R.ravel())
        axes = np.array([[0, 0, 1], turned(q[3], 0, 0)[:, 1], turned(q[3], q[4], 0)[:, 0]])
        data.qpos[:], data.qvel[:] = [*q[:3], *quaternion], [*dq[:3], *(R.T @ (dq[3:] @ axes))]
        data.ctrl[:] = u
        mujoco.mj_forward(free, data)
        found = simulator.rate(*at(simulator, np.column_stack([q, dq]).ravel(), u))[1::2, 0]
        assert found[:3] == pytest.approx(data.qacc[:3], rel=1e-6, abs=1e-9)


def flown(path, wind=0.0, first=1.0, seconds=8.0):
    """Two controlled flights with a horizontal wind and a weaker first rotor; attitude as its estimator has it."""
    rng, model, runs = np.random.default_rng(0), mujoco.MjModel.from_xml_path(str(path)), []
    model.opt.timestep = 5e-4
    for k in range(2):
        data, rows = mujoco.MjData(model), []
        w, phase = 2 * np.pi * rng.uniform(0.1, 0.4, (3, 2)), rng.uniform(0, 6, (3, 2))
        for t in 0.01 * np.arange(round(100 * seconds)):
            aim = 0.4 * np.sin(w * t + phase).sum(axis=1) + [0, 0, 1]
            R = data.xmat[1].reshape(3, 3) if t else np.eye(3)
            pull = 4 * (aim - data.qpos[:3]) - 3 * data.qvel[:3] + [0, 0, 9.81]
            inertia = np.array([0.012, 0.012, 0.022])
            turn = R.T @ np.cross(R[:, 2], pull / np.linalg.norm(pull)) * inertia * 150 - data.qvel[3:] * inertia * 20
            mix = np.array([[1, -1, -1], [1, 1, 1], [-1, 1, -1], [-1, -1, 1]]) / [0.6, 0.6, 0.08]
            u = np.clip(1.2 * pull @ R[:, 2] / 4 + mix @ turn, 0, 8)
            angles = np.arctan2(R[1, 0], R[0, 0]), -np.arcsin(R[2, 0]), np.arctan2(R[2, 1], R[2, 2])
            rows.append([t, *u, *data.qpos[:3], *angles])
            data.ctrl[:], data.xfrc_applied[1, 0] = u * [first, 1, 1, 1], wind
            mujoco.mj_step(model, data, 20)
        table = pd.DataFrame(rows, columns=["time", "r1", "r2", "r3", "r4", *(f"{way}_q" for way in WAYS)])
        table[["x_q", "y_q", "z_q"]] += 1e-3 * rng.standard_normal((len(table), 3))
        table[["yaw_q", "pitch_q", "roll_q"]] += 5e-5 * rng.standard_normal((len(table), 3))
        runs.append(table.assign(trajectory=str(k)))
    return pd.concat(runs, ignore_index=True)


@pytest.mark.parametrize(
    ("what", "effect", "where", "size"),
    [({}, "", "", 0.0), ({"wind": 0.3}, "steady_force", "x", 0.3), ({"first": 0.9}, "actuator_gain", "r1", -0.1)],
    ids=["right", "wind", "rotor"],
)
def test_what_acts_on_it_is_named(path, what, effect, where, size):
    found = diagnose_simulator(flown(path, **what), MujocoSimulator(path))
    assert [(c.effects[0], c.where[0]) for c in found.causes] == ([(effect, where)] if effect else [])
    if effect:
        [value] = [p.value for p in found.causes[0].parameters.values()]
        assert value == pytest.approx(size, rel=0.15)
        assert found.corrected.corrected_xml()[0].count("<joint ") >= 6


def test_two_free_bodies_have_names_of_their_own(tmp_path):
    body = '<body name="{0}"><freejoint/><geom size="0.1" contype="0" conaffinity="0"/></body>'
    text = f"<mujoco><worldbody>{body.format('a')}{body.format('b')}</worldbody></mujoco>"
    (tmp_path / "two.xml").write_text(text)
    simulator = MujocoSimulator(tmp_path / "two.xml", [Port("a_x_q", "state", "m", column="ax")])
    assert [p.name for p in simulator.ports if p.kind == "joint"] == [f"{b}_{way}" for b in "ab" for way in WAYS]
