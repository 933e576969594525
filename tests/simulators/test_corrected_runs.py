"""What a diagnosis hands over runs; where it cannot be made, the diagnosis is still written, and says so."""

import json
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from pamid.cli import main
from pamid.gap.diagnosis.rivals import Rival
from pamid.gap.several import read_history
from pamid.simulators import read_simulator

PAGE = """
kind = "ode"
[ode]
function = "cart.py:rates"
[ports]
F = { kind = "input", unit = "N" }
v = { kind = "state", unit = "m/s" }
[parameters]
m = { value = 2.0, unit = "kg" }
"""


@pytest.fixture
def cart(tmp_path, monkeypatch):
    """A cart whose log has an actuator that is too weak."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "cart.py").write_text("def rates(t, x, u, p):\n    return [u.F / p.m]\n")
    (tmp_path / "sim.toml").write_text(PAGE)
    t, parts, rng = np.arange(0, 4, 0.01), [], np.random.default_rng(0)
    for k in range(2):
        F = 6 * np.sin((1 + k) * t)
        v = 0.8 * 6 * (1 - np.cos((1 + k) * t)) / (1 + k) / 2.0 + 1e-3 * rng.standard_normal(len(t))
        parts.append(pd.DataFrame({"trajectory": f"run {k}", "time": t, "F": F, "v": v}))
    pd.concat(parts).to_csv("log.csv", index=False)
    return tmp_path


COMMAND = ["diagnose", "log.csv", "--sim", "sim.toml", "--trust", "--out", "found", "--effects", "actuator_gain"]


def test_a_page_that_loads_is_handed_over(cart, capsys):
    assert main(COMMAND) == 0
    capsys.readouterr()
    assert (cart / "found" / "corrected.toml").is_file()
    assert "left out" not in (cart / "found" / "diagnosis.json").read_text()
    assert main(["evaluate", "log.csv", "--sim", "found/corrected.toml", "--trust", "--json"]) == 0


def test_a_diagnosis_outlives_a_page_that_does_not_load(cart, capsys):
    # A module that can be imported once alone, as one that opens a device.
    once = "import pathlib\nmark = pathlib.Path(__file__).with_name('mark')\nmark.touch(exist_ok=False)\n"
    (cart / "cart.py").write_text(once + (cart / "cart.py").read_text())
    assert main(COMMAND) == 0
    told = capsys.readouterr().out
    assert "corrected.toml left out" in told and "FileExistsError" in told
    found = json.loads((cart / "found" / "diagnosis.json").read_text())
    assert any("corrected.toml left out" in text for text in found["notes"])
    assert "corrected.toml left out" in (cart / "found" / "report.html").read_text()
    assert not (cart / "found" / "corrected.toml").exists()


def test_what_a_page_closes_less_than_the_report_says_is_told(cart, capsys, monkeypatch):
    monkeypatch.setattr("pamid.cli._corrected._short", lambda d, log, simulator: {"v": 0.3})
    assert main(COMMAND) == 0
    told = "corrected.toml closes 30 % of the gap in v on this log, less than the report says."
    assert told in " ".join(capsys.readouterr().out.split())  # wherever the lines end
    assert told in json.loads((cart / "found" / "diagnosis.json").read_text())["notes"]
    assert (cart / "found" / "corrected.toml").is_file()


@pytest.mark.slow
def test_what_no_effect_explains_hands_over_no_simulator(cart, capsys):
    log = pd.read_csv("log.csv")
    log["v"] += 0.25 * (log["v"] - 0.5 * np.cos(5.3 * log["time"]))  # a push beside the actuator's
    log.to_csv("log.csv", index=False)
    assert main(COMMAND) == 0
    told = capsys.readouterr().out
    assert json.loads((cart / "found" / "diagnosis.json").read_text())["verdict"] == "unknown"
    assert not list((cart / "found").glob("corrected*")) and "corrected.toml" not in told


@pytest.mark.slow
def test_after_no_gap_next_calls_nothing_undecided(cart, capsys):
    log = pd.read_csv("log.csv")
    log["v"] *= 1.25  # with an actuator as the page has it
    log.to_csv("log.csv", index=False)
    assert main([*COMMAND, "--quiet"]) == 0
    assert json.loads((cart / "found" / "diagnosis.json").read_text())["verdict"] == "none"
    history = read_history(cart / "found", read=lambda page: read_simulator(page, trust=True))
    (none,) = history.rivals  # the other one is not ruled out either, but there is no gap that it would explain
    gain = Rival({"actuator_gain@F": {"deviation": 0.01}}, none.deviations, none.score + 0.5, 0.4)
    history.rivals = [replace(none, belief=0.6), gain]
    history.write(cart / "found", cart / "found")
    capsys.readouterr()
    assert main(["next", "found", "--trust", "--designs", "8", "--quiet"]) == 0
    told = capsys.readouterr().out
    assert "no effect" in told or "Nothing is undecided" in told
    assert "Undecided" not in told


def test_two_values_for_one_state_are_told(cart, capsys):
    (cart / "cart.py").write_text("def rates(t, x, u, p):\n    return [u.F / p.m, 0.0]\n")
    assert main(COMMAND) != 0
    told = capsys.readouterr().err
    assert "rates returned 2 values" in told and "inside pamid" not in told


NAMELESS = """<mujoco><worldbody><geom size=".1"/><body><joint axis="0 1 0"/><geom size=".1" pos="0 0 -.3"/>
<body name="tip"><geom size=".02"/><body><joint axis="0 1 0" damping="1"/><geom size=".05" pos="0 0 -.2"/></body></body>
</body></worldbody><actuator><motor joint="hinge"/></actuator></mujoco>"""


def test_a_model_whose_parts_have_no_names_is_corrected(tmp_path):
    pytest.importorskip("mujoco")
    import mujoco

    from pamid.simulators import MujocoSimulator
    from pamid.simulators.mujoco_versions import _version

    if _version() < (3, 3):
        pytest.skip("an older MuJoCo asks for names")
    (tmp_path / "arm.xml").write_text(NAMELESS.replace("<joint axis", '<joint name="hinge" axis', 1))
    before = MujocoSimulator(tmp_path / "arm.xml")
    numbers = before.own_numbers()
    heavier = MujocoSimulator(tmp_path / "arm.xml", parameters={n: 1.5 * p.value for n, p in numbers.items()})
    text, rest = heavier.with_({}, [("coulomb_friction", "hinge", {"amplitude": 0.3})]).corrected_xml()
    after = mujoco.MjModel.from_xml_string(text)
    assert not rest and after.dof_frictionloss[0] == 0.3
    assert np.allclose(after.body_mass, 1.5 * before._m.body_mass) and np.allclose(after.dof_damping, [0.0, 1.5])
