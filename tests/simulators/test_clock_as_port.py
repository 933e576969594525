"""An input named like the log's clock: refused unless the page says that it is the clock."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from pamid.cli import main
from pamid.errors import ParameterError
from pamid.simulators import FunctionSimulator, Port

CLOCK = """
kind = "KIND"
[KIND]
BODY
[ports]
time = { kind = "input", unit = "V"MORE }
F = { kind = "output", unit = "N" }
"""


@pytest.mark.parametrize("body", [("equations", 'F = "2*time"'), ("function", 'function = "drive.py:force"')])
@pytest.mark.parametrize("command", ["diagnose", "init", "evaluate", "check"])
def test_an_input_named_time_is_the_clock_only_where_the_page_says_so(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], body: tuple[str, str], command: str
) -> None:
    t = np.arange(0, 4, 0.02)
    rng = np.random.default_rng(0)
    volt = np.sin(3 * t)
    F = 2 * t + 0.01 * rng.standard_normal(len(t))
    pd.DataFrame({"time": t, "volt": volt, "F": F}).to_csv(tmp_path / "log.csv", index=False)
    (tmp_path / "drive.py").write_text("def force(u, p):\n    return 2 * u.time\n")
    page = CLOCK.replace("KIND", body[0]).replace("BODY", body[1])
    argv = [command, str(tmp_path / "log.csv"), "--sim", str(tmp_path / "sim.toml"), "--quiet"]
    argv += {"init": ["--yes", "--out", str(tmp_path / "setup")], "check": []}.get(command, ["--trust"])
    argv += ["--effects", "sensor_gain", "--out", str(tmp_path / "out")] if command == "diagnose" else []
    (tmp_path / "sim.toml").write_text(page.replace("MORE", ""))
    status = main(argv)
    told = " ".join("".join(capsys.readouterr()).split())
    assert "The port time would be read from the column 'time', the log's clock" in told
    assert "key 'column'" in told
    assert status == (0 if command == "check" else 2)  # check looks at the log all the same
    (tmp_path / "sim.toml").write_text(page.replace("MORE", ', column = "time"'))
    assert main([*argv, "--json"] if command == "evaluate" else argv) == 0
    if command == "evaluate":
        [equation] = json.loads(capsys.readouterr().out)["equations"].values()
        assert equation["rmse"] < 0.02


def test_a_function_of_whole_runs_keeps_the_name_of_its_times() -> None:
    ports = [Port("time", "input", "V", column="volt"), Port("F", "output", "N")]
    with pytest.raises(ParameterError, match=r"u\['time'\]"):
        FunctionSimulator(lambda u, p, x0: u["time"], ports)
