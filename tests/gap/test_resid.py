"""The residual test: its probabilities hold by chance, it finds what is left, and its commands say so."""

from __future__ import annotations

import json

import numpy as np
import pandas as pd
import pytest

from pamid.bench import BenchParameters, simulate, sine
from pamid.cli import main
from pamid.cli._residuals import Left
from pamid.cli.commands.resid import _verdict
from pamid.compare import residual_test
from pamid.errors import ShapeError, ShortTrajectoryError
from pamid.plots import ResidualTestDisplay
from pamid.signals import write_log
from pamid.systems.cylinder import Cylinder


def coloured(rng, n, pole):
    from scipy.signal import lfilter

    return lfilter([1.0], [1.0, -pole], rng.standard_normal(n))


def test_chance_keeps_to_its_probabilities():
    rng, white, apart = np.random.default_rng(0), [], []
    groups = np.repeat([0, 1, 2], 500)
    for _ in range(200):
        e, u = coloured(rng, 1500, 0.8), coloured(rng, 1500, 0.9)
        apart.append(residual_test(e, {"u": u}, groups, lags=15).p_input["u"])
        white.append(residual_test(rng.standard_normal(1500), {}, groups, lags=15).p_white)
    for p in (np.array(white), np.array(apart)):
        assert np.mean(p < 0.05) < 0.1  # 5 % are asked for; coloured signals give 1 to 6 %, so it errs to the safe side
        assert 0.4 < np.mean(p) < 0.65


def test_what_is_left_is_found_and_runs_are_kept_apart():
    rng = np.random.default_rng(1)
    u = rng.standard_normal(1200)
    e = rng.standard_normal(1200)
    e[2:] += 0.3 * u[:-2]
    groups = np.repeat([0, 1], 600)
    found = residual_test(e, {"u": u, "still": np.ones(1200)}, groups, lags=10, interval=0.01)
    assert found.cross_lags[np.argmax(found.cross["u"])] == 2 and found.p_input["u"] < 1e-6
    assert "still" not in found.cross
    assert found.p_white > 0.01
    tail = np.zeros(1200)
    tail[590:600], tail[600:610] = 5.0, 5.0  # neighbours in the table, but of two runs
    whole = residual_test(tail, {}, lags=20).auto[15]
    assert residual_test(tail, {}, groups, lags=20).auto[15] < whole - 0.1
    holed = np.where(np.arange(1200) == 300, np.nan, e)
    assert residual_test(holed, {"u": u}, groups, lags=10).n_rows == 1199
    lost = np.where(np.arange(1200) < 700, np.nan, u)
    part = residual_test(e, {"u": lost, "gone": np.full(1200, np.nan)}, groups, lags=10)
    assert list(part.cross) == ["u"] and part.cross_lags[np.argmax(part.cross["u"])] == 2
    drawn = ResidualTestDisplay(found).plot()
    assert [ax.get_ylabel().split("\n")[0] for ax in drawn.axes_] == ["residual with its past", "residual with u"]
    assert drawn.axes_[-1].get_xlabel() == "lag / s"


def test_what_cannot_be_tested():
    with pytest.raises(ShapeError):
        residual_test(np.zeros(100), {"u": np.zeros(99)})
    with pytest.raises(ShortTrajectoryError, match="30 rows"):
        residual_test(np.arange(30.0), {}, lags=25)


@pytest.fixture(scope="module")
def stroke(tmp_path_factory) -> str:
    rng, t, runs = np.random.default_rng(0), np.arange(0, 6, 0.01), []
    for k, w in enumerate((1.0, 2.0, 3.5)):
        P = 4e5 + 3e4 * coloured(rng, len(t), 0.5)  # a sine would meet another by chance
        F = 1.1 * (P - 101_325.0) * np.pi / 4 * 0.025**2 + 0.5 * rng.standard_normal(len(t))
        runs.append(pd.DataFrame({"trajectory": str(k), "time": t, "x": 0.02 + 0.01 * np.sin(w * t), "P": P, "F": F}))
    folder = tmp_path_factory.mktemp("stroke")
    write_log(pd.concat(runs), folder / "log.parquet")
    Cylinder(bore=0.025).to_toml(folder / "sim.toml")
    return str(folder)


def test_the_command_names_the_input(stroke, tmp_path, capsys):
    words = ["resid", f"{stroke}/log.parquet", "--sim", f"{stroke}/sim.toml", "--quiet"]
    assert main([*words, "--json", "--out", str(tmp_path / "r.svg")]) == 0
    found = json.loads(capsys.readouterr().out)["equations"]["force"]
    assert found["inputs"]["P"]["p_value"] < 1e-6 < 0.001 < found["inputs"]["x"]["p_value"]
    assert (tmp_path / "r.svg").stat().st_size > 5000
    assert main(words) == 0
    assert "misses part of the effect of P," in " ".join(capsys.readouterr().out.split())
    assert main([*words, "--equation", "flow"]) == 2
    assert "one of force" in capsys.readouterr().err


