"""``pamid init`` with a python-control system, and with other Python code."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from pamid.cli import main
from pamid.simulators import read_simulator

CODE = """import control
CELL = control.ss([[-0.03]], [[0.001]], [[-1.0]], [[-0.05]])
def made(): return control.tf([1.0], [5.0, 1.0], inputs="Current", outputs="rise")
def rates(t, x, u, p): return [u.i / p.C]
"""


@pytest.fixture
def cell(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    pytest.importorskip("control")
    t = np.arange(0.0, 60.0, 1.0)
    pd.DataFrame({"t (s)": t, "Current(A)": np.sin(t / 9), "dV(mV)": np.cos(t / 9)}).to_csv(
        tmp_path / "cell.csv", index=False
    )
    (tmp_path / "cell.py").write_text(CODE)
    (tmp_path / "bare.toml").write_text('kind = "control"\n[control]\nsystem = "cell.py:CELL"\n')
    ports = '[ports]\nu0 = { kind = "input", unit = "A" }\ny0 = { kind = "output", unit = "V" }\n'
    (tmp_path / "units.toml").write_text((tmp_path / "bare.toml").read_text() + ports)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_the_only_column_of_a_quantity_is_its_port(cell: Path) -> None:
    """The d of dV is that of a difference, and no mark of a desired value."""
    assert main(["init", "cell.csv", "--sim", "units.toml", "--yes", "--out", "setup"]) == 0
    assert 'y0 = { column = "dV(mV)", unit = "mV" }' in (cell / "setup" / "columns.toml").read_text()


def test_states_within_a_system_are_not_asked_for(cell: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["init", "cell.csv", "--sim", "bare.toml", "--trust", "--yes", "--out", "setup"]) == 0
    told = capsys.readouterr().out
    assert "--signal y0=COLUMN" in told and "x0" not in told
    assert "Run init again with --force" in told


def test_a_system_in_a_python_file_gets_a_simulator_file(cell: Path, capsys: pytest.CaptureFixture[str]) -> None:
    argv = ["init", "cell.csv", "--signal", "rise=dV(mV)", "--yes", "--out", "setup", "--sim"]
    assert main([*argv, "cell.py:made"]) == 2
    assert "add --trust" in capsys.readouterr().err
    assert main([*argv, "cell.py:made", "--trust"]) == 0
    assert "--sim setup/sim.toml --trust" in capsys.readouterr().out
    made = read_simulator(cell / "setup" / "sim.toml", trust=True)
    assert [made.port(name).unit for name in ("Current", "rise")] == ["A", "mV"]
    assert made.hidden_states == ("x0",)


@pytest.mark.parametrize(
    ("sim", "said"),
    [
        ("cell.py", "--sim cell.py:NAME with one of CELL, made, rates"),
        ("cell.py:plant", "'plant', which cell.py does not define"),
        ("cell.py:rates", "rates(t, x, u, p) of cell.py, which says neither the order nor the units"),
        ("none.py:rates", "none.py does not exist"),
    ],
)
def test_other_code_is_told_what_it_needs(sim: str, said: str, cell: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (cell / "cell.py").write_text(CODE + "raise SystemExit('this must not run')\n")
    assert main(["init", "cell.csv", "--sim", sim, "--yes", "--out", "setup"]) == 2
    assert said in capsys.readouterr().err
