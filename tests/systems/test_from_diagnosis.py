"""From a diagnosis to a better model: the causes of a muscle's gap become effects of a hybrid model."""

from __future__ import annotations

import json

import numpy as np
import pandas as pd
import pytest
from pamid.estimators import GapDiagnoser, StaticPIHM
from pamid.estimators._gap import hybrid_with

from pamid.cli import main
from pamid.effects import Signals, make_effect
from pamid.errors import EffectsWarning, IncompatibleError
from pamid.gap import Cause
from pamid.persistence import load, save
from pamid.systems.muscle import Muscle

PAGE = Muscle(rest_length=0.2, rest_diameter=0.02)
STOPS = {"middle": 12.0, "width": 6e4}
SMALL = ["--set", "hidden_layer_sizes=[8]", "--set", "max_iter=15", "--folds", "0", "--quiet"]


def runs(seed: int = 0, count: int = 5, rows: int = 500, dt: float = 0.01) -> pd.DataFrame:
    """A muscle at held contractions, filled and vented, with stops in its pressure."""
    rng = np.random.default_rng(seed)
    parts = []
    for k in range(count):
        t = dt * np.arange(rows)
        P = 3e5 + sum(a * np.sin(w * t + rng.uniform(0, 6)) for a, w in ((1.2e5, 1.9), (5e4, 5.3)))
        run = pd.DataFrame({"trajectory": f"run {k}", "time": t, "eps": 0.02 + 0.04 * k, "P": P})
        stops = make_effect("pressure_hysteresis", **STOPS)
        s = Signals(time=t, position=run["eps"].to_numpy(), pressure=P)
        held = stops.force(s, stops.trace(s, PAGE.plant(), dt, np.array([0])), PAGE.plant())
        problem = PAGE.nominal_problem(run.assign(F=0.0))
        parts.append(run.assign(F=problem.nominal(problem.X) + held + 0.2 * rng.standard_normal(rows)))
    return pd.concat(parts, ignore_index=True)


@pytest.fixture(scope="module")
def diagnoser() -> GapDiagnoser:
    problem = PAGE.nominal_problem(runs())
    library = ["pressure_hysteresis", "force_bias", "force_lag"]
    found = GapDiagnoser(problem.nominal, library, plant=problem.plant, random_state=0)
    return found.fit(problem.X.assign(trajectory=problem.groups), problem.y)


def test_the_causes_become_effects_of_a_model_that_is_saved(diagnoser: GapDiagnoser, tmp_path) -> None:
    model = diagnoser.to_estimator()
    assert isinstance(model, StaticPIHM)
    assert (model.rest_length, round(model.rest_diameter, 6)) == (0.2, 0.02)
    assert list(model.effects) == ["pressure_hysteresis"]
    assert model.effects["pressure_hysteresis"]["width"] == pytest.approx(STOPS["width"], rel=0.3)
    again = load(save(model.set_params(hidden_layer_sizes=(8,), max_iter=5), tmp_path / "model.pamid"))
    assert again.effects == model.effects


def test_what_a_model_cannot_hold_is_said(diagnoser: GapDiagnoser) -> None:
    causes = [*diagnoser.causes_, Cause(("force_lag",), "force", 0.9, 0.1, (0.0, 0.2), {})]
    with pytest.warns(EffectsWarning, match="force_lag"):
        assert len(hybrid_with(causes, "force", diagnoser.plant).effects) == 1
    with pytest.raises(IncompatibleError, match="plant"):
        hybrid_with(causes, "force", None)
    with pytest.raises(IncompatibleError, match="torque"):
        hybrid_with(causes, "torque", diagnoser.plant)


def test_the_command_line_goes_the_same_way(tmp_path, capsys) -> None:
    runs().to_csv(tmp_path / "log.csv", index=False)
    runs(9, 2).to_csv(tmp_path / "other.csv", index=False)
    PAGE.to_toml(tmp_path / "sim.toml")
    log, sim = str(tmp_path / "log.csv"), str(tmp_path / "sim.toml")
    library = "pressure_hysteresis,force_bias,leakage"
    assert main(["diagnose", log, "--sim", sim, "--out", str(tmp_path / "d"), "--effects", library, "--quiet"]) == 0
    errors = {}
    for name, more in (("plain", ["--estimator", "StaticPIHM"]), ("held", ["--diagnosis", str(tmp_path / "d")])):
        model = str(tmp_path / f"{name}.pamid")
        assert main(["fit", log, "--sim", sim, "--out", model, *more, *SMALL]) == 0
        capsys.readouterr()
        assert main(["evaluate", str(tmp_path / "other.csv"), "--sim", sim, "--model", model, "--json"]) == 0
        errors[name] = json.loads(capsys.readouterr().out)["rmse"]
    assert errors["held"] < 0.3 * errors["plain"]


@pytest.mark.parametrize("text", [None, "[]", '{"causes": [{"effects": "x"}]}'])
def test_a_folder_without_causes_is_refused(tmp_path, text, capsys) -> None:
    runs(count=2, rows=50).to_csv(tmp_path / "log.csv", index=False)
    if text is not None:
        (tmp_path / "diagnosis.json").write_text(text)
    PAGE.to_toml(tmp_path / "sim.toml")
    options = ["--sim", str(tmp_path / "sim.toml"), "--out", str(tmp_path / "m.pamid"), "--diagnosis", str(tmp_path)]
    assert main(["fit", str(tmp_path / "log.csv"), *options]) == 2
    assert "pamid diagnose" in capsys.readouterr().err
