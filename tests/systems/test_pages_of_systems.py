"""Every command takes the page of a cylinder, a joint and a muscle, or says which page it needs."""

from __future__ import annotations

import json

import numpy as np
import pandas as pd
import pytest

from pamid import evaluate
from pamid.cli import main
from pamid.errors import EmptyLogError, TooFewTrajectoriesError, UnknownOptionError
from pamid.systems.comparison import compare_system
from pamid.systems.cylinder import Cylinder
from pamid.systems.reference import disagreement

AREA = np.pi / 4 * 0.025**2


def arguments(files, kind: str) -> list[str]:
    return [str(files / f"{kind}.csv"), "--sim", str(files / f"{kind}.toml")]


# --- evaluate -----------------------------------------------------------------------------------------------
def test_an_evaluation_is_the_friction_beside_the_noise(cylinder):
    found = evaluate(cylinder, Cylinder(bore=0.025))["force"]
    assert found.rmse == pytest.approx(6.0, rel=0.03)
    expected = np.hypot(0.2, 50 * AREA) / np.sqrt(2)  # two samples in a window of 20 ms
    assert found.noise_floor == pytest.approx(expected, rel=0.1)
    assert list(found.trajectories) == ["run-0", "run-1", "run-2"]


@pytest.mark.parametrize("kind", ["cylinder", "joint", "muscle"])
def test_evaluate_takes_every_page(kind, files, capsys):
    assert main(["evaluate", *arguments(files, kind), "--json"]) == 0
    report = json.loads(capsys.readouterr().out)
    ((name, error),) = report["equations"].items()
    assert name == ("torque" if kind == "joint" else "force")
    assert report["kind"] == kind
    assert error["rmse"] > 3 * error["noise_floor"] > 0
    assert report["doubts"] == []
    assert main(["evaluate", *arguments(files, kind)]) == 0
    assert "fit / %" in capsys.readouterr().out


def test_evaluate_tells_a_pressure_that_is_an_atmosphere_off(files, capsys):
    log = pd.read_csv(files / "cylinder.csv")
    log.assign(P=log["P"] + 101_325).to_csv(files / "cylinder.csv", index=False)
    for command in ("evaluate", "check"):
        assert main([command, *arguments(files, "cylinder"), "--json"]) == 0
        report = json.loads(capsys.readouterr().out)
        told = report["doubts"] if command == "evaluate" else report["warnings"]
        assert any("absolute pressure that was taken for gauge" in text for text in told)


# --- compare ------------------------------------------------------------------------------------------------
def test_friction_is_what_the_nominal_equation_lacks(cylinder):
    found = compare_system(cylinder, Cylinder(bore=0.025), ["nominal*", "quadratic"], cv=3)
    assert found.best.estimator == "nominal with friction"
    assert found.best.rmse < 0.1 * found["nominal"].rmse
    assert found["nominal"].rmse == pytest.approx(6.0, rel=0.05)
    assert found["nominal"].n_parameters == 0
    with pytest.raises(UnknownOptionError, match="boosted trees"):
        compare_system(cylinder, Cylinder(bore=0.025), ["sofa"])
    with pytest.raises(TooFewTrajectoriesError):
        compare_system(cylinder[cylinder["trajectory"] == "run-0"], Cylinder(bore=0.025))


