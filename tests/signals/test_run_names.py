"""Names of runs are text, exactly as written, in every format."""

from __future__ import annotations

import json
from pathlib import Path

import h5py
import numpy as np
import pandas as pd
import pytest
import scipy.io
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import pamid
from pamid.bench import BenchParameters, simulate, sine, unfold
from pamid.cli import main
from pamid.errors import ColumnTypeError, ReadingWarning, TimeOrderError
from pamid.signals import read_log, read_log_pieces, write_log

TIME = [0.0, 0.001, 0.002]
AWKWARD = [
    "20240101",
    "01",
    "1",
    "001",
    "2",
    "3b",
    "NA",
    "None",
    "nan",
    "run#1",
    "#2",
    "1e5",
    "1.0",
    "True",
    "a,b",
    'c"d',
]
AWKWARD += [" x", "x ", "ä ö", "line\nend", "-0", "inf", "0x10", "2024-01-01", "'q'", ";", "\t"]
NAMES = st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\0"), min_size=1, max_size=12)


def log_of(names: list) -> pd.DataFrame:
    n = len(names)
    return pd.DataFrame({"trajectory": np.repeat(names, 3), "time": TIME * n, "P": np.linspace(2e5, 3e5, 3 * n)})


def to_json(log: pd.DataFrame, path: Path) -> Path:
    path.write_text(json.dumps(log.to_dict("records")), encoding="utf-8")
    return path


def to_matlab(log: pd.DataFrame, path: Path) -> Path:
    cell = log["trajectory"].to_numpy(dtype=object)
    scipy.io.savemat(path, {"trajectory": cell, "time": log["time"].to_numpy(), "P": log["P"].to_numpy()})
    return path


FORMATS = {".csv": write_log, ".parquet": write_log, ".h5": write_log, ".json": to_json, ".mat": to_matlab}


def survives(names: list[str], ending: str, folder: Path) -> None:
    log = log_of(names)
    file = FORMATS[ending](log, folder / f"log{ending}")
    back = read_log(file)
    assert back["trajectory"].tolist() == log["trajectory"].tolist()
    np.testing.assert_allclose(back["P"], log["P"], rtol=1e-15)
    pieces = pd.concat(read_log_pieces(file, rows=4))
    assert pieces["trajectory"].tolist() == log["trajectory"].tolist()


@pytest.mark.parametrize("ending", FORMATS)
def test_awkward_names(ending, tmp_path):
    survives(AWKWARD, ending, tmp_path)


@pytest.mark.parametrize("ending", FORMATS)
@given(names=st.lists(NAMES, min_size=1, max_size=6, unique=True))
@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_any_names(ending, names, tmp_path):
    survives(names, ending, tmp_path)


@pytest.mark.parametrize("ending", [".csv", ".parquet", ".h5", ".json"])
def test_numbers_keep_all_digits(ending, tmp_path):
    log = log_of([20240101, 20240102, 2**53])
    for names in (log["trajectory"], log["trajectory"].astype(float)):
        back = read_log(FORMATS[ending](log.assign(trajectory=names), tmp_path / f"log{ending}"))
        assert back["trajectory"].unique().tolist() == ["20240101", "20240102", str(2**53)]


@pytest.mark.parametrize("packed", [False, True])
@pytest.mark.parametrize("inside", [False, True])
def test_matlab_names_runs_by_numbers_characters_and_cells(packed, inside, tmp_path):
    for names in ([20240101.0, 20240102.0], ["a", "b 12"], np.array(["a", "€𝄞"], dtype=object)):
        column = np.repeat(names, 3).reshape(-1, 1)
        variables = {"trajectory": column, "time": np.array(TIME * 2).reshape(-1, 1), "P": np.full((6, 1), 2e5)}
        scipy.io.savemat(tmp_path / "a.mat", {"log": variables} if inside else variables, do_compression=packed)
        found = read_log(tmp_path / "a.mat")["trajectory"].unique().tolist()
        assert found == ["20240101", "20240102"] if not isinstance(names[0], str) else list(names)


