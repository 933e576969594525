"""What MuJoCo's versions call by different names: the same model comes back from each, whichever is installed."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

mujoco = pytest.importorskip("mujoco")

from pamid.errors import SimulatorRunError  # noqa: E402
from pamid.simulators.mujoco_model import MujocoSimulator  # noqa: E402
from pamid.simulators.mujoco_versions import limits_tendons, spec_item, spec_of, write_moments  # noqa: E402

TREE = """
<mujoco><compiler angle="radian"/><default><joint damping="0.1"/></default><worldbody>
<geom type="plane" size="1 1 0.1" pos="0 0 -9"/>
<body name="base"><joint name="turn" axis="0 0 1"/><geom size="0.1" mass="2"/><geom size="0.05" pos="0.1 0 0" mass="1"/>
  <body name="left" pos="0 0.2 0"><joint name="lift" axis="0 1 0"/><geom size="0.1" pos="0.3 0 0" density="500"/></body>
  <body name="right" pos="0 -0.2 0"><joint name="slide" type="slide"/><joint name="roll"/>
    <geom size="0.1" pos="0.2 0 0" mass="0.5"/></body></body>
<body name="other" pos="2 0 0"><joint name="far" axis="0 1 0"/><geom size="0.1" pos="0.1 0 0" mass="0.3"/></body>
</worldbody>
<actuator><motor name="first" joint="lift" gear="2"/><motor name="second" joint="far"/></actuator></mujoco>
"""


@pytest.fixture
def tree(tmp_path: Path) -> MujocoSimulator:
    (tmp_path / "tree.xml").write_text(TREE)
    numbers = {"body_mass.base": 3.6, "body_mass.left": 3.0, "dof_armature.roll": 0.02, "dof_damping.far": 0.4}
    return MujocoSimulator(tmp_path / "tree.xml", parameters={k: (v, 0.1, "") for k, v in numbers.items()})


def test_a_tree_of_bodies_comes_back_with_its_numbers(tree: MujocoSimulator, tmp_path: Path) -> None:
    changed = tree.with_({"body_mass.base": 3.6, "body_mass.left": 3.0}, [
        ("viscous_friction", "slide", {"coefficient": 0.25}), ("coulomb_friction", "turn", {"amplitude": 0.05}),
        ("actuator_gain", "second", {"deviation": 0.5}), ("quadratic_drag", "lift", {"coefficient": 1.0}),
    ])  # fmt: skip
    text, rest = changed.corrected_xml()
    assert [name for name, *_ in rest] == ["quadratic_drag"]
    said = changed.in_elements().parameters
    assert (said["dof_frictionloss.turn"].unit, said["dof_damping.slide"].unit) == ("N m", "N s/m")
    (tmp_path / "again.xml").write_text(text)
    m = mujoco.MjModel.from_xml_path(str(tmp_path / "again.xml"))
    at = {n: mujoco.mj_name2id(m, mujoco.mjtObj.mjOBJ_JOINT, n) for n in ("turn", "lift", "slide", "roll", "far")}
    mass = {n: m.body_mass[mujoco.mj_name2id(m, mujoco.mjtObj.mjOBJ_BODY, n)] for n in ("base", "left", "right")}
    damping, friction, inertia = np.ravel(m.dof_damping), m.dof_frictionloss, m.dof_armature
    assert mass == pytest.approx({"base": 3.6, "left": 3.0, "right": 0.5})
    expected = {"turn": 0.1, "lift": 0.1, "slide": 0.35, "roll": 0.1, "far": 0.4}
    assert {n: damping[k] for n, k in at.items()} == pytest.approx(expected)
    assert {n: friction[k] for n, k in at.items() if friction[k]} == pytest.approx({"turn": 0.05})
    assert {n: inertia[k] for n, k in at.items() if inertia[k]} == pytest.approx({"roll": 0.02})
    assert m.actuator_gear[:, 0].tolist() == [2.0, 1.5]


def test_inertias_and_moments_are_those_of_the_motion(tree: MujocoSimulator) -> None:
    m = mujoco.MjModel.from_xml_string(TREE)
    d = mujoco.MjData(m)
    mujoco.mj_forward(m, d)
    moments, unit, column = np.zeros((m.nu, m.nv)), np.zeros(m.nv), np.zeros(m.nv)
    write_moments(m, d, moments)
    assert moments[0].tolist() == [0.0, 2.0, 0.0, 0.0, 0.0] and moments[1].tolist() == [0.0, 0.0, 0.0, 0.0, 1.0]
    assert not limits_tendons(m)
    (tree.path.parent / "plain.xml").write_text(TREE)
    inertia = MujocoSimulator(tree.path.parent / "plain.xml").inertia(np.zeros((2 * m.nv, 1)))[0]
    for k in range(m.nv):
        unit[:] = 0.0
        unit[k] = 1.0
        mujoco.mj_mulM(m, d, column, unit)
        assert inertia[k] == pytest.approx(column)


def test_a_part_that_is_not_found_is_told(tree: MujocoSimulator, monkeypatch: pytest.MonkeyPatch) -> None:
    spec = spec_of(tree.path)
    monkeypatch.setattr("pamid.simulators.mujoco_versions._version", lambda: (3, 2, 7))
    with pytest.raises(SimulatorRunError, match="does not find the joint 'knee'"):
        spec_item(spec, mujoco.MjModel.from_xml_string(TREE), "joint", "knee")
