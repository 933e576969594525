"""A draft for a simulator of whole runs."""

import numpy as np
import pandas as pd

from pamid.cli import main


def test_where_a_whole_run_begins_takes_no_column_from_what_it_returns(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    ports = {"command": ("input", "V"), "pos": ("output", "m"), "pos0": ("state", "m"), "pA0": ("state", "Pa")}
    lines = [f'{name} = {{ kind = "{kind}", unit = "{unit}" }}' for name, (kind, unit) in ports.items()]
    head = ['kind = "run"', "[run]", 'function = "drive.py:replay"', "[ports]"]
    (tmp_path / "drive.toml").write_text("\n".join([*head, *lines]))
    (tmp_path / "drive.py").write_text("def replay(u, p, x0):\n    return [x0.pos0 + 0.0 * u.command]\n")
    t = np.arange(200) * 0.01
    table = {"Time [s]": t, "u_valve [V]": np.sin(t), "position [mm]": 100.0 + np.cos(t)}
    pd.DataFrame(table).to_csv(tmp_path / "log.csv", index=False)
    assert main(["init", "log.csv", "--sim", "drive.toml", "--trust", "--yes", "--out", "setup"]) == 0
    assert '\npos = { column = "position [mm]"' in (tmp_path / "setup" / "columns.toml").read_text()