def test_noise_blames_nothing():
    rng = np.random.default_rng(0)
    u = rng.standard_normal(800)
    test = residual_test(0.3 * u + rng.standard_normal(800), {"u": u}, lags=10)
    assert "misses part of the effect of u," in _verdict(test, Left(pd.DataFrame(), "N"))
    assert _verdict(test, Left(pd.DataFrame(), "N", within_noise=True)).startswith("No larger than the noise")


def test_signals_of_a_simulator_have_the_users_names(tmp_path, capsys):
    rng, t, runs = np.random.default_rng(0), np.arange(0, 8, 0.01), []
    for k in range(2):
        w = np.array([1.0 + k, 2.3, 4.1])[:, None]
        F = np.sum(np.cos(w * t), axis=0)
        v, x = np.sum(np.sin(w * t) / w, axis=0) / 2.0, np.sum(-np.cos(w * t) / w**2, axis=0) / 2.0
        x, v = (z + 1e-3 * rng.standard_normal(len(t)) for z in (x, v))
        runs.append(pd.DataFrame({"trajectory": str(k), "time": t, "F": F, "x": x, "v": v}))
    write_log(pd.concat(runs), tmp_path / "log.parquet")
    (tmp_path / "sim.toml").write_text(
        'kind = "equations"\n[equations]\n"dx/dt" = "v"\n"dv/dt" = "F/2.4"\n[ports]\n'
        'F = { kind = "input", unit = "N" }\nx = { kind = "state", unit = "m" }\nv = { kind = "state", unit = "m/s" }\n'
    )
    log, sim = str(tmp_path / "log.parquet"), str(tmp_path / "sim.toml")
    assert main(["resid", log, "--sim", sim, "--lags", "10", "--quiet", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)["equations"]
    assert all(set(test["inputs"]) == {"x", "v", "F"} for test in found.values())
    assert found["x"]["inputs"]["F"]["p_value"] < 1e-3


def test_a_saved_model_is_presented_and_tested(tmp_path, capsys):
    rng = np.random.default_rng(0)
    t = np.arange(0, 4, 0.01)
    parts = []
    for k in range(3):
        eps, P = 0.1 + 0.05 * np.sin((1 + k) * t), 3e5 + 1e5 * np.sin((2 - 0.3 * k) * t)
        F = 1e-3 * P * (1 - 3 * eps) + 2 * rng.standard_normal(len(t))
        parts.append(pd.DataFrame({"trajectory": str(k), "time": t, "eps": eps, "P": P, "F": F}))
    write_log(pd.concat(parts), tmp_path / "log.parquet")
    log, out = str(tmp_path / "log.parquet"), str(tmp_path / "force.pamid")
    words = ["--set", "rest_length=0.2", "--set", "rest_diameter=0.021", "--folds", "3", "--out", out, "--quiet"]
    assert main(["fit", log, "--estimator", "GeometricForce", *words]) == 0
    assert "fit / %" in capsys.readouterr().out
    assert main(["present", out, "--json"]) == 0
    shown = json.loads(capsys.readouterr().out)
    assert shown["settings"]["rest_diameter"] == "0.021"
    assert set(shown["fits"]) == {"the log of the fit", "runs not seen"}
    assert any(p["standard_error"] for p in shown["parameters"].values())
    assert main(["present", out]) == 0
    assert "std. error" in capsys.readouterr().out
    assert main(["resid", log, "--model", out, "--json", "--quiet"]) == 0
    assert set(json.loads(capsys.readouterr().out)["equations"]["force"]["inputs"]) == {"eps", "P"}


def test_an_input_that_is_not_known_is_named(tmp_path, capsys):
    bench = BenchParameters.for_muscle("B")
    bench.to_toml(tmp_path / "sim.toml")
    log = simulate(bench, [sine(4, 15, 2000)], seed=0)
    for change in (log.drop(columns="u1"), log.drop(columns=["u1", "u2"]), log.assign(u1=np.nan), log.assign(u1=0.0)):
        file = str(write_log(change, tmp_path / "log.parquet"))
        argv = ["resid", file, "--sim", str(tmp_path / "sim.toml"), "--lags", "5", "--equation", "force", "--quiet"]
        assert main(argv) == 0
        out = capsys.readouterr().out
        assert main([*argv, "--json"]) == 0
        left_out = json.loads(capsys.readouterr().out)["equations"]["force"]["left_out"]
        assert ("Not tested" in out) == bool(left_out)
