"""A second opinion on the numbers of a cylinder or a joint, and their passport."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from pamid.bench import BenchParameters
from pamid.cli import main
from pamid.errors import ParameterError, UnknownParameterError
from pamid.gap import refit_within_tolerance
from pamid.opinion import Opinion, Passport, read_fit, second_opinion
from pamid.opinion.passport import Entry
from pamid.systems import read_system
from pamid.systems.cylinder import Cylinder
from pamid.systems.joint import Joint

LIBRARY = ["coulomb_friction", "force_bias", "viscous_friction"]
T = np.arange(0, 4, 0.01)


def cylinder_log(friction: float, bore: float = 0.025, sense: int = 1, seed: int = 0) -> pd.DataFrame:
    """Return a log of a cylinder with dry friction (N): pressure rises with the speed, as where it is throttled."""
    rng, runs = np.random.default_rng(seed), []
    for k in range(4):
        w = 1.0 + 0.7 * k
        x, v = 0.02 * np.sin(w * T), 0.02 * w * np.cos(w * T)
        p = 2e5 + 4e4 * k + 8e4 * np.cos(w * T) + 4e4 * np.sin(0.6 * w * T + k)
        F = np.pi / 4 * bore**2 * p - sense * friction * np.tanh(v / 1e-3) + 0.2 * rng.standard_normal(len(T))
        P = 101_325 + p + 50 * rng.standard_normal(len(T))
        runs.append(pd.DataFrame({"trajectory": f"run-{k}", "time": T, "x": x, "P": P, "F": F}))
    return pd.concat(runs, ignore_index=True)


def line_through(log: pd.DataFrame) -> dict[str, float]:
    """Return what a tool without friction fits: a line through force and pressure."""
    slope, begin = np.polyfit(log["P"], log["F"], 1)
    return {"bore": float(np.sqrt(4 * slope / np.pi)), "atmospheric_pressure": float(-begin / slope)}


def joint_log(friction: float, gain: float) -> pd.DataFrame:
    """Return a log of a servo whose drive is a gain times its error: 0.02 s²/rad, 0.5, and dry friction."""
    rng, runs = np.random.default_rng(0), []
    for k in range(3):
        a, w = 0.5 + 0.15 * k, 1.5 + 1.2 * k
        q, dq, ddq = a * np.sin(w * T), a * w * np.cos(w * T), -a * w**2 * np.sin(w * T)
        drive = 0.02 * ddq + 0.5 * np.sin(q) + friction * np.tanh(dq / 1e-3) + 0.01 * rng.standard_normal(len(T))
        runs.append(pd.DataFrame({"trajectory": str(k), "time": T, "q": q, "q_ref": q + drive / gain}))
    return pd.concat(runs, ignore_index=True)


@pytest.fixture(scope="module", params=[1, -1], ids=["delivered", "imposed"])
def absorbed(request: pytest.FixtureRequest) -> tuple[pd.DataFrame, Opinion]:
    log = cylinder_log(6.0, sense=request.param)
    return log, second_opinion(log, Cylinder(bore="25 mm"), line_through(log), LIBRARY)


def test_numbers_that_took_up_the_friction_of_a_cylinder_are_told(absorbed: tuple[pd.DataFrame, Opinion]) -> None:
    log, said = absorbed
    fitted = line_through(log)
    assert abs(fitted["bore"] - 0.025) > 1e-3, "the fit absorbed friction"
    assert said.absorbed == ["bore", "atmospheric_pressure"] and said.missing == ["coulomb_friction"]
    found = {j.name: j.value for j in said.numbers}
    assert found == pytest.approx({"bore": 0.025, "atmospheric_pressure": 101_325}, rel=0.01)
    corrected = said.diagnosis.corrected
    assert corrected is not None and corrected.get("bore") == pytest.approx(0.025, rel=1e-3)
    assert dict(corrected.effects)["coulomb_friction"]["amplitude"] == pytest.approx(6.0, rel=0.02)


def test_a_clean_fit_of_a_cylinder_is_not_accused() -> None:
    log = cylinder_log(0.0)
    said = second_opinion(log, Cylinder(bore=0.025), line_through(log), LIBRARY)
    assert not said.missing and {j.status for j in said.numbers} == {"holds"}
    assert said.sentences()[-1] == "No further run is needed."
    wrong = second_opinion(log, Cylinder(bore=0.026, tolerance={"bore": 0.05}), {"bore": 0.028}, LIBRARY)
    assert [j.status for j in wrong.numbers] == ["absorbed"], "8 % off what is known to 5 %"
    assert wrong.numbers[0].value == pytest.approx(0.025, rel=1e-3)


def test_a_second_log_tests_the_passport(absorbed: tuple[pd.DataFrame, Opinion]) -> None:
    log, said = absorbed
    model = said.diagnosis.corrected
    assert model is not None
    sense = int(model.sense)
    passport = Passport.of(said).check(cylinder_log(6.0, sense=sense, seed=1), model, "same")
    other = passport.check(cylinder_log(6.0, bore=0.0265, sense=sense, seed=2), model, "other")
    assert [r.status["bore"] for r in other.rigs] == ["agrees", "differs"]
    assert other.rigs[1].values["bore"][0] == pytest.approx(0.0265, rel=2e-3)
    with pytest.raises(UnknownParameterError, match="The passport has m"):
        Passport({"m": Entry(2.0, 1.98, 2.02, "kg", "holds", 2.01)}).check(log, model, "same")


def test_numbers_of_a_joint_that_the_page_leaves_to_the_log_are_judged() -> None:
    log = joint_log(0.08, gain=2.0)
    said = second_opinion(log, Joint(gain=2.0), {"inertia": 0.02, "gravity": 0.65}, ["coulomb_friction"])
    assert {j.name: j.status for j in said.numbers} == {"inertia": "holds", "gravity": "absorbed"}
    assert said.numbers[1].value == pytest.approx(0.5, rel=0.01), "how rates are taken is an error of the inertia"


def test_the_gain_of_a_servo_is_open_beside_its_inertia_and_load() -> None:
    log, fitted = joint_log(0.0, gain=2.0), {"gain": 2.4, "inertia": 0.02, "gravity": 0.5}
    said = second_opinion(log, Joint(gain=2.0, limit=0.6), fitted, ["coulomb_friction"])
    assert set(said.flat[0].weights) == set(fitted), "all may change by the same share"
    assert {j.status for j in said.numbers} == {"open"}


def test_the_command_line_takes_the_page_of_a_system(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log = cylinder_log(6.0)
    Cylinder(bore=0.025, force="delivered").to_toml(tmp_path / "sim.toml")
    Cylinder(**line_through(log)).to_toml(tmp_path / "fitted.toml")
    log.to_csv(tmp_path / "log.csv", index=False)
    cylinder_log(6.0, seed=3).to_csv(tmp_path / "other.csv", index=False)
    sim, fit, out = (str(tmp_path / name) for name in ("sim.toml", "fitted.toml", "opinion"))
    words = ["diagnose", str(tmp_path / "log.csv"), "--sim", sim, "--after", fit, "--effects", ",".join(LIBRARY)]
    assert main([*words, "--out", out, "--quiet"]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "bore absorbed the missing physics: 0.02" in said and "passport.toml" in said
    assert read_system(f"{out}/corrected.toml").get("bore") == pytest.approx(0.025, rel=1e-3)
    words = ["passport", f"{out}/passport.toml", str(tmp_path / "other.csv"), "--sim", f"{out}/corrected.toml"]
    assert main([*words, "--quiet"]) == 0
    assert capsys.readouterr().out.count("agrees") == 2


def test_a_fitted_page_says_what_was_fitted(tmp_path: Path) -> None:
    page = tmp_path / "fitted.toml"
    Cylinder(bore=0.0254, rod=0.01).to_toml(page)
    fit = read_fit(page).of(Cylinder(bore=0.025, rod=0.01))
    assert {name: number.value for name, number in fit.numbers.items()} == {"bore": 0.0254}
    with pytest.raises(ParameterError, match=r"fitted\.toml is of the kind cylinder, the simulator of the kind joint"):
        read_fit(page).of(Joint())
    with pytest.raises(ParameterError, match="has the same numbers"):
        read_fit(page).of(read_system(page))


def test_a_bench_says_what_to_do_instead() -> None:
    with pytest.raises(ParameterError, match="that of a bench"):
        second_opinion(cylinder_log(0.0), BenchParameters.for_muscle("B"), {"inertia": 0.02})  # type: ignore[arg-type]


def test_tolerances_of_a_page_are_read_written_and_used(tmp_path: Path) -> None:
    page = Cylinder(bore=0.025, tolerance={"bore": 0.05})
    page.to_toml(tmp_path / "sim.toml")
    again = read_system(tmp_path / "sim.toml")
    assert again.tolerance == {"bore": 0.05} and again.identity() == page.identity()
    refit = refit_within_tolerance(cylinder_log(0.0, bore=0.0255), again)
    assert refit.params.get("bore") == pytest.approx(0.0255, rel=1e-3) and not refit.at_bound
    with pytest.raises(UnknownParameterError, match="tolerance"):
        Cylinder(bore=0.025, tolerance={"stroke": 0.05})
