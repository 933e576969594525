"""Simulators that are random or keep something between calls are told; those that do not are not."""

from __future__ import annotations

import json
import re
import warnings
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from pamid.cli import main
from pamid.errors import SimulatorWarning
from pamid.gap.simulated import evidence_of
from pamid.simulators import FunctionSimulator, Port
from pamid.simulators.port_log import port_log
from pamid.simulators.steadiness import tell_if_unsteady

PORTS = [Port("F", "input", "N"), Port("x", "state", "m"), Port("v", "state", "m/s")]
OUTWARD = [Port("F", "input", "N"), Port("y", "output", "m")]


def log() -> pd.DataFrame:
    t, rng = np.arange(0, 1, 0.01), np.random.default_rng(0)
    F = 6 * np.sin(3 * t)
    v = np.cumsum(F) * 0.01 / 2.0 + 1e-3 * rng.standard_normal(len(t))
    x = np.cumsum(v) * 0.01 + 1e-5 * rng.standard_normal(len(t))
    return pd.DataFrame({"trajectory": "a", "time": t, "F": F, "x": x, "v": v, "y": x})


def cart(kept: list, more):
    return FunctionSimulator(lambda t, x, u, p: [x.v, u.F / p.m + more(kept, u)], PORTS, {"m": 2.0})


def noisy(kept, u):
    return 1e-3 * kept[0].standard_normal()


def counting(kept, u):
    kept.append(0)
    return 1e-4 * len(kept)


def lagging(kept, u):
    kept[0], before = u.F, kept[0]
    return 0.01 * np.mean(before)


@pytest.mark.parametrize(
    ("kept", "more"), [([np.random.default_rng(1)], noisy), ([], counting), ([0.0], lagging)],
    ids=["random", "counting", "last input"],
)  # fmt: skip
def test_a_simulator_that_answers_differently_is_told(kept, more):
    sim = cart(kept, more)
    asked = port_log(log(), sim)
    with pytest.warns(SimulatorWarning, match="different values of v"):
        tell_if_unsteady(sim, asked)
    with warnings.catch_warnings():
        warnings.simplefilter("error", SimulatorWarning)
        assert tell_if_unsteady(sim, asked) == sim.unsteady  # warned once, noted each time


def test_a_whole_run_that_goes_on_from_the_last_one_is_told():
    kept = [0.0]

    def run(u, p, x0):
        y = kept[0] + 0.01 * np.cumsum(u["F"])
        kept[0] = float(y[-1])
        return [y]

    with pytest.warns(SimulatorWarning, match="different values of y"):
        evidence_of(log(), FunctionSimulator(run, OUTWARD, form="run"))


def test_a_simulator_that_keeps_nothing_is_not_told():
    with warnings.catch_warnings():
        warnings.simplefilter("error", SimulatorWarning)
        evidence_of(log(), cart([], lambda kept, u: 0.0))


def test_every_command_that_runs_a_random_simulator_says_the_same(tmp_path, monkeypatch, capsys):
    """In `diagnose` it is among the notes of the answer, too; without trust nothing runs."""
    monkeypatch.chdir(tmp_path)
    log().head(40).to_csv("log.csv", index=False)
    code = "import random\n\ndef rates(t, x, u, p):\n    return [x.v, u.F / p.m + 1e-3 * random.gauss(0, 1)]\n"
    Path("cart.py").write_text(code)
    Path("sim.toml").write_text(
        'kind = "ode"\n[ode]\nfunction = "cart.py:rates"\n[ports]\nF = { kind = "input", unit = "N" }\n'
        'x = { kind = "state", unit = "m" }\nv = { kind = "state", unit = "m/s" }\n[parameters]\nm = 2.0\n'
    )
    sentence = re.compile(
        r"Called twice with the same inputs, the simulator returns different values of v \(by up to [\d.e-]+ of the "
        r"largest value\): it is random, or keeps state between calls\. Fits and intervals need repeatable values: fix "
        r"its seed in each call, and keep no state from one call to the next\."
    )
    given = ["log.csv", "--sim", "sim.toml"]
    commands = {
        "check": [], "evaluate": [], "init": ["--yes", "--out", "setup"],
        "diagnose": ["--effects", "viscous_friction", "--out", "out"],
    }  # fmt: skip
    for command, more in commands.items():
        assert main([command, *given, "--trust", *more]) == 0
        assert sentence.search(" ".join("".join(capsys.readouterr()).split())), command
    notes = json.loads(Path("out/diagnosis.json").read_text(encoding="utf-8"))["notes"]
    assert any(sentence.fullmatch(note) for note in notes)
    for command in ("check", "init"):
        assert main([command, *given, *commands[command], *(["--force"] if command == "init" else [])]) == 0
        assert not sentence.search(" ".join("".join(capsys.readouterr()).split()))
