"""The command line: what people and machines get, and that nothing else reaches them."""

from __future__ import annotations

import importlib
import importlib.metadata
import json
import os
import platform
import re
import signal
import subprocess
import sys
import warnings
from pathlib import Path
from unittest import mock

import numpy as np
import pandas as pd
import pytest

from pamid import __version__
from pamid.bench import BenchParameters
from pamid.cli import _versions, app, main
from pamid.cli.common import parse_settings, table
from pamid.equations import evaluate_log
from pamid.errors import InterruptedFitWarning, ParameterError, UnitWarning
from pamid.json_data import json_ready
from pamid.persistence import inspect, load
from pamid.signals import read_log

RUNS = [
    "--trajectory",
    "sine:frequency=4,amplitude=15,seconds=1.5",
    "--trajectory",
    "sine:frequency=10,amplitude=10,seconds=1",
    "--trajectory",
    "step:start=0,end=10,seconds=1.5",
]


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("cli")
    effect = ["--effect", "viscous_friction:coefficient=400"]
    assert main(["simulate", *RUNS, *effect, "--out", str(folder / "log.parquet"), "--seed", "1", "--quiet"]) == 0
    return folder


def shell(*argv: str, **options) -> subprocess.CompletedProcess:
    return subprocess.run([sys.executable, "-m", "pamid", *argv], capture_output=True, text=True, **options)


def files(folder: Path) -> list[str]:
    return [str(folder / "log.parquet"), "--sim", str(folder / "log.sim.toml")]


# --- help and version -------------------------------------------------------------------------------------------
def test_help_lists_commands_examples_and_exit_codes(capsys):
    assert main(["--help"]) == 0
    text = capsys.readouterr().out
    for word in ("simulate", "evaluate", "fit", "examples:", "exit codes:", "130"):
        assert word in text


@pytest.mark.parametrize("command", [m.__name__.rpartition(".")[2] for m in app.commands()])
def test_help_of_every_command(command, capsys):
    assert main([command, "--help"]) == 0
    text = capsys.readouterr().out
    for word in ("examples:", f"pamid {command}", "exit codes:", "--json", "--quiet", "--seed", "--debug"):
        assert word in text
    assert max(len(line) for line in text.splitlines()) <= 120


def test_no_command_shows_help_and_fails(capsys):
    assert main([]) == 2
    assert "COMMAND" in capsys.readouterr().out


def test_version(capsys):
    assert main(["--version"]) == 0
    first, *others = capsys.readouterr().out.splitlines()
    assert first == f"pamid {__version__}"
    shown = dict(line.split(maxsplit=1) for line in others)
    assert shown["python"].startswith(platform.python_version())
    assert shown["numpy"] == importlib.metadata.version("numpy")
    assert {"scipy", "scikit-learn", "torch", "mujoco"} <= set(shown)


def test_version_of_a_package_that_is_missing(monkeypatch):
    def lookup(name):
        if name == "mujoco":
            raise importlib.metadata.PackageNotFoundError(name)
        return "1.2.3"

    monkeypatch.setattr(_versions, "version", lookup)
    assert "\n  mujoco not installed" in _versions.versions()
    assert "\n  torch 1.2.3" in _versions.versions()


