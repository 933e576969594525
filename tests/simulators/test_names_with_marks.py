"""Names that differ in a mark alone, as `q1*` for what is wanted and `q1` for what is read, stay apart."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from pamid.cli import main
from pamid.errors import ParameterError
from pamid.signals import read_log
from pamid.simulators import ControlSimulator, Port
from pamid.simulators.fmu_model import _distinct

PAGE = """
kind = "equations"
[equations]
q1 = "2*volt"
[ports]
volt = { kind = "input", unit = "V" }
q1 = { kind = "output", unit = "N" }
"""


@pytest.mark.parametrize(("columns", "taken"), [(["q1*", "q1"], "q1"), (["q1", "q1*"], "q1"), (["q1*"], "")])
def test_a_column_with_a_mark_is_another_signal_than_the_port_without_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], columns: list[str], taken: str
) -> None:
    t = np.arange(0, 4, 0.01)
    table = {"time": t, "volt": np.sin(3 * t)} | {c: (k + 2) * np.sin(3 * t) for k, c in enumerate(columns)}
    pd.DataFrame(table).to_csv(tmp_path / "log.csv", index=False)
    (tmp_path / "sim.toml").write_text(PAGE)
    argv = ["init", str(tmp_path / "log.csv"), "--sim", str(tmp_path / "sim.toml"), "--out", str(tmp_path), "--yes"]
    assert main(argv) == 0
    told = "".join(capsys.readouterr())
    if taken:
        read = read_log(tmp_path / "log.csv", tmp_path / "columns.toml")
        assert read["q1"].to_numpy() == pytest.approx(table[taken])
    else:
        assert "no column is known for q1: add --signal q1=COLUMN:N" in told
    assert main([*argv, "--force", "--json", "--signal", f"q1={columns[0]}:N"]) == 0
    assert json.loads(capsys.readouterr().out)["signals"]["q1"]["column"] == columns[0]
    if columns[0] == "q1":  # a * behind the name of a column is a factor
        assert main([*argv, "--force", "--json", "--signal", "q1=q1*0.5"]) == 0
        assert json.loads(capsys.readouterr().out)["signals"]["q1"]["scale"] == 0.5


def test_ports_whose_plain_names_collide_are_kept_apart_or_refused() -> None:
    assert _distinct(["q1*", "q1"]) == {"q1": "q1", "q1_2": "q1*"}
    with pytest.raises(ParameterError, match=r"named 'q1\*'"):
        Port("q1*", "input")
    control = pytest.importorskip("control")
    for names in ({"inputs": ["q1*", "q1"], "outputs": ["y"]}, {"inputs": ["q1*", "u"], "outputs": ["q1"]}):
        system = control.ss([[-1.0]], [[1.0, 2.0]], [[1.0]], [[0.0, 0.0]], **names)
        with pytest.raises(ParameterError, match=r"'q1\*' and 'q1' of the system both give the port q1"):
            ControlSimulator(system)