@pytest.mark.parametrize("kind", ["cylinder", "joint", "muscle"])
def test_compare_takes_every_page(kind, files, capsys):
    chosen = "GeometricForce*,PolynomialForce*" if kind == "muscle" else "nominal*,quadratic"
    argv = ["compare", *arguments(files, kind), "--estimators", chosen, "--folds", "3", "--out", str(files / "out")]
    assert main([*argv, "--where", "time > 1", "--json", "--quiet"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert report["n_runs"] == 3
    assert len(report["estimators"]) > 2
    assert report["n_scored_rows"] < 3 * 500
    assert all((files / "out" / name).is_file() for name in (f"comparison-{report['equation']}.png",))


# --- fit ----------------------------------------------------------------------------------------------------
def test_fit_takes_the_page_of_a_muscle_and_no_size_by_default(files, capsys):
    out = ["--folds", "0", "--out", str(files / "force.pamid")]
    assert main(["fit", *arguments(files, "muscle"), "--estimator", "GeometricForce", *out]) == 0
    capsys.readouterr()
    alone = ["fit", str(files / "muscle.csv"), "--estimator", "GeometricForce", *out]
    assert main(alone) == 2
    assert "Missing: rest_length and rest_diameter of the muscle" in capsys.readouterr().err
    assert main([*alone, "--set", "rest_length=200 mm", "--set", "rest_diameter=20 mm"]) == 0
    model = ["--model", str(files / "force.pamid")]
    assert main(["evaluate", *arguments(files, "muscle"), *model]) == 0
    capsys.readouterr()
    assert main(["fit", *arguments(files, "cylinder"), "--estimator", "GeometricForce", *out]) == 2
    assert "the simulator file of a muscle or a bench" in capsys.readouterr().err
    assert main(["compare", str(files / "muscle.csv"), "--estimators", "GeometricForce*"]) == 2
    assert "--rest-length" in capsys.readouterr().err


def test_what_needs_a_bench_says_so(files, capsys):
    argv = ["simulate", "--sim", str(files / "cylinder.toml"), "--trajectory", "sine:frequency=4,amplitude=5"]
    assert main([*argv, "--out", str(files / "log.csv")]) == 2
    assert "is the simulator file of a cylinder" in capsys.readouterr().err
    assert main(["evaluate", *arguments(files, "joint"), "--refit"]) == 0
    assert "no parameter of the simulator has a tolerance" in capsys.readouterr().err


# --- one format ---------------------------------------------------------------------------------------------
def test_every_page_names_its_kind(tmp_path):
    from pamid.bench import BenchParameters
    from pamid.systems import all_systems, read_system
    from pamid.systems.bench_page import bench_text
    from pamid.systems.file import kind_of_file

    bench, page = BenchParameters.for_muscle("B"), tmp_path / "sim.toml"
    bench.to_toml(page)
    assert page.read_text().splitlines()[1] == 'kind = "bench"'
    page.write_text(bench_text(bench))
    assert 'kind = "bench"' in page.read_text()
    assert BenchParameters.from_toml(page) == bench
    for kind, system in all_systems().items():
        page.write_text(system.text({q.name: q.lower for q in system.quantities if q.default is None}))
        assert kind_of_file(page) == kind
        assert read_system(page).kind == kind


def test_a_column_without_a_reading_and_one_of_zeros_are_named(cylinder):
    page = Cylinder(bore=0.025)
    with pytest.raises(EmptyLogError, match="No row holds all signals of a cylinder"):
        evaluate(cylinder.assign(F=np.nan), page)
    assert disagreement(cylinder.assign(F=np.nan), page) == ""
    assert "reads 0 in all rows" in disagreement(cylinder.assign(F=0.0), page)


@pytest.mark.parametrize("value", ["true", '"long"', "[0.2]"])
def test_a_number_of_a_page_that_is_none_is_named(value, files, capsys):
    (files / "no.toml").write_text(f'kind = "muscle"\n[muscle]\nrest_length = {value}\nrest_diameter = 0.02\n')
    assert main(["evaluate", *arguments(files, "joint")[:1], "--sim", str(files / "no.toml")]) == 2
    told = capsys.readouterr().err
    assert "muscle.rest_length is" in told
    assert "a number in m" in told


def test_a_kind_that_is_no_text_is_named(files, capsys):
    (files / "no.toml").write_text("kind = 3\n")
    assert main(["evaluate", *arguments(files, "joint")[:1], "--sim", str(files / "no.toml")]) == 2
    assert "kind is 3" in capsys.readouterr().err


@pytest.mark.parametrize("command", ["fit", "compare"])
def test_a_simulator_with_ports_is_sent_to_the_commands_that_take_it(command, files, capsys):
    (files / "ports.toml").write_text('kind = "ode"\n[ode]\nfunction = "f.py:f"\n[ports]\n')
    argv = ["--estimator", "MLP", "--out", str(files / "m.pamid")] if command == "fit" else []
    assert main([command, str(files / "muscle.csv"), "--sim", str(files / "ports.toml"), *argv]) == 2
    assert "'pamid diagnose' and 'pamid evaluate' take" in capsys.readouterr().err