def matlab73(path: Path, fill) -> Path:
    with h5py.File(path, "w") as file:
        for name, values in {"time": TIME * 2, "P": [2e5] * 6}.items():
            file[name] = np.array([values])
            file[name].attrs["MATLAB_class"] = np.bytes_("double")
        fill(file)
    return path


def characters(file: h5py.File) -> None:
    file["trajectory"] = np.array([[ord(c) for c in name] for name in ["a  "] * 3 + ["b12"] * 3], dtype="u2").T
    file["trajectory"].attrs["MATLAB_class"] = np.bytes_("char")


def cells(file: h5py.File) -> None:
    refs = []
    for k, name in enumerate(["a"] * 3 + ["b12"] * 3):
        item = file.create_dataset(f"#refs#/{k}", data=np.array([[ord(c)] for c in name], dtype="u2"))
        item.attrs["MATLAB_class"] = np.bytes_("char")
        refs.append(item.ref)
    file.create_dataset("trajectory", (1, 6), dtype=h5py.ref_dtype)[0, :] = refs
    file["trajectory"].attrs["MATLAB_class"] = np.bytes_("cell")


def strings(file: h5py.File) -> None:
    file.create_dataset("trajectory", data=["a"] * 3 + ["b12"] * 3, dtype=h5py.string_dtype())


@pytest.mark.parametrize("fill", [characters, cells, strings])
def test_hdf5_names_runs_by_text(fill, tmp_path):
    assert read_log(matlab73(tmp_path / "a.mat", fill))["trajectory"].unique().tolist() == ["a", "b12"]


def test_names_that_cannot_be_read_are_not_left_out(tmp_path):
    file = matlab73(tmp_path / "a.h5", lambda f: f.create_dataset("trajectory", (6,), dtype=h5py.ref_dtype))
    with pytest.raises(ColumnTypeError, match="names its runs in 'trajectory'"):
        read_log(file)


@pytest.mark.parametrize("name", ["", "a\0b", "\ud800"])
def test_names_that_no_file_can_hold_are_refused(name, tmp_path):
    log = log_of(["a", "b"])
    names = log["trajectory"].astype(object).replace("a", name)
    with pytest.raises(ColumnTypeError, match=r"A run is named|name of a run"):
        write_log(pd.DataFrame({"trajectory": names, "time": log["time"]}, dtype=object), tmp_path / "log.csv")


def test_names_of_single_muscles_survive(tmp_path):
    bench = BenchParameters.for_muscle("B")
    table = unfold(simulate(bench, [sine(4, 10, 50), sine(8, 10, 50)]), bench)
    back = read_log(write_log(table.drop(columns="run"), tmp_path / "muscles.csv"))
    assert back["trajectory"].tolist() == table["trajectory"].tolist()


def test_a_clock_that_restarts_makes_no_name_twice(tmp_path):
    log = log_of(["1", "1.1"])
    log.loc[2, "time"] = 0.0
    log = pd.concat([log.iloc[:3], log.iloc[2:3].assign(time=1.0), log.iloc[3:]])
    back = read_log(write_log(log, tmp_path / "log.csv"), time_order="split", sampling="ignore")
    assert back["trajectory"].unique().tolist() == ["1.1#2", "1.2", "1.1"]


def test_names_of_several_files_stay_apart(tmp_path):
    first, second = tmp_path / "x.csv", tmp_path / "y.csv"
    write_log(log_of(["a", "a@y"]), first)
    write_log(log_of(["a"]), second)
    back = read_log([first, second])
    assert back["trajectory"].unique().tolist() == ["a@x", "a@y", "a@y#2"]
    pieces = pd.concat(read_log_pieces([first, second]))
    assert pieces["trajectory"].unique().tolist() == ["a", "a@y", "a@y#2"]


