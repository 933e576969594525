"""A stream of samples watched with a simulator that has ports, in Python and on the command line."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from pamid.cli import main
from pamid.errors import ParameterError
from pamid.simulators import EquationSimulator, Port, page_text
from pamid.systems.cylinder import Cylinder
from pamid.watching import SimulatorWatch

LIBRARY = ["parameter_deviation", "sensor_bias"]
CHANGED = 150.0


def piston() -> EquationSimulator:
    """A piston: its force is its area times the pressure."""
    ports = [Port("P", "input", "Pa"), Port("F", "output", "N")]
    return EquationSimulator({"F": "P * area"}, ports, {"area": (5e-4, 0.0, "m^2")})


def stream(seed: int, area: float, offset: float = 0.0) -> pd.DataFrame:
    """Four minutes, of which the last minute and a half are those of another area."""
    rng, t = np.random.default_rng(seed), np.arange(0, 240, 0.02)
    P = 3e5 + 1e5 * np.sin(2.0 * t) + 5e4 * np.sin(5.3 * t + seed)
    F = np.where(t < CHANGED, 5e-4, area) * P + offset + rng.normal(0, 1, len(t))
    return pd.DataFrame({"trajectory": "a", "time": t, "P": P, "F": F})


@pytest.mark.slow
def test_what_has_changed_is_named_and_what_was_so_from_the_start_is_no_change() -> None:
    log = stream(0, 6e-4, offset=20.0)
    watch = SimulatorWatch(piston(), LIBRARY).learn(log[:5000])
    assert watch.known == ["sensor_bias at F"]
    [found] = [c for k in range(5000, 12_000, 500) for c in watch.update(log[k : k + 500])]
    assert found.time == pytest.approx(CHANGED, abs=3.0) and found.equation == "F"
    [change] = found.changes
    assert (change.effect, change.where) == ("parameter_deviation", "area")


@pytest.mark.slow
def test_a_seal_that_begins_to_rub_is_named() -> None:
    rng, t = np.random.default_rng(0), np.arange(0, 240, 0.02)
    x, v = 0.02 + 0.015 * np.sin(2.0 * t), 0.03 * np.cos(2.0 * t)
    P = 3e5 + 8e4 * np.sin(1.3 * t)
    dry = np.where(t < CHANGED, 0.0, 6.0) * np.tanh(v / 1e-3)
    F = 4.9087e-4 * (P - 101_325.0) - dry + 0.3 * rng.standard_normal(len(t))
    log = pd.DataFrame({"trajectory": "a", "time": t, "x": x, "P": P, "F": F})
    watch = SimulatorWatch(Cylinder(bore=0.025), ["coulomb_friction", "force_bias"]).learn(log[:5000])
    assert watch.known == []
    [found] = [c for k in range(5000, 12_000, 500) for c in watch.update(log[k : k + 500])]
    assert found.time == pytest.approx(CHANGED, abs=3.0) and found.equation == "force"
    [change] = found.changes
    assert change.effect == "coulomb_friction" and change.after == pytest.approx(6.0, rel=0.1)


@pytest.mark.slow
def test_a_healthy_stream_is_left_alone() -> None:
    log = stream(1, 5e-4)
    watch = SimulatorWatch(piston(), LIBRARY).learn(log[:5000])
    assert watch.known == [] and watch.update(log[5000:]) == []


def test_a_watch_learns_before_it_watches() -> None:
    with pytest.raises(ParameterError, match="not been trained"):
        SimulatorWatch(piston()).update(stream(0, 5e-4))


MAPPING = """[signals]
time = { column = "t", unit = "ms" }
P = { column = "Druck", unit = "bar", gauge = false }
F = { column = "Kraft", unit = "N" }
"""


@pytest.mark.slow
@pytest.mark.parametrize("mapped", [False, True])
def test_from_the_command_line(mapped: bool, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "piston.toml").write_text(page_text(piston()))
    log = stream(2, 6e-4).drop(columns="trajectory")
    if mapped:
        (tmp_path / "columns.toml").write_text(MAPPING)
        log = pd.DataFrame({"t": 1e3 * log["time"], "Druck": 1e-5 * log["P"], "Kraft": log["F"]})
    lines = [json.dumps(row) for row in log.to_dict("records")]
    lines[7000] = "not a sample"
    (tmp_path / "samples.jsonl").write_text("\n".join(lines) + "\n")
    argv = ["watch", str(tmp_path / "samples.jsonl"), "--sim", str(tmp_path / "piston.toml"), "--learn", "100"]
    argv += ["--effects", ",".join(LIBRARY)]
    argv += ["--columns", str(tmp_path / "columns.toml")] if mapped else []
    assert main([*argv, "--json"]) == 0
    learnt, change, end = (json.loads(line) for line in capsys.readouterr().out.splitlines())
    assert (learnt["event"], change["event"], end["event"]) == ("learnt", "change", "end")
    assert change["causes"][0]["where"] == "area" and end["problems"]["malformed"] == 1
    assert main([*argv, "--model", "m.pamid"]) == 2
    assert "they are for muscles" in capsys.readouterr().err
