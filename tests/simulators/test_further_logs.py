"""A further log and a stream of a function, a MuJoCo model and an FMU, by printed commands alone."""

from __future__ import annotations

import json
import re
import shlex
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from pamid.cli import main

WIDE = "--designs 8 --limit force=-60:60 --keep stage_q=-5:5 --keep stage_dq=-20:20"
LIBRARY = "viscous_friction,coulomb_friction,actuator_gain"
FUNCTION = """kind = "ode"
[ode]
function = "stage.py:rates"
[ports]
force = { kind = "input", unit = "N" }
stage_q = { kind = "state", unit = "m" }
stage_dq = { kind = "state", unit = "m/s" }
[parameters]
m = { value = 2.0, unit = "kg" }
"""
MODEL = """<mujoco><option gravity="0 0 0" timestep="0.001"/><worldbody><body>
<joint name="stage" type="slide" axis="1 0 0" stiffness="50"/><geom type="sphere" size="0.05" mass="2"/>
</body></worldbody><actuator><motor name="force" joint="stage"/></actuator></mujoco>"""


def function(folder: Path) -> str:
    (folder / "stage.py").write_text(
        "def rates(t, x, u, p):\n    return [x.stage_dq, (u.force - 50 * x.stage_q) / p.m]\n"
    )
    (folder / "stage.toml").write_text(FUNCTION)
    return "stage.toml"


def mujoco(folder: Path) -> str:
    pytest.importorskip("mujoco")
    (folder / "stage.xml").write_text(MODEL)
    return "stage.xml"


def fmu(folder: Path) -> str:
    pytest.importorskip("fmpy")
    if not (shutil.which("cc") or shutil.which("gcc")):
        pytest.skip("needs a C compiler")
    from pamid.export.ode_fmu import ode_fmu

    made = ode_fmu(
        "stage", lambda t, x, u, p: [x.dq, (u.force + u.load - 50.0 * x.q) / p.m], {"q": 0.0, "dq": 0.0},
        {"force": 0.0, "load": 0.0}, {"m": 2.0}, outputs=lambda t, x, u, p: {"stage_q": x.q, "stage_dq": x.dq},
        units={"force": "N", "load": "N", "stage_q": "m", "stage_dq": "m/s", "m": "kg"},
    )  # fmt: skip
    (folder / "stage.fmu").write_bytes(made)
    return "stage.fmu"


def recorded(t: np.ndarray, force: np.ndarray, damping: float | np.ndarray, seed: int) -> pd.DataFrame:
    """A stage on a spring with a damping that its simulators lack, under the names and units of its driver."""
    rng, q, dq, rows = np.random.default_rng(seed), 0.0, 0.0, []
    h = 0.0005
    for u, c in zip(force, np.broadcast_to(damping, len(t)), strict=True):
        rows.append((q, dq))
        for _ in range(round((t[1] - t[0]) / h)):
            dq += h * (u - c * dq - 50.0 * q) / 2.0
            q += h * dq
    q, dq = np.array(rows).T + [[2e-5], [1e-3]] * rng.standard_normal((2, len(t)))
    return pd.DataFrame({"Zeit [ms]": 1e3 * t, "Force [N]": force, "Weg [mm]": 1e3 * q, "Tempo [mm/s]": 1e3 * dq})


def pushed(t: np.ndarray, seed: float) -> np.ndarray:
    return 6.0 * np.sin((1.5 + 0.4 * seed) * t) + 4.0 * np.sin((3.7 - 0.3 * seed) * t)


@pytest.fixture(params=[function, mujoco, fmu], ids=lambda make: make.__name__)
def described(
    request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Callable[[str], tuple[str, list[str]]]:
    """A folder with a simulator and its mapping; returns what runs a command and gives what it prints."""
    monkeypatch.chdir(tmp_path)
    sim, t = request.param(tmp_path), np.arange(0.0, 3.0, 0.01)
    days = [recorded(t, pushed(t, k), 3.0, k).assign(Lauf=k) for k in range(2)]
    pd.concat(days).to_csv("monday.csv", index=False)

    def run(command: str) -> tuple[str, list[str]]:
        assert main(shlex.split(command)[1:]) == 0, capsys.readouterr().err
        said = capsys.readouterr().out
        return said, re.findall(r"^(?:next|once recorded as LOG): (.*)$", said, re.M)

    run.printed = run(f"pamid init monday.csv --sim {sim} --yes --out setup")[1]  # type: ignore[attr-defined]
    return run


def test_the_run_that_next_designs_goes_on_from_the_first(described) -> None:
    _, (corrected, following) = described(f"{described.printed[-1]} --effects {LIBRARY}")
    assert " evaluate " in corrected
    _, (command,) = described(f"{following} {WIDE}")
    assert "LOG" in command.split() and "--columns setup/columns.toml" in command
    plan = pd.read_csv("setup/diagnosis/next/set_points.csv")
    t = np.arange(0.0, plan["time"].max(), 0.01)
    recorded(t, np.interp(t, plan["time"], plan["force"]), 6.0, 9).to_csv("friday.csv", index=False)  # no "Lauf"
    _, printed = described(command.replace("LOG", "friday.csv", 1))
    found = json.loads(Path("setup/diagnosis-2/diagnosis.json").read_text())
    (change,) = found["changes"]
    assert (change["effect"], change["how"], change["log"]) == ("viscous_friction", "grows", "friday")
    assert change["before"] == pytest.approx(3.0, rel=0.1) and change["after"] == pytest.approx(6.0, rel=0.1)
    described(printed[0])
    _, (third,) = described(f"{printed[-1]} {WIDE}")
    assert "--columns setup/columns.toml" in third and third.endswith("--out setup/diagnosis-3")


def test_a_stream_under_the_names_of_its_driver_tells_what_has_changed(described) -> None:
    t = np.arange(0.0, 60.0, 0.02)
    stream = recorded(t, pushed(t, 0.3) + 2.0 * np.sin(0.37 * t), np.where(t < 45.0, 3.0, 6.0), 4)
    Path("samples.jsonl").write_text("".join(f"{json.dumps(row)}\n" for row in stream.to_dict("records")))
    options = described.printed[-1].partition(" --columns ")[2].partition(" --out ")[0]
    said, _ = described(f"pamid watch samples.jsonl --columns {options} --learn 35 --effects {LIBRARY} --json")
    learnt, change, end = map(json.loads, said.splitlines())
    assert "viscous_friction" in learnt["headline"] and end["findings"] == 1
    assert change["time"] == pytest.approx(45.0, abs=5.0)
    (cause,) = change["causes"]
    assert (cause["effect"], cause["how"]) == ("viscous_friction", "grows")
    assert cause["after"] == pytest.approx(6.0, rel=0.1)