def test_help_loads_nothing_heavy():
    code = (
        "import sys; from pamid.cli import main; main(['fit', '--help']); main(['--help']); main(['--version']);"
        "print([m for m in ('torch', 'sklearn', 'pandas', 'numpy', 'scipy', 'rich') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.stdout.rstrip().endswith("[]")


def test_unknown_command_and_option_are_answered_by_usage(capsys):
    assert main(["evalute"]) == 2
    assert "invalid choice: 'evalute'" in capsys.readouterr().err
    assert main(["evaluate", "--nonsense"]) == 2
    assert main(["simulate", "--seed", "-3", "--out", "x.csv"]) == 2


# --- simulate ---------------------------------------------------------------------------------------------------
def test_simulate_writes_log_nominal_and_true_simulator(folder):
    log = read_log(folder / "log.parquet")
    assert list(log["trajectory"].unique()) == ["sine-4-15", "sine-10-10", "step-0-10"]
    assert len(log) == 4000
    nominal = BenchParameters.from_toml(folder / "log.sim.toml")
    true = BenchParameters.from_toml(folder / "log.true.toml")
    assert nominal == BenchParameters.for_muscle("B")
    assert true.effects == (("viscous_friction", {"coefficient": 400.0}),)


def test_simulate_is_repeatable_by_its_seed(folder, tmp_path, capsys):
    logs = []
    for seed in ("1", "1", "2"):
        argv = ["simulate", *RUNS[:2], "--out", str(tmp_path / "log.csv"), "--seed", seed, "--json"]
        assert main(argv) == 0
        report = json.loads(capsys.readouterr().out)
        assert report["rows"] == 1500
        assert Path(report["files"]["sim"]).exists()
        assert "true" not in report["files"]
        logs.append(pd.read_csv(tmp_path / "log.csv"))
    assert logs[0].equals(logs[1])
    assert not np.array_equal(logs[0]["P1"], logs[2]["P1"])


def test_simulate_from_a_simulator_file(folder, tmp_path):
    argv = ["simulate", "--sim", str(folder / "log.true.toml"), *RUNS[:2], "--out", str(tmp_path / "l.parquet")]
    assert main([*argv, "--quiet"]) == 0
    assert BenchParameters.from_toml(tmp_path / "l.sim.toml").effects == ()
    assert BenchParameters.from_toml(tmp_path / "l.true.toml").effects[0][0] == "viscous_friction"


@pytest.mark.parametrize(
    ("argv", "words"),
    [
        ([], "one of --dataset and --trajectory"),
        (["--dataset", "D_B", *RUNS[:2]], "Both"),
        (["--trajectory", "sne:frequency=3"], "Did you mean sine"),
        (["--trajectory", "sine:frequency=3"], "has no amplitude"),
        (["--trajectory", "sine:frequency=3,amplitude=2,length=3"], "unknown length"),
        (["--trajectory", "sine:frequency=fast,amplitude=2"], "'fast'"),
        (["--trajectory", "sine:frequency=3,amplitude=2,seconds=0"], "lasts 0 s"),
        (["--trajectory", "sine:3"], "name=value"),
        ([*RUNS[:2], "--effect", "leak"], "Did you mean leakage"),
        ([*RUNS[:2], "--effect", "leakage:size=3"], "no parameter 'size'"),
        ([*RUNS[:2], "--effect", "leakage:conductance=-1"], "-1 m^3/(s Pa)"),
    ],
)
def test_simulate_says_what_is_wrong(argv, words, tmp_path, capsys):
    assert main(["simulate", *argv, "--out", str(tmp_path / "log.csv")]) == 2
    assert words in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


# --- evaluate ---------------------------------------------------------------------------------------------------
def test_evaluate_prints_the_equations_as_json_alone(folder, capsys):
    assert main(["evaluate", *files(folder), "--json"]) == 0
    out, err = capsys.readouterr()
    report = json.loads(out)
    assert err == ""
    assert list(report["equations"]) == ["force", "flow", "valve", "joint"]
    for name, unit in {"force": "N", "flow": "kg/s", "valve": "kg/s", "joint": "N m"}.items():
        assert {"rmse", "nrmse", "noise_floor", "unit"} <= set(report["equations"][name])
        assert report["equations"][name]["unit"] == unit
    assert report["skipped"] == {}
    python = evaluate_log(read_log(folder / "log.parquet"), BenchParameters.from_toml(folder / "log.sim.toml"))
    assert report["equations"]["force"]["rmse"] == pytest.approx(python["force"].rmse)


def test_evaluate_with_the_effects_of_the_log_comes_down_to_the_noise(folder, capsys):
    reports = []
    for sim in ("log.sim.toml", "log.true.toml"):
        assert main(["evaluate", str(folder / "log.parquet"), "--sim", str(folder / sim), "--json"]) == 0
        reports.append(json.loads(capsys.readouterr().out)["equations"]["force"])
    assert reports[0]["rmse"] > 20 * reports[0]["noise_floor"]
    assert reports[1]["rmse"] < 2 * reports[1]["noise_floor"]


def test_evaluate_for_people(folder, capsys):
    assert main(["evaluate", *files(folder)]) == 0
    out, err = capsys.readouterr()
    assert out.splitlines()[0].split() == [
        *["equation", "rmse", "fit", "/", "%", "nrmse", "noise", "floor", "rmse/floor", "unit"]
    ]
    assert "--refit" in err
    assert main(["evaluate", *files(folder), "--quiet"]) == 0
    assert capsys.readouterr().err == ""


def test_evaluate_refits_within_tolerances(folder, capsys):
    assert main(["evaluate", *files(folder), "--refit", "--json"]) == 0
    refit = json.loads(capsys.readouterr().out)["refit"]
    tolerance = BenchParameters.from_toml(folder / "log.sim.toml").tolerance
    assert set(refit["relative_change"]) == set(tolerance)
    assert all(abs(v) <= tolerance[k] * 1.001 for k, v in refit["relative_change"].items())
    assert main(["evaluate", *files(folder), "--refit"]) == 0
    assert "refitted: rest_diameter" in capsys.readouterr().out


def test_evaluate_says_what_a_log_does_not_allow(folder, tmp_path, capsys):
    log = read_log(folder / "log.parquet").drop(columns=["mdot1", "mdot2"])
    log.to_parquet(tmp_path / "log.parquet")
    assert main(["evaluate", str(tmp_path / "log.parquet"), "--sim", str(folder / "log.sim.toml"), "--json"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert list(report["equations"]) == ["force", "joint", "gas_valve"]
    assert report["skipped"]["flow"].startswith("flow needs q, P1, P2, mdot1, mdot2; the log lacks mdot1, mdot2")


def test_evaluate_of_a_foreign_log(folder, tmp_path, capsys):
    log = read_log(folder / "log.parquet")
    foreign = pd.DataFrame({"run": log["trajectory"], "t_ms": log["time"] * 1e3, "joint": np.degrees(log["q"])})
    for m in (1, 2):
        foreign[f"p{m}"] = log[f"P{m}"] / 1e5
        foreign[f"f{m}"] = log[f"F{m}"]
    foreign.to_csv(tmp_path / "bench.csv", index=False)
    mapping = ['trajectory = "run"', '[signals.time]\ncolumn = "t_ms"\nunit = "ms"']
    mapping += ['[signals.q]\ncolumn = "joint"\nunit = "deg"']
    for m in (1, 2):
        mapping += [f'[signals.P{m}]\ncolumn = "p{m}"\nunit = "bar"\ngauge = false', f'[signals.F{m}]\ncolumn = "f{m}"']
    (tmp_path / "map.toml").write_text("\n".join(mapping))
    argv = ["evaluate", str(tmp_path / "bench.csv"), "--columns", str(tmp_path / "map.toml")]
    assert main([*argv, "--sim", str(folder / "log.true.toml"), "--json"]) == 0
    own = main(["evaluate", str(folder / "log.parquet"), "--sim", str(folder / "log.true.toml"), "--json"])
    decoder = json.JSONDecoder()
    text = capsys.readouterr().out
    first, end = decoder.raw_decode(text)
    second, _ = decoder.raw_decode(text[end:].lstrip())
    assert own == 0
    assert first["equations"]["force"]["rmse"] == pytest.approx(second["equations"]["force"]["rmse"], rel=1e-3)


def test_evaluate_without_simulator_or_model(folder, capsys):
    assert main(["evaluate", str(folder / "log.parquet")]) == 2
    assert "Add --sim SIM.toml or --model MODEL." in capsys.readouterr().err


# --- fit --------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("estimator", ["GeometricForce", "PolynomialFlow"])
def test_fit_saves_a_model_that_evaluates_alike(estimator, folder, tmp_path, capsys):
    out = tmp_path / "m.pamid"
    assert main(["fit", *files(folder), "--estimator", estimator, "--out", str(out), "--json"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert report["training"]["n_samples"] == 8000
    assert 0 < report["training"]["rmse"] <= report["held_out"]["rmse"] * 1.05
    assert len(report["held_out"]["trajectories"]) == 6
    head = inspect(out)
    assert head["metadata"]["equation"] == report["equation"]
    assert main(["evaluate", *files(folder), "--model", str(out), "--json"]) == 0
    again = json.loads(capsys.readouterr().out)
    assert again["rmse"] == pytest.approx(report["training"]["rmse"], rel=1e-9)
    assert main(["evaluate", *files(folder), "--model", str(out)]) == 0
    assert capsys.readouterr().out.splitlines()[-1].startswith("all")


def test_fit_with_rates_saves_the_whole_pipeline(folder, tmp_path, capsys):
    out = tmp_path / "m.pamid"
    settings = ["--set", "max_iter=3", "--set", "hidden=(4,)", "--thin", "10", "--folds", "0", "--seed", "5"]
    argv = ["fit", *files(folder), "--estimator", "MLP", "--equation", "force", "--out", str(out), "--quiet"]
    assert main([*argv, *settings, "--json"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert report["held_out"] is None
    model = load(out)
    assert [name for name, _ in model.steps] == ["rates", "model"]
    assert model.steps[-1][1].max_iter == 3
    assert model.steps[-1][1].random_state == 5
    assert main(["evaluate", *files(folder), "--model", str(out), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["rmse"] == pytest.approx(report["training"]["rmse"], rel=1e-6)


def test_fit_takes_the_geometry_from_the_simulator(folder, tmp_path):
    argv = ["fit", *files(folder), "--estimator", "GeometricForce", "--out", str(tmp_path / "m.pamid"), "--folds", "0"]
    assert main([*argv, "--set", "braid_angle=0.44", "--quiet"]) == 0
    model = load(tmp_path / "m.pamid")
    assert model.rest_diameter == 0.02
    assert model.braid_angle == 0.44


@pytest.fixture
def one_muscle(tmp_path) -> Path:
    """A log of one muscle of 21 mm, with contraction and pressure in it."""
    from pamid.volume.braided import chou_hannaford

    eps, P = (a.ravel() for a in np.meshgrid(np.linspace(0.0, 0.2, 12), np.linspace(2e5, 6e5, 12)))
    F = chou_hannaford(P, eps, rest_diameter=0.021, braid_angle=0.45)
    rng = np.random.default_rng(0)
    log = pd.DataFrame({"trajectory": np.arange(144) // 36, "time": 0.01 * (np.arange(144) % 36), "eps": eps, "P": P})
    log.assign(F=F + rng.normal(0.0, 1.0, 144)).to_csv(tmp_path / "one.csv", index=False)
    return tmp_path / "one.csv"


def test_fit_prints_the_parameters_with_units_errors_and_bounds(one_muscle, tmp_path, capsys):
    sizes = ["--set", "rest_length=0.2", "--set", "rest_diameter=0.02", "--folds", "0"]
    argv = ["fit", str(one_muscle), "--out", str(tmp_path / "m.pamid"), *sizes]
    assert main([*argv, "--estimator", "GeometricForce", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)["parameters"]
    diameter = found["rest_diameter"]
    assert diameter["value"] == pytest.approx(0.021, rel=0.01)
    assert diameter["unit"] == "m"
    assert 0 < diameter["standard_error"] < 1e-3
    assert diameter["lower"] < diameter["value"] < diameter["upper"]
    assert diameter["fitted"] and not diameter["at_bound"]
    assert not found["rest_length"]["fitted"]
    assert main([*argv, "--estimator", "GeometricForce(tondu_lopez)"]) == 0
    line = next(line for line in capsys.readouterr().out.splitlines() if line.startswith("rest_diameter"))
    assert " m " in line and " to " in line


def test_fit_warns_of_a_diameter_that_is_not_the_muscles(one_muscle, tmp_path, capsys):
    argv = ["fit", str(one_muscle), "--estimator", "GeometricForce", "--out", str(tmp_path / "m.pamid"), "--folds", "0"]
    assert main([*argv, "--set", "rest_length=0.2", "--set", "rest_diameter=0.01"]) == 0
    assert re.search(r"rest_diameter is 21(\.0)? mm.*10 mm", capsys.readouterr().err)


def test_fit_of_one_run_needs_no_held_out_check(folder, tmp_path, capsys):
    log = read_log(folder / "log.parquet")
    log[log["trajectory"] == "sine-4-15"].to_parquet(tmp_path / "one.parquet")
    argv = ["fit", str(tmp_path / "one.parquet"), "--sim", str(folder / "log.sim.toml")]
    argv += ["--estimator", "GeometricForce", "--out", str(tmp_path / "m.pamid")]
    assert main(argv) == 2
    assert "--folds 0" in capsys.readouterr().err
    assert not (tmp_path / "m.pamid").exists()
    assert main([*argv, "--folds", "0"]) == 0


@pytest.mark.parametrize("argv", [["--thin", "0"], ["--folds", "1"], ["--folds", "-2"]])
def test_fit_refuses_impossible_numbers(argv, folder, tmp_path, capsys):
    out = ["--out", str(tmp_path / "m.pamid")]
    assert main(["fit", *files(folder), "--estimator", "GeometricForce", *out, *argv]) == 2
    assert "Correct the number." in capsys.readouterr().err


# --- what goes wrong --------------------------------------------------------------------------------------------
def failing(error: BaseException):
    return mock.patch("pamid.cli.commands.evaluate.run", side_effect=error)


def test_an_interrupted_fold_ends_the_command(folder, tmp_path, capsys):
    def warn(*_, **__):
        warnings.warn("The training was interrupted.", InterruptedFitWarning, stacklevel=2)

    out = tmp_path / "m.pamid"
    with mock.patch("pamid.estimators.GeometricForce.fit", side_effect=warn):
        assert main(["fit", *files(folder), "--estimator", "GeometricForce", "--out", str(out)]) == 130
    assert "interrupted; no file is left incomplete" in capsys.readouterr().err and not out.exists()


def test_interrupt(capsys):
    with failing(KeyboardInterrupt()):
        assert main(["evaluate", "x", "--sim", "y"]) == 130
    assert capsys.readouterr().err == "pamid: interrupted; no file is left incomplete\n"


def test_a_signal_to_a_process_and_its_group_stops_it_once(capsys):
    stopped = []

    def ended(*_):
        for _ in range(2):
            try:
                signal.raise_signal(signal.SIGTERM)
            except KeyboardInterrupt as stop:
                stopped.append(type(stop))
        raise KeyboardInterrupt

    with failing(ended):
        assert main(["evaluate", "x", "--sim", "y"]) == 143
    assert stopped == [KeyboardInterrupt] and signal.getsignal(signal.SIGTERM) == signal.SIG_DFL


def test_own_error_asks_for_a_report(capsys):
    with failing(ZeroDivisionError("division by zero")):
        assert main(["evaluate", "x", "--sim", "y"]) == 1
    err = capsys.readouterr().err
    assert "ZeroDivisionError: division by zero" in err
    assert "report" in err
    assert "Traceback" not in err
    with failing(ZeroDivisionError()), pytest.raises(ZeroDivisionError):
        main(["evaluate", "x", "--sim", "y", "--debug"])


def test_no_memory(capsys):
    with failing(MemoryError()):
        assert main(["evaluate", "x", "--sim", "y"]) == 2
    assert "Thin the log" in capsys.readouterr().err


def test_warnings_are_one_line_without_file_names(capsys):
    def warn(args) -> int:
        import warnings

        warnings.warn("length 120 looks like mm;\nexpected m", UnitWarning, stacklevel=2)
        return 0

    with mock.patch("pamid.cli.commands.evaluate.run", side_effect=warn):
        assert main(["evaluate", "x", "--sim", "y"]) == 0
        assert capsys.readouterr().err == "pamid: warning: length 120 looks like mm; expected m\n"
        assert main(["evaluate", "x", "--sim", "y", "--quiet"]) == 0
        assert capsys.readouterr().err == ""


def test_many_warnings_of_one_kind_are_counted(capsys):
    def warn(args) -> int:
        import warnings

        for k in range(10):
            warnings.warn(f"run {k} is uneven", UnitWarning, stacklevel=2)
        return 0

    with mock.patch("pamid.cli.commands.evaluate.run", side_effect=warn):
        assert main(["evaluate", "x", "--sim", "y"]) == 0
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 4
    assert lines[-1] == "pamid: warning: 7 more of the kind UnitWarning"


@pytest.mark.skipif(os.name != "posix", reason="pipes of a POSIX shell")
def test_closed_pipe_is_silent(folder):
    command = [sys.executable, "-c", "import sys; from pamid.cli import main; sys.exit(main())"]
    command += ["evaluate", *files(folder), "--json"]
    reader, writer = os.pipe()
    os.close(reader)
    done = subprocess.run(command, stdout=writer, stderr=subprocess.PIPE, text=True)
    os.close(writer)
    assert done.stderr == ""
    assert done.returncode == 0


def test_a_shell_sees_json_on_stdout_and_no_escape_codes(folder):
    done = shell("evaluate", *files(folder), "--json", env={**os.environ, "NO_COLOR": "1"})
    assert done.returncode == 0
    assert json.loads(done.stdout)
    assert "\x1b" not in done.stdout + done.stderr


# --- small parts ------------------------------------------------------------------------------------------------
def test_settings_are_literals_or_text():
    pairs = ["a=3", "b=1e-3", "c=(4, 4)", "d=tondu_lopez", "e=True", "f=none", "g={'x': 1}", "h=a=b"]
    expected = {"a": 3, "b": 1e-3, "c": (4, 4), "d": "tondu_lopez", "e": True, "f": None, "g": {"x": 1}, "h": "a=b"}
    assert parse_settings(pairs) == expected
    assert parse_settings(["x=__import__('os').getcwd()"]) == {"x": "__import__('os').getcwd()"}
    with pytest.raises(ParameterError, match="name=value"):
        parse_settings(["max_iter"])


def test_json_has_no_nan():
    assert json_ready({"a": np.float64("nan"), "b": [np.int64(3), float("inf")], "c": "x"}) == {
        "a": None,
        "b": [3, None],
        "c": "x",
    }


def test_table_aligns_text_left_and_numbers_right():
    assert table(["name", "n"], [["a", "1"], ["bcdef", "1000"]]) == "name      n\na         1\nbcdef  1000"


def test_a_new_command_is_one_new_file(tmp_path, monkeypatch, capsys):
    (tmp_path / "hello.py").write_text(
        "def add_parser(subparsers):\n"
        "    subparsers.add_parser('hello', help='greet')\n"
        "def run(args):\n"
        "    print('hello')\n"
        "    return 0\n"
    )
    package = importlib.import_module("pamid.cli.commands")
    monkeypatch.setattr(package, "__path__", [*package.__path__, str(tmp_path)])
    assert main(["hello"]) == 0
    assert capsys.readouterr().out == "hello\n"
    monkeypatch.delitem(sys.modules, "pamid.cli.commands.hello")
