"""MuJoCo files that would take the machine: compiled in a process of its own, within limits, and refused in a line."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("mujoco")

from pamid.cli import main
from pamid.errors import SimulatorRunError, SimulatorSyntaxError
from pamid.simulators import mujoco_loading
from pamid.simulators.mujoco_model import MujocoSimulator

by_trial = mujoco_loading._by_trial
ARM = '<body name="arm"><joint name="hinge"/><geom size="0.1" mass="1"/>{}</body>'
HOSTILE = {
    "a height field of 10^10 points": (
        '<asset><hfield name="h" nrow="100000" ncol="100000" size="1 1 1 1"/></asset>',
        '<geom type="hfield" hfield="h"/>', "",
    ),
    "as many keys": ('<size nkey="2000000000"/>', "", ""),
    "numbers of a user's own": ('<size nuser_body="2000000000"/>', "", ""),
    "much memory": ('<size memory="900G"/>', "", ""),
    "replicas of replicas": (
        "", "", '<replicate count="1000" offset="1 0 0">' * 4 + '<geom size="0.1"/>' + "</replicate>" * 4,
    ),
    "a fine cloth": ("", '<flexcomp name="f" type="grid" count="1000 1000 1000" spacing="1 1 1" dim="3"/>', ""),
    "a sensor of many numbers": ('<sensor><user name="s" dim="2000000000"/></sensor>', "", ""),
    "endless zeros": ('<include file="/dev/zero"/>', "", ""),
    "a pipe": ('<include file="pipe.xml"/>', "", ""),
    "a mesh of endless zeros": ('<asset><mesh name="m" file="/dev/zero"/></asset>', '<geom type="mesh" mesh="m"/>', ""),
    "thousands of joints": ("", "", '<body><joint/><geom size="1" contype="0" conaffinity="0"/></body>' * 2500),
    "thousands of bodies in one place": ("", "", '<body><geom size="1"/></body>' * 5000),
    "a file included in itself": ('<include file="arm.xml"/>', "", ""),
}  # fmt: skip


def written(folder: Path, above: str = "", inside: str = "", beside: str = "") -> Path:
    text = f"<mujoco>{above}<worldbody>{ARM.format(inside)}{beside}</worldbody></mujoco>"
    (folder / "arm.xml").write_text(text)
    return folder / "arm.xml"


@pytest.mark.skipif(os.name != "posix", reason="limits of a process, and pipes")
@pytest.mark.slow
@pytest.mark.parametrize("what", HOSTILE)
def test_what_would_take_the_machine_is_refused(what: str, tmp_path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(mujoco_loading, "MEMORY", 2**30)
    monkeypatch.setattr(mujoco_loading, "SECONDS", 3)
    os.mkfifo(tmp_path / "pipe.xml")
    written(tmp_path, *HOSTILE[what])
    (tmp_path / "log.csv").write_text("time,hinge_q\n0,0\n0.1,0\n0.2,0\n")
    assert main(["evaluate", "log.csv", "--sim", "arm.xml", "--quiet"]) == 2
    said = capsys.readouterr().err
    assert "arm.xml" in said and ("cannot be loaded" in said or "is not valid MJCF" in said)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["arm.xml", "log.csv", "pipe.xml"]


def test_an_ordinary_model_needs_no_other_process(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(mujoco_loading, "_by_trial", lambda *_: pytest.fail("a process was started"))
    assert MujocoSimulator(written(tmp_path)).states == ("hinge_q", "hinge_dq")


def test_a_model_of_many_elements_is_loaded_in_another_process_first(tmp_path, monkeypatch) -> None:
    tried = []
    monkeypatch.setattr(mujoco_loading, "_by_trial", lambda path, mj: tried.append(path) or by_trial(path, mj))
    path = written(tmp_path, beside='<body><geom size="0.1"/></body>' * 300)
    assert MujocoSimulator(path).states == ("hinge_q", "hinge_dq")
    assert tried == [path]


def test_contacts_beyond_the_memory_of_a_model_are_told(tmp_path) -> None:
    """Where the model begins there are none: they come with the states of a log."""
    balls = (f'<body pos="{3 * k} 0 0"><joint type="slide" axis="1 0 0"/><geom size="1"/></body>' for k in range(1, 60))
    model = MujocoSimulator(written(tmp_path, '<size memory="40K"/>', beside="".join(balls)))
    x = np.zeros((len(model.states), 1))
    x[2::2, 0] = -3.0 * np.arange(1, 60)
    with pytest.raises(SimulatorRunError, match=r"MuJoCo failed in .*arm\.xml: .*memory"):
        model.rate(np.zeros(1), x, np.zeros((len(model.inputs), 1)), model.numbers[:, None])


def test_a_model_of_other_files_is_the_same_by_way_of_the_other_process(tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "more.xml").write_text('<mujoco><option timestep="0.003"/></mujoco>')
    (tmp_path / "random.py").write_text("raise SystemExit('a file beside the model was run')")
    model = MujocoSimulator(written(tmp_path, '<include file="more.xml"/>'))._m
    assert model.opt.timestep == 0.003 and model.njnt == 1
    assert sorted(p.name for p in tmp_path.iterdir()) == ["arm.xml", "more.xml", "random.py"]


def test_a_wrong_model_says_what_is_wrong(tmp_path) -> None:
    with pytest.raises(SimulatorSyntaxError, match="nosuch"):
        MujocoSimulator(written(tmp_path, "<nosuch/>"))


def test_warnings_leave_no_file(tmp_path, monkeypatch) -> None:
    import mujoco

    monkeypatch.chdir(tmp_path)
    model = MujocoSimulator(written(tmp_path))._m
    data = mujoco.MjData(model)
    data.qvel[:] = 1e30
    for _ in range(3):
        mujoco.mj_step(model, data)
    assert data.warning[mujoco.mjtWarning.mjWARN_BADQVEL].number
    assert [p.name for p in tmp_path.iterdir()] == ["arm.xml"]
