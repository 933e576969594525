"""Columns in other units than their names say: told by what the simulator makes of the values, and by physics alone."""

from __future__ import annotations

import json
from collections.abc import Callable

import numpy as np
import pandas as pd
import pytest

from pamid.bench import BenchParameters, simulate, sine, step
from pamid.cli import main
from pamid.constants import ATMOSPHERIC_PRESSURE as ATM
from pamid.constants import GRAVITY
from pamid.equations import evaluate_log, unit_doubts
from pamid.errors import UnitWarning
from pamid.gap import diagnose
from pamid.signals.plausibility import implausible_units
from pamid.survey.scales import scale_doubts
from pamid.survey.survey import survey

BENCH = BenchParameters.for_muscle("B")
Change = Callable[[pd.DataFrame], pd.DataFrame]


@pytest.fixture(scope="module")
def log() -> pd.DataFrame:
    log = simulate(BENCH, [sine(2, 3, 800), sine(5, 2, 600)], effects=["leakage"], seed=0)
    return log.astype({c: float for c in log.columns if c != "trajectory"})


def times(factor: float, *columns: str, plus: float = 0.0) -> Change:
    return lambda log: log.assign(**{c: factor * log[c] + plus for c in columns})


MISTAKES: dict[str, tuple[Change, str]] = {
    "kN": (times(1e-3, "F1", "F2"), "F1 and F2 look like kN"),
    "kgf": (times(1 / GRAVITY, "F1", "F2"), "F1 and F2 look like kgf"),
    "one in kgf": (times(1 / GRAVITY, "F2"), "F2 looks like kgf"),
    "lbf": (times(1 / 4.4482, "F1"), "F1 looks like lbf"),
    "g/s": (times(1e3, "mdot1", "mdot2"), "mdot1 and mdot2 look like g/s"),
    "kg/h": (times(3600, "mdot1"), "mdot1 looks like kg/h"),
    "gauge": (times(1, "P1", "P2", plus=-ATM), "P1 and P2 look like gauge pressure"),
    "one gauge": (times(1, "P2", plus=-ATM), "P2 looks like gauge pressure"),
    "ambient added twice": (times(1, "P1", "P2", plus=ATM), "P1 and P2 look like absolute pressure to which"),
    "small degrees": (times(180 / np.pi, "q"), "q looks like degrees"),
    "rad as degrees": (times(np.pi / 180, "q"), "q looks like rad that were taken for degrees"),
    "small volts": (times(5, "u1", "u2"), "u1 and u2 look like volts of a valve for 5 V"),
    "a turned force": (times(-1, "F1", "F2"), "F1 and F2 look like a signal of the opposite sign"),
    "a turned angle": (times(-1, "q"), "q looks like a signal of the opposite sign"),
}


@pytest.mark.parametrize("name", MISTAKES)
def test_a_unit_is_told_by_what_the_simulator_makes_of_it(name, log):
    change, words = MISTAKES[name]
    wrong = change(log)
    found = unit_doubts(wrong, BENCH)
    assert len(found) == 1
    assert found[0].startswith(words)


def test_small_values_pass_the_ranges_that_units_are_first_held_against(log):
    """Else the test above would prove nothing: these are the cases that no range can catch."""
    for name in ("kN", "kgf", "small degrees", "gauge"):
        assert implausible_units(MISTAKES[name][0](log)) == [], name


def test_several_mistakes_at_once_are_all_told(log):
    wrong = MISTAKES["kgf"][0](MISTAKES["gauge"][0](MISTAKES["small degrees"][0](log)))
    assert sorted(text.split(" look")[0] for text in unit_doubts(wrong, BENCH)) == ["F1 and F2", "P1 and P2", "q"]
    for lacking in (["F1", "F2"], ["mdot1", "mdot2"], ["u1", "u2"], ["F1", "F2", "mdot1", "mdot2"]):
        found = unit_doubts(MISTAKES["small degrees"][0](log).drop(columns=lacking), BENCH)
        assert [text.split(" look")[0] for text in found] == ["q"], lacking


@pytest.mark.parametrize(
    "effect",
    ["leakage", "diameter", "braid_angle", "valve_dead_zone", "flow_lag", "gravity", "hysteresis", "angle_delay"],
)
def test_a_gap_is_no_unit(effect):
    log = simulate(BENCH, [sine(4, 15, 600), sine(8, 10, 600), step(0, 10, 600)], effects=[effect], seed=0)
    assert unit_doubts(log, BENCH) == []


def test_sensors_that_are_somewhat_off_are_no_unit(log):
    for change in (times(1.4, "F1"), times(1, "P1", plus=4e4), times(0.7, "mdot2"), times(1.5, "u1", "u2")):
        assert unit_doubts(change(log), BENCH) == []
    assert unit_doubts(log, BENCH.replace(rest_diameter=0.03)) == []


def test_every_answer_says_so(log):
    wrong = MISTAKES["kgf"][0](log)
    with pytest.warns(UnitWarning, match="F1 and F2 look like kgf"):
        evaluate_log(wrong, BENCH)
    assert any("look like kgf" in text for text in survey(wrong, BENCH).warnings)
    assert any("look like kgf" in text for text in diagnose(wrong, BENCH, ["leakage", "force_bias"]).notes)


def test_the_command_line_says_so(log, tmp_path, capsys):
    MISTAKES["small volts"][0](log).to_csv(tmp_path / "log.csv", index=False)
    BENCH.to_toml(tmp_path / "sim.toml")
    argv = [str(tmp_path / "log.csv"), "--sim", str(tmp_path / "sim.toml"), "--json"]
    assert main(["evaluate", *argv]) == 0
    assert "u1 and u2 look like volts" in capsys.readouterr().err
    assert main(["check", *argv]) == 0
    assert any("look like volts" in text for text in json.loads(capsys.readouterr().out)["warnings"])


@pytest.fixture(scope="module")
def wide() -> pd.DataFrame:
    return simulate(BENCH, [sine(4, 15, 2000)], effects=["leakage"], seed=0)


def test_forces_and_flows_that_no_muscle_makes_are_told_without_a_simulator(wide):
    assert scale_doubts(wide) == []
    wrong = times(1e-3, "F1")(times(1e3, "mdot2")(wide))
    force, flow = scale_doubts(wrong)
    assert "F1 is in kN" in force
    assert "mdot2 seems not to be in kg/s" in flow
    assert [text for text in survey(wrong).warnings if text in (force, flow)] == [force, flow]


def test_a_pressure_that_falls_to_nothing_or_below_is_gauge(wide, tmp_path, capsys):
    for least in (0.0, -800.0):
        wrong = wide.assign(P1=wide["P1"] - wide["P1"].min() + least)
        wrong.to_csv(tmp_path / "log.csv", index=False)
        assert main(["check", str(tmp_path / "log.csv"), "--json"]) == 0
        assert any("that looks like gauge pressure" in t for t in json.loads(capsys.readouterr().out)["warnings"])


@pytest.mark.parametrize(("column", "times"), [("F1", 3276.8), ("F2", 0.0305), ("u1", 3276.8), ("mdot2", 7.0)])
def test_a_factor_of_no_known_unit_is_told_with_its_column(column: str, times: float) -> None:
    log = simulate(BENCH, [sine(4, 15, 400), sine(2, 10, 400)], seed=0)
    (doubt,) = unit_doubts(log.assign(**{column: times * log[column]}), BENCH)
    found = float(doubt.partition("=COLUMN*")[2].partition("'")[0])
    assert doubt.startswith(f"{column} may be in another unit") and found == pytest.approx(1.0 / times, rel=0.05)
