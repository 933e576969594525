"""Broken logs, simulators, models and options: each has its own error, which says what was found, expected, and to do.

Every row of the table runs twice: through the Python API and through the command line, which must answer with exit
code 2, one message and no traceback.
"""

from __future__ import annotations

import json
import pickle
import subprocess
import sys
import zipfile
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from sklearn.linear_model import Ridge
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from pamid import errors, persistence
from pamid.bench import BenchParameters, dataset, simulate, sine, step
from pamid.cli import main
from pamid.cli._tables import equation_of, make_estimator, predict_table, signal_table
from pamid.equations import evaluate_log
from pamid.signals import read_log


# --- good files, made once --------------------------------------------------------------------------------------
@pytest.fixture(scope="module")
def good(tmp_path_factory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("good")
    params = BenchParameters.for_muscle("B")
    log = simulate(params, [sine(4, 10, 400), sine(10, 10, 400), step(0, 10, 700)])
    files = {"csv": folder / "log.csv", "parquet": folder / "log.parquet", "sim": folder / "bench.toml"}
    log.to_csv(files["csv"], index=False)
    log.to_parquet(files["parquet"])
    params.to_toml(files["sim"])
    X = pd.DataFrame({"eps": np.linspace(0, 0.2, 30), "P": np.linspace(2e5, 4e5, 30)})
    files["model"] = folder / "model.pamid"
    persistence.save(
        make_pipeline(StandardScaler(), Ridge()).fit(X, X["eps"]), files["model"], {"equation": "force", "unit": "N"}
    )
    files["wide"] = folder / "wide.pamid"
    persistence.save(Ridge().fit(X.assign(wall_temperature=300.0), X["eps"]), files["wide"], {"equation": "force"})
    return files


# --- ways to break a file ---------------------------------------------------------------------------------------
def frame(change: Callable[[pd.DataFrame], pd.DataFrame]):
    def make(good: dict[str, Path], folder: Path) -> Path:
        log = change(pd.read_csv(good["csv"]))
        log.to_csv(folder / "log.csv", index=False)
        return folder / "log.csv"

    return make


def content(name: str, data: bytes | str):
    def make(good: dict[str, Path], folder: Path) -> Path:
        (folder / name).write_bytes(data if isinstance(data, bytes) else data.encode())
        return folder / name

    return make


def cut(kind: str, share: float):
    def make(good: dict[str, Path], folder: Path) -> Path:
        whole = good[kind].read_bytes()
        (folder / good[kind].name).write_bytes(whole[: int(len(whole) * share)])
        return folder / good[kind].name

    return make


def nothing(name: str):
    return lambda good, folder: folder / name


def empty_folder(good: dict[str, Path], folder: Path) -> Path:
    (folder / "logs").mkdir()
    return folder / "logs"


def edited(column: str, value, rows: slice = slice(None)):
    def change(log: pd.DataFrame) -> pd.DataFrame:
        changed = log[column].astype(object)
        changed.iloc[rows] = value(log[column].iloc[rows]) if callable(value) else value
        return log.assign(**{column: changed})

    return frame(change)


def hdf5_cut(good: dict[str, Path], folder: Path) -> Path:
    from pamid.signals import write_log

    file = write_log(pd.read_csv(good["csv"]), folder / "log.h5")
    file.write_bytes(file.read_bytes()[:3000])
    return file


def matlab(whole: bool):
    def make(good: dict[str, Path], folder: Path) -> Path:
        from scipy.io import savemat

        log = pd.read_csv(good["csv"])[:400]
        columns = {c: log[c].to_numpy() for c in log.columns if c != "trajectory"}
        savemat(folder / "log.mat", {"rest_length": 0.2} if whole else columns)
        if not whole:
            (folder / "log.mat").write_bytes((folder / "log.mat").read_bytes()[:4000])
        return folder / "log.mat"

    return make


def toml(change: Callable[[str], str]):
    def make(good: dict[str, Path], folder: Path) -> Path:
        (folder / "sim.toml").write_text(change(good["sim"].read_text()))
        return folder / "sim.toml"

    return make


def line(name: str, new: str | None):
    def change(text: str) -> str:
        kept = [old for old in text.splitlines() if not old.startswith(f"{name} =")]
        at = next(i for i, old in enumerate(text.splitlines()) if old.startswith(f"{name} ="))
        return "\n".join([*kept[:at], *([new] if new is not None else []), *kept[at:]]) + "\n"

    return toml(change)


def entries(change: Callable[[dict[str, bytes]], None], copies: tuple[str, ...] = ()):
    def make(good: dict[str, Path], folder: Path) -> Path:
        with zipfile.ZipFile(good["model"]) as archive:
            found = {name: archive.read(name) for name in archive.namelist()}
        change(found)
        with zipfile.ZipFile(folder / "model.pamid", "w", zipfile.ZIP_DEFLATED) as archive:
            for name, data in found.items():
                archive.writestr(name, data)
        return folder / "model.pamid"

    return make


def set_head(**changes):
    def change(found: dict[str, bytes]) -> None:
        found["pamid.json"] = json.dumps(json.loads(found["pamid.json"]) | changes).encode()

    return entries(change)


def set_schema(change: Callable[[dict], None]):
    def edit(found: dict[str, bytes]) -> None:
        schema = json.loads(found["schema.json"])
        change(schema)
        found["schema.json"] = json.dumps(schema).encode()

    return entries(edit)


def system(schema: dict) -> None:
    schema["content"]["content"]["x"] = {"__class__": "system", "__module__": "os", "__loader__": "FunctionNode"}


def pickled(found: dict[str, bytes]) -> None:
    import io

    buffer = io.BytesIO()
    np.save(buffer, np.array([object], dtype=object), allow_pickle=True)
    found[next(name for name in found if name.endswith(".npy"))] = buffer.getvalue()


def bomb(found: dict[str, bytes]) -> None:
    found["pamid.json"] = b" " * 2**21


# --- the table --------------------------------------------------------------------------------------------------
@dataclass
class Case:
    """One kind of bad input: what is broken, what it raises, and words that the message must hold."""

    name: str
    breaks: str  # which file: log, sim, model, columns; or "option"
    make: Callable | None
    error: type[errors.PamidError]
    words: tuple[str, ...]
    argv: list[str] = field(default_factory=list)
    api: Callable | None = None


E = errors
LOGS = [
    ("no such log", nothing("run7.csv"), E.LogNotFoundError, ("run7.csv", "existing file", "Correct the path")),
    ("a folder without logs", empty_folder, E.LogNotFoundError, ("no log", ".csv")),
    ("empty file", content("log.csv", b""), E.EmptyLogError, ("empty", "two rows")),
    ("header only", frame(lambda log: log[:0]), E.EmptyLogError, ("no", "rows")),
    ("parquet cut off", cut("parquet", 0.6), E.TruncatedLogError, ("log.parquet",)),
    ("MATLAB file cut off", matlab(whole=False), E.LogError, ("log.mat",)),
    ("MATLAB file without samples", matlab(whole=True), E.LogError, ("log.mat",)),
    ("HDF5 cut off", hdf5_cut, E.TruncatedLogError, ("log.h5",)),
    ("bytes of no format", content("log.csv", bytes(range(256)) * 20), E.LogError, ("log.csv",)),
    ("a pickle for a log", content("log.pkl", pickle.dumps({"P1": [1.0]})), E.LogFormatError, ("log.pkl",)),
    ("prose for a log", content("log.csv", "Dear reader,\nthis is no table.\n\nYours\n"), E.LogError, ("log.csv",)),
    ("JSON that is no table", content("log.json", '{"a": {"b": 1}}'), E.LogError, ("log.json",)),
    ("JSON cut off", content("log.json", '{"time": [0, 0.001, 0.0'), E.LogError, ("log.json",)),
    ("no time", frame(lambda log: log.drop(columns="time")), E.MissingColumnError, ("time",)),
    ("no angle", frame(lambda log: log.drop(columns="q")), E.LogError, ("q",)),
    ("a column twice", frame(lambda log: log.rename(columns={"P2": "P1"})), E.DuplicateColumnError, ("P1",)),
    ("text among numbers", edited("P1", "high", slice(5, 6)), E.ColumnTypeError, ("P1", "high")),
    ("infinite value", edited("F1", np.inf, slice(5, 6)), E.NonFiniteError, ("F1", "inf")),
    ("NaN in time", edited("time", np.nan, slice(5, 6)), E.LogError, ("time",)),
    ("time backwards", frame(lambda log: log.iloc[::-1]), E.LogError, ("time",)),
    ("one time for all rows", edited("time", 0.0), E.LogError, ("time",)),
    ("pressure in bar", edited("P1", lambda v: v / 1e5), E.UnitError, ("P1", "bar")),
    ("pressure in kPa", edited("P1", lambda v: v / 1e3), E.UnitError, ("P1", "kPa")),
    ("angle in degrees", edited("q", lambda v: np.degrees(v) + 20), E.UnitError, ("q", "deg")),
    ("command in percent", edited("u1", lambda v: v * 100 + 50), E.UnitError, ("u1",)),
    ("too short for a window", frame(lambda log: log[:12]), E.ShortTrajectoryError, ("0.02 s",)),
    ("rows of runs mixed", frame(lambda log: log.sort_values("time", kind="stable")), E.LogError, ("comes back",)),
]
SIMS = [
    ("no such simulator", nothing("sim.toml"), E.SimulatorNotFoundError, ("sim.toml", "Check the path")),
    ("simulator is a folder", empty_folder, E.SimulatorFileError, ("logs",)),
    ("simulator is no TOML", content("sim.toml", "[muscle\nx"), E.SimulatorSyntaxError, ("not valid TOML",)),
    ("simulator is not text", content("sim.toml", b"\xff\xfe\x00"), E.SimulatorSyntaxError, ("UTF-8",)),
    ("simulator is a log", lambda good, folder: good["csv"], E.SimulatorFileError, ("log.csv",)),
    ("simulator of a megabyte", content("sim.toml", b"#" * 2_000_000), E.OversizedSimulatorError, ("2,000,000",)),
    ("no table", toml(lambda t: t.split("[valve]")[0]), E.MissingParameterError, ("valve", "joint")),
    ("no rest length", line("rest_length", None), E.MissingParameterError, ("rest_length",)),
    ("unknown parameter", line("inertia", "inertia = 0.02\ninertai = 0.02"), E.UnknownParameterError, ("inertai",)),
    ("unknown table", toml(lambda t: t + "\n[motor]\nx = 1\n"), E.UnknownParameterError, ("motor",)),
    ("text for a number", line("inertia", 'inertia = "heavy"'), E.SimulatorTypeError, ("heavy", "number")),
    ("NaN for a number", line("inertia", "inertia = nan"), E.ImplausibleParameterError, ("inertia", "nan")),
    ("length in mm", line("rest_length", "rest_length = 200.0"), E.ImplausibleParameterError, ("200 m", "0.2")),
    (
        "angle in degrees for rad",
        line("braid_angle", "braid_angle = 25.0"),
        E.ImplausibleParameterError,
        ("25", "0.436"),
    ),
    ("supply in bar", line("supply_pressure", "supply_pressure = 7.0"), E.ImplausibleParameterError, ("7 Pa",)),
    (
        "supply below ambient",
        line("supply_pressure", "supply_pressure = 90000.0"),
        E.ImplausibleParameterError,
        ("90000",),
    ),
    ("temperature in Celsius", line("temperature", "temperature = 20.0"), E.ImplausibleParameterError, ("20 K", "293")),
    ("unknown tolerance", toml(lambda t: t + "\nmass = 0.1\n"), E.UnknownParameterError, ("mass",)),
    (
        "unknown effect",
        toml(lambda t: t + '\n[[effects]]\nname = "leak"\n'),
        E.UnknownParameterError,
        ("leak", "leakage"),
    ),
    (
        "unknown parameter of an effect",
        toml(lambda t: t + '\n[[effects]]\nname = "leakage"\nsize = 1.0\n'),
        E.UnknownParameterError,
        ("size", "conductance"),
    ),
    (
        "negative friction",
        toml(lambda t: t + '\n[[effects]]\nname = "coulomb_friction"\namplitude = -5.0\n'),
        E.ImplausibleParameterError,
        ("-5 N",),
    ),
    ("effect without a name", toml(lambda t: t + "\n[[effects]]\nx = 1.0\n"), E.MissingParameterError, ("name",)),
]
MODELS = [
    ("no such model", nothing("model.pamid"), E.ModelNotFoundError, ("model.pamid", "Check the path")),
    ("model is a folder", empty_folder, E.ModelNotFoundError, ("folder",)),
    ("empty model", content("model.pamid", b""), E.TruncatedModelError, ("empty", "pamid.save")),
    ("model cut off", cut("model", 0.6), E.TruncatedModelError, ("damaged or cut off", "again")),
    ("a pickle for a model", content("m.pkl", pickle.dumps(Ridge())), E.TruncatedModelError, ("no model file",)),
    ("a log for a model", lambda good, folder: good["csv"], E.TruncatedModelError, ("no model file",)),
    ("no schema", entries(lambda f: f.pop("schema.json")), E.TruncatedModelError, ("schema.json",)),
    ("no metadata", entries(lambda f: f.pop("pamid.json")), E.TruncatedModelError, ("pamid.json",)),
    ("metadata not UTF-8", entries(lambda f: f.update({"pamid.json": b"\xff{}"})), E.TruncatedModelError, ("UTF-8",)),
    ("format of the future", set_head(format=99), E.ModelVersionError, ("format 99", "Update pamid")),
    ("format is text", set_head(format="new"), E.ModelVersionError, ("'new'",)),
    ("model that calls os.system", set_schema(system), E.HostileModelError, ("os.system", "Do not load")),
    ("model with a pickled array", entries(pickled), E.HostileModelError, ("pickled", "Do not load")),
    ("model that is a zip bomb", entries(bomb), E.HostileModelError, ("at most",)),
    ("model with a path", entries(lambda f: f.update({"../x.npy": b""})), E.HostileModelError, ("../x.npy",)),
    (
        "model without its contents",
        set_schema(lambda s: s["content"].update(content={})),
        E.ModelFileError,
        ("model.pamid", "whole model"),
    ),
    (
        "model that was never fitted",
        lambda good, folder: persistence.save(Ridge(), folder / "model.pamid", {"equation": "force"}),
        E.ModelFileError,
        ("not fitted",),
    ),
]
COLUMNS = [
    ("no such mapping", nothing("map.toml"), E.LogError, ("map.toml",)),
    ("mapping is no TOML", content("map.toml", "= 3"), E.MappingError, ("map.toml",)),
    ("mapping to no column", content("map.toml", '[P1]\ncolumn = "p_one"\n'), E.LogError, ("p_one",)),
    ("unknown unit", content("map.toml", '[P1]\ncolumn = "P1"\nunit = "furlong"\n'), E.UnitError, ("furlong",)),
    ("unit of another kind", content("map.toml", '[P1]\ncolumn = "P1"\nunit = "mm"\n'), E.UnitError, ("mm", "Pa")),
    ("unknown key of a mapping", content("map.toml", '[P1]\ncolum = "P1"\n'), E.MappingError, ("colum",)),
]


def fit_with(name: str, equation: str | None = None, **settings):
    def call(good: dict[str, Path]):
        sizes = {"rest_length": 0.2, "rest_diameter": 0.02}
        return equation_of(make_estimator(name, settings, 0, lambda kinds: sizes), equation)

    return call


def table_of(equation: str, *, drop: tuple[str, ...] = (), sim: bool = True):
    def call(good: dict[str, Path]):
        log = read_log(good["csv"]).drop(columns=list(drop))
        params = BenchParameters.from_toml(good["sim"]) if sim else None
        return signal_table(log, params, equation_of(None, equation))

    return call


FIT = ["fit", "{csv}", "--sim", "{sim}", "--out", "{folder}/m.pamid"]
OPTIONS = [
    ("unknown estimator", E.UnknownOptionError, ("MPL", "MLP"), [*FIT, "--estimator", "MPL"], fit_with("MPL")),
    (
        "unknown parameter of an estimator",
        E.UnknownOptionError,
        ("max_itr", "max_iter"),
        [*FIT, "--estimator", "MLP", "--equation", "force", "--set", "max_itr=3"],
        fit_with("MLP", max_itr=3),
    ),
    (
        "estimator of the other equation",
        E.IncompatibleError,
        ("predicts force",),
        [*FIT, "--estimator", "GeometricForce", "--equation", "flow"],
        fit_with("GeometricForce", "flow"),
    ),
    (
        "estimator that leaves the equation open",
        E.ParameterError,
        ("either", "--equation"),
        [*FIT, "--estimator", "MLP"],
        fit_with("MLP"),
    ),
    (
        "no simulator and no contraction",
        E.MissingColumnError,
        ("eps", "--sim"),
        [
            *["fit", "{csv}", "--estimator", "GeometricForce", "--out", "{folder}/m.pamid"],
            *["--set", "rest_length=0.2", "--set", "rest_diameter=0.01"],
        ],
        table_of("force", sim=False),
    ),
    (
        "unknown data set",
        E.UnknownOptionError,
        ("D_X", "D_tri"),
        ["simulate", "--dataset", "D_X", "--out", "{folder}/x.csv"],
        lambda good: dataset("D_X"),
    ),
    (
        "unknown muscle",
        E.UnknownOptionError,
        ("'Z'",),
        ["simulate", "--dataset", "D_B", "--muscle", "Z", "--out", "{folder}/x.csv"],
        lambda good: BenchParameters.for_muscle("Z"),
    ),
    (
        "output in no folder",
        E.OutputError,
        ("nowhere", "Create"),
        [*FIT[:4], "--out", "{folder}/nowhere/m.pamid", "--estimator", "GeometricForce"],
        lambda good: persistence.save(Ridge(), good["csv"].parent / "nowhere" / "m.pamid"),
    ),
    (
        "model of other columns",
        E.MissingColumnError,
        ("wall_temperature", "columns that the model was fitted to"),
        ["evaluate", "{csv}", "--sim", "{sim}", "--model", "{wide}"],
        lambda good: predict_table(persistence.load(good["wide"]), pd.DataFrame({"eps": [0.1], "P": [2e5]})),
    ),
]


def through_api(case: Case, files: dict[str, Path]) -> None:
    if case.api is not None:
        case.api(files)
    elif case.breaks == "model":
        predict_table(persistence.load(files["model"]), pd.DataFrame({"eps": [0.1], "P": [2e5]}))
    else:
        log = read_log(files["csv"], files.get("columns"), nan="keep")
        evaluate_log(log, BenchParameters.from_toml(files["sim"]))


def all_cases() -> list[Case]:
    cases = [Case(name, "csv", make, error, words) for name, make, error, words in LOGS]
    cases += [Case(name, "sim", make, error, words) for name, make, error, words in SIMS]
    cases += [Case(name, "model", make, error, words) for name, make, error, words in MODELS]
    cases += [Case(name, "columns", make, error, words) for name, make, error, words in COLUMNS]
    cases += [Case(name, "option", None, error, words, argv, api) for name, error, words, argv, api in OPTIONS]
    return cases


CASES = all_cases()


def broken_files(case: Case, good: dict[str, Path], folder: Path) -> dict[str, Path]:
    files = dict(good)
    if case.make is not None:
        files[case.breaks] = case.make(good, folder)
    return files


def argv_of(case: Case, files: dict[str, Path], folder: Path) -> list[str]:
    if case.argv:
        names = {k: str(v) for k, v in files.items()} | {"folder": str(folder)}
        return [part.format(**names) for part in case.argv]
    argv = ["evaluate", str(files["csv"]), "--sim", str(files["sim"])]
    if case.breaks == "model":
        argv += ["--model", str(files["model"])]
    if case.breaks == "columns":
        argv += ["--columns", str(files["columns"])]
    return argv


def test_the_table_is_long_enough():
    assert len({case.name for case in CASES}) == len(CASES) >= 40


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_python_api(case, good, tmp_path):
    files = broken_files(case, good, tmp_path)
    with pytest.raises(case.error) as caught:
        through_api(case, files)
    error = caught.value
    assert error.found
    assert error.expected
    assert error.remedy
    for word in case.words:
        assert word.lower() in str(error).lower()


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_command_line(case, good, tmp_path, capsys):
    files = broken_files(case, good, tmp_path)
    code = main([*argv_of(case, files, tmp_path), "--json", "--quiet"])
    out, err = capsys.readouterr()
    assert code == 2
    assert out == ""
    assert "Traceback" not in err
    assert err.startswith("pamid: error: ")
    assert err.count("\n") == 1
    for word in case.words:
        assert word.lower() in err.lower()


def test_a_process_of_its_own_says_the_same(good, tmp_path):
    """Once for real: what a shell sees."""
    argv = [sys.executable, "-c", "import sys; from pamid.cli import main; sys.exit(main())"]
    done = subprocess.run(
        [*argv, "evaluate", str(tmp_path / "x.csv"), "--sim", str(good["sim"])], capture_output=True, text=True
    )
    assert done.returncode == 2
    assert done.stdout == ""
    assert "Traceback" not in done.stderr
    assert "x.csv" in done.stderr
