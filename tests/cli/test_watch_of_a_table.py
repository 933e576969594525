"""``pamid watch`` of a table, which is no stream."""

from __future__ import annotations

from pathlib import Path

import pytest

from pamid.cli import main

PAGE = """kind = "equations"
[equations]
"dT/dt" = "(P - G*T)/C"
[ports]
P = { kind = "input", unit = "W" }
T = { kind = "state", unit = "K" }
[parameters]
G = { value = 2.0 }
C = { value = 10.0 }
"""


def test_a_table_is_told_to_be_no_stream(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "oven.toml").write_text(PAGE)
    (tmp_path / "log.csv").write_text("time,P,T\n" + "".join(f"{0.1 * k},1,2\n" for k in range(50)))
    assert main(["watch", str(tmp_path / "log.csv"), "--sim", str(tmp_path / "oven.toml")]) == 2
    error = capsys.readouterr().err
    assert "None of the 51 lines is a JSON object; the first is 'time,P,T'" in error
    assert "column 1" not in error
    assert "Expected JSON lines, one object per sample" in error and "pamid diagnose" in error
