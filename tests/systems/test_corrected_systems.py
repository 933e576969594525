"""Pages with effects: written by a diagnosis, read again, and closing on the log what the diagnosis said."""

from __future__ import annotations

import json

import numpy as np
import pandas as pd
import pytest

from pamid import diagnose, evaluate
from pamid.cli import main
from pamid.effects import make_effect
from pamid.errors import ImplausibleParameterError, UnknownParameterError
from pamid.signals import write_log
from pamid.systems import read_system
from pamid.systems.cylinder import Cylinder
from pamid.systems.joint import Joint
from pamid.systems.muscle import Muscle

TIME = np.arange(0, 8, 0.004)
SPEEDS = (1.0, 2.3, 4.0)


def runs(make):
    rng = np.random.default_rng(0)
    parts = [make(w, rng).assign(trajectory=f"run-{w:g}", time=TIME) for w in SPEEDS]
    return pd.concat(parts, ignore_index=True)


def cylinder(way):
    def make(w, rng):
        x, v = 0.05 + 0.04 * np.sin(w * TIME), 0.04 * w * np.cos(w * TIME)
        P = 4e5 + 5e4 * np.sin(0.7 * w * TIME)
        F = (P - 101_325.0) * np.pi / 4 * 0.025**2 - way * 200.0 * v + 0.3 * rng.standard_normal(len(TIME))
        return pd.DataFrame({"x": x, "P": P, "F": F})

    return runs(make)


def joint():
    def make(w, rng):
        q, dq, ddq = 0.5 * np.sin(w * TIME), 0.5 * w * np.cos(w * TIME), -0.5 * w * w * np.sin(w * TIME)
        drive = 0.02 * ddq + 0.8 * np.sin(q) + 0.05 * dq + 0.004 * rng.standard_normal(len(TIME))
        return pd.DataFrame({"q": q, "drive": drive})

    return runs(make)


def muscle():
    page = Muscle(rest_length=0.2, rest_diameter=0.02, braid_angle=0.42)
    preload = make_effect("bladder_preload", rest=30.0, growth=250.0)

    def make(w, rng):
        eps, P = 0.1 + 0.06 * np.sin(w * TIME), 3e5 + 5e4 * np.cos(0.6 * w * TIME)
        return pd.DataFrame({"eps": eps, "P": P, "F": 0.0})

    log = runs(make)
    F = page.problem(log).nominal(page.problem(log).X) - 30.0 - 250.0 * log["eps"].to_numpy()
    assert preload.values["rest"] == 30.0
    return page, log.assign(F=F + 0.3 * np.random.default_rng(1).standard_normal(len(log)))


CASES = {
    "cylinder": lambda: (Cylinder(bore=0.025), cylinder(1), ["viscous_friction", "coulomb_friction", "force_bias"]),
    "cylinder that is pushed": lambda: (Cylinder(bore=0.025), cylinder(-1), ["viscous_friction", "force_bias"]),
    "joint": lambda: (Joint(inertia=0.02, gravity=0.8, unit="N m"), joint(), ["viscous_friction", "coulomb_friction"]),
    "muscle": lambda: (*muscle(), ["bladder_preload", "viscous_friction", "force_gain"]),
}


@pytest.mark.parametrize("case", CASES)
def test_the_corrected_page_closes_what_the_diagnosis_said(case, tmp_path):
    system, log, library = CASES[case]()
    found = diagnose(log, system, library)
    assert found.verdict == "cause" and found.corrected.effects
    found.corrected.to_toml(tmp_path / "corrected.toml")
    again = read_system(tmp_path / "corrected.toml")
    assert type(again) is type(system) and again.effects == found.corrected.effects
    [closure] = found.closure
    before, after = (evaluate(log, s)[closure.equation] for s in (system, again))
    assert before.rmse == pytest.approx(closure.rmse_before, rel=0.05)
    assert after.rmse == pytest.approx(closure.rmse_after, rel=0.1)
    text = (tmp_path / "corrected.toml").read_text()
    assert {"cylinder": "# N s/m", "cylinder that is pushed": "imposed", "joint": "# N m s/rad", "muscle": "# N"}[
        case
    ] in text
    assert diagnose(log, again, library).verdict == "none"


