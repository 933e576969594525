"""The README alone leads from a log and a MuJoCo arm to a report: its commands as they stand, no other page read."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from pamid.cli import main

ROOT = Path(__file__).resolve().parents[2]
if not (ROOT / "README.md").is_file():
    pytest.skip("needs the repository", allow_module_level=True)
mujoco = pytest.importorskip("mujoco")

ARM = """
<mujoco model="two links">
  <worldbody>
    <body name="upper">
      <joint name="shoulder" axis="0 1 0"/>
      <geom type="capsule" fromto="0 0 0 0 0 -0.3" size="0.02" mass="0.8"/>
      <body name="lower" pos="0 0 -0.3">
        <joint name="elbow" axis="0 1 0"/>
        <geom type="capsule" fromto="0 0 0 0 0 -0.25" size="0.02" mass="0.5"/>
      </body>
    </body>
  </worldbody>
  <actuator>
    <motor name="shoulder_motor" joint="shoulder"/>
    <motor name="elbow_motor" joint="elbow"/>
  </actuator>
</mujoco>
"""
COLUMNS = ["time", "shoulder_torque", "elbow_torque", "shoulder_angle", "elbow_angle", "shoulder_speed", "elbow_speed"]


def torques(rng: np.random.Generator, time: np.ndarray) -> np.ndarray:
    """Two sums of sines, N m."""
    f, phase = rng.uniform(0.3, 1.3, (2, 2)), rng.uniform(0.0, 6.0, (2, 2))
    return np.array([[0.8], [0.15]]) * np.sin(2 * np.pi * f[:, :, None] * time + phase[:, :, None]).sum(axis=1)


def swung(model: mujoco.MjModel, commands: np.ndarray) -> np.ndarray:
    """Angles and speeds under torques that are held for 10 ms each."""
    data, rows = mujoco.MjData(model), []
    for command in commands.T:
        rows.append([*data.qpos, *data.qvel])
        data.ctrl[:] = command
        mujoco.mj_step(model, data, nstep=10)
    return np.array(rows)


@pytest.fixture
def truth(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> mujoco.MjModel:
    """`arm.xml` as the user models it, `arm.csv` as the arm moves: with friction that the model lacks."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MPLBACKEND", "Agg")
    Path("arm.xml").write_text(ARM, encoding="utf-8")
    spec = mujoco.MjSpec.from_string(ARM)
    damped = spec.joint("shoulder").damping
    spec.joint("shoulder").damping = 0.08 if np.ndim(damped) == 0 else [0.08, 0.0, 0.0]
    spec.joint("elbow").frictionloss = 0.05
    spec.option.timestep = 0.001
    model, rng, runs = spec.compile(), np.random.default_rng(3), []
    time = 0.01 * np.arange(250)
    for run in range(3):
        commands = torques(rng, time)
        moved = swung(model, commands) + rng.standard_normal((250, 4)) * [2e-4, 2e-4, 5e-3, 5e-3]
        table = np.column_stack([time, commands.T, moved])
        runs.append(pd.DataFrame(table, columns=COLUMNS).assign(trajectory=f"run {run}"))
    pd.concat(runs).to_csv("arm.csv", index=False)
    return model


def commands() -> list[list[str]]:
    """The commands that the README gives for one's own log."""
    text = (ROOT / "README.md").read_text(encoding="utf-8").split("## Your own log")[1]
    (block,) = re.findall(r"```sh\n(.*?)```", text, re.S)[:1]
    return [line.split() for line in block.splitlines()]


def test_from_the_readme_to_a_report(truth: mujoco.MjModel, capsys: pytest.CaptureFixture[str]) -> None:
    init, diagnose = commands()
    assert main(init[1:]) == 0
    page = Path("setup/sim.toml")
    written = page.read_text(encoding="utf-8")
    assert '"body_mass.upper" = { value = 0.8, tolerance = 0.0, unit = "kg" }' in written
    # As the README asks: what is ASSUMED is read and confirmed, and the masses are known to 2 %.
    wrong = [row for row in re.findall(r'^(\w+) = .*column = "(\w+)".*ASSUMED', written, re.M)]
    assert dict(wrong) == {
        "shoulder_motor": "shoulder_torque", "elbow_motor": "elbow_torque",
        "shoulder_q": "shoulder_angle", "shoulder_dq": "shoulder_speed",
        "elbow_q": "elbow_angle", "elbow_dq": "elbow_speed",
    }  # fmt: skip
    known = re.sub(r"  # ASSUMED.*", "", written).replace(
        'tolerance = 0.0, unit = "kg"', 'tolerance = 0.02, unit = "kg"'
    )
    page.write_text(known, encoding="utf-8")

    capsys.readouterr()
    assert main(diagnose[1:]) == 0
    said = capsys.readouterr()
    answer = said.out.splitlines()[0]
    assert answer.startswith("Two causes: viscous friction at shoulder and Coulomb friction"), answer
    assert "friction at elbow" in answer
    assert "ASSUMED" not in said.err
    sure = {name: float(value) for name, value in re.findall(r"^(\w+ at \w+) +([\d.]+) ", said.out, re.M)}
    dry = sum(sure.get(f"{kind} at elbow", 0.0) for kind in ("coulomb_friction", "stribeck_friction"))
    assert min(sure["viscous_friction at shoulder"], dry) >= 0.7, "each of two causes may be certain"
    for name in ("report.html", "corrected.xml", "diagnosis.json"):
        assert f"wrote report/{name}" in said.out and Path("report", name).stat().st_size > 100

    # The corrected model is a MuJoCo model of its own, and follows the arm where the user's does not.
    time = 0.01 * np.arange(300)
    unseen = torques(np.random.default_rng(20), time)
    real = swung(truth, unseen)
    script = "import mujoco, sys; m = mujoco.MjModel.from_xml_path(sys.argv[1]); print(m.nu, m.nv)"
    loaded = subprocess.run([sys.executable, "-c", script, "report/corrected.xml"], capture_output=True, text=True)
    assert loaded.stdout.split() == ["2", "2"], loaded.stderr
    errors = []
    for name in ("arm.xml", "report/corrected.xml"):
        model = mujoco.MjModel.from_xml_path(name)
        model.opt.timestep = 0.001
        errors.append(np.abs(swung(model, unseen)[:, :2] - real[:, :2]).max())
    assert errors[1] < 0.1 * errors[0]