def test_a_run_recorded_later_may_come_without_the_column_that_names_runs(tmp_path: Path) -> None:
    mapping = {"signals": {"time": "t", "P": "p"}, "trajectory": "Run"}
    log = pd.DataFrame({"t": TIME, "p": [2e5, 2.1e5, 2.2e5]})
    log.to_csv(tmp_path / "later.csv", index=False)
    with pytest.warns(ReadingWarning, match="no column 'Run' names the runs, so this file is read as one run"):
        assert read_log(tmp_path / "later.csv", mapping)["trajectory"].unique().tolist() == ["later"]
    pd.concat([log, log]).to_csv(tmp_path / "two.csv", index=False)
    with pytest.raises(TimeOrderError, match="time goes backwards"):
        read_log(tmp_path / "two.csv", mapping)


CART = """
kind = "equations"
[equations]
"dx/dt" = "v"
"dv/dt" = "(u - d*v)/m"
[ports]
u = { kind = "input", unit = "N" }
x = { kind = "state", unit = "m" }
v = { kind = "state", unit = "m/s" }
[parameters]
d = 0.3
m = 0.5
"""


@pytest.mark.parametrize("style", ["full", "rounded", "decimal comma", "parquet"])
def test_readings_in_a_column_named_trajectory_do_not_split_the_log(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], style: str
) -> None:
    t = np.arange(0, 4, 0.01)
    x = 0.4 * np.sin(2 * t)
    table = pd.DataFrame({"time": t, "u": 0.5 * np.cos(3 * t), "v": 0.8 * np.cos(2 * t), "trajectory": x})
    table = table.round(2 if style == "rounded" else 6)  # the rounded one has 81 values, which come back
    log = tmp_path / ("log.parquet" if style == "parquet" else "log.csv")
    comma = {"sep": ";", "decimal": ","} if style == "decimal comma" else {}
    _ = table.to_parquet(log) if style == "parquet" else table.to_csv(log, index=False, **comma)
    (tmp_path / "sim.toml").write_text(CART)
    files = [str(log), "--sim", str(tmp_path / "sim.toml"), "--quiet"]
    for argv in (["check", *files], ["evaluate", *files], ["diagnose", *files, "--out", str(tmp_path / "out")]):
        assert main(argv) == 2
        told = capsys.readouterr().err
        assert "of the column 'trajectory': a signal." in told
        assert "--signal NAME=trajectory" in told
    setup = tmp_path / "setup"
    assert main(["init", *files, "--signal", "x=trajectory", "--out", str(setup), "--json"]) == 0
    assert len(json.loads(capsys.readouterr().out)["trajectories"]) == 1
    assert main(["check", *files, "--columns", str(setup / "columns.toml"), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["sampling"]["runs"] == 1
    read = read_log(log, setup / "columns.toml")
    assert read["x"].to_numpy() == pytest.approx(table["trajectory"].to_numpy())


def test_readings_in_a_table_of_python_are_no_names_of_runs(tmp_path: Path) -> None:
    (tmp_path / "sim.toml").write_text(CART)
    t = np.arange(0, 4, 0.01)
    log = pd.DataFrame({"time": t, "u": np.cos(t), "v": np.sin(t), "trajectory": np.sin(t)})
    with pytest.raises(ColumnTypeError, match="a signal"):
        pamid.diagnose(log, pamid.read_simulator(tmp_path / "sim.toml"))


def test_numbered_runs_stay_runs(tmp_path: Path) -> None:
    """Runs named by fractions, and rows of numbered runs one after the other, which a mapping sorts."""
    t = np.arange(0, 0.3, 0.01)
    runs = pd.concat([pd.DataFrame({"trajectory": k, "time": t, "F": np.sin(t)}) for k in (0.5, 1.0, 1.5)])
    runs.to_csv(tmp_path / "log.csv", index=False)
    assert read_log(tmp_path / "log.csv")["trajectory"].unique().tolist() == ["0.5", "1.0", "1.5"]
    runs.sort_values("time").to_csv(tmp_path / "log.csv", index=False)
    assert read_log(tmp_path / "log.csv", {"time_order": "sort"})["trajectory"].nunique() == 3