def test_the_commands_take_a_corrected_page(tmp_path, capsys):
    system, log, library = CASES["cylinder"]()
    write_log(log, tmp_path / "log.parquet")
    system.to_toml(tmp_path / "sim.toml")
    name, out = str(tmp_path / "log.parquet"), tmp_path / "out"
    argv = ["--quiet", "--json"]
    chosen = ["--effects", ",".join(library)]
    assert main(["diagnose", name, "--sim", str(tmp_path / "sim.toml"), "--out", str(out), *chosen, *argv]) == 0
    said = json.loads(capsys.readouterr().out)["closure"][0]
    assert main(["evaluate", name, "--sim", str(out / "corrected.toml"), *argv]) == 0
    assert json.loads(capsys.readouterr().out)["equations"]["force"]["rmse"] == pytest.approx(
        said["rmse_after"], rel=0.1
    )
    again = ["diagnose", name, "--sim", str(out / "corrected.toml"), "--out", str(tmp_path / "again"), *chosen]
    assert main([*again, *argv]) == 0
    assert json.loads(capsys.readouterr().out)["verdict"] == "none"


def test_friction_that_is_a_share_of_a_load_in_the_same_unit_is_not_bounded_as_one_per_pascal():
    values = {"coefficient": 0.3, "presliding": 0.02}
    bare, rubbing = (Joint(inertia=0.02, gravity=0.8, effects=e) for e in ((), [("load_dependent_friction", values)]))
    of, to = bare.problem(joint()), rubbing.problem(joint())
    added = np.abs(to.nominal(to.X) - of.nominal(of.X))
    assert np.max(added) == pytest.approx(0.3 * np.max(to.X["load"]), rel=0.1)


def test_runs_keep_their_memory_apart():
    """What a page with dry friction says of one run is the same alone and among others."""
    log = joint()
    values = {"amplitude": 0.08, "per_pressure": 0.0, "presliding": 0.02, "exponent": 1.0}
    page = Joint(inertia=0.02, gravity=0.8, effects=[("coulomb_friction", values)])
    problem = page.problem(log)
    whole, rows = problem.nominal(problem.X), np.flatnonzero(problem.groups == "run-2.3")
    np.testing.assert_allclose(problem.nominal(problem.X.iloc[rows]), whole[rows], atol=2e-3)
    assert values["presliding"] > 2e-3, "beyond the bound of a contraction: bounds in SI say nothing of an angle"


@pytest.mark.parametrize(
    ("effects", "error", "words"),
    [
        ([("rust", {})], UnknownParameterError, "rust"),
        ([("viscous_friction", {"amplitude": 1.0})], UnknownParameterError, "coefficient"),
        ([("viscous_friction", {"coefficient": -1.0})], ImplausibleParameterError, "-1"),
        ([("force_gain", {"deviation": 3.0})], ImplausibleParameterError, "3"),
    ],
)
def test_effects_of_a_page_are_checked(effects, error, words):
    with pytest.raises(error, match=words):
        Cylinder(bore=0.025, effects=effects)


def test_an_offset_of_the_force_that_moves_a_rod_keeps_its_sign_in_its_page():
    log = cylinder(-1)
    log["F"] += 5.0
    found = diagnose(log, Cylinder(bore=0.025, force="imposed"), ["viscous_friction", "force_bias"])
    problem = found.corrected.problem(log)
    assert {c.effects for c in found.causes} == {("viscous_friction",), ("force_bias",)}
    assert abs(np.mean(problem.y - problem.nominal(problem.X))) < 0.1
