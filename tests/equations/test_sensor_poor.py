"""Benches without load cells or flow meters: what is not measured is eliminated between the equations."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from pamid.bench import BenchParameters, isobaric, simulate, sine, step, triangle
from pamid.effects import all_effects, make_effect
from pamid.equations import all_equations, evaluate_log
from pamid.gap import diagnose
from pamid.gap.residuals.bench import Evidence
from pamid.report import answers

NOMINAL = BenchParameters.for_muscle("B")
RUNS = [sine(4, 15, 1500), sine(8, 10, 1500), isobaric(4, 10, 1500), triangle(2, 12, 1500), step(0, 12, 1500)]
FORCE, FLOW = ["F1", "F2"], ["mdot1", "mdot2"]
FEW = ["coulomb_friction", "viscous_friction", "joint_damping", "leakage", "valve_dead_zone", "valve_saturation"]


def poor(effect: str | None, lacking: list[str], seed: int = 0, **values: float) -> pd.DataFrame:
    effects = [(effect, {**make_effect(effect).values, **values})] if effect else []
    return simulate(NOMINAL, RUNS, effects=effects, seed=seed).drop(columns=lacking)


@pytest.mark.parametrize(
    ("lacking", "tested"),
    [
        ([], ["force", "flow", "valve", "joint"]),
        (FORCE, ["flow", "valve", "joint_modelled"]),
        (FLOW, ["force", "joint", "gas_valve"]),
        (FORCE[:1], ["flow", "valve", "joint_modelled"]),
        (FORCE + FLOW, ["gas_valve", "joint_modelled"]),
    ],
)
def test_right_simulator_leaves_the_noise_that_is_stated(lacking, tested):
    found = evaluate_log(poor(None, lacking), NOMINAL)
    assert list(found) == tested
    for name, e in found.items():
        assert 0.85 < e.rmse / e.noise_floor < 1.15, name


@pytest.mark.parametrize("lacking", [FORCE, FLOW])
def test_noise_of_combined_equations_is_white(lacking):
    evidence = Evidence(poor(None, lacking), NOMINAL.replace(tolerance={}))
    for name, part in zip(evidence.equations, evidence.parts, strict=True):
        z, key = evidence.z0[part], evidence.run[part] * 2 + evidence.side[part]
        series = [z[key == k] for k in np.unique(key)]
        assert 0.85 < np.std(z) < 1.15, name
        assert abs(sum(float(x[1:] @ x[:-1]) for x in series) / float(z @ z)) < 0.2, name


@pytest.mark.parametrize(
    ("effect", "lacking"),
    [
        ("viscous_friction", FORCE),
        ("coulomb_friction", FORCE),
        ("leakage", FLOW),
        ("valve_lag", FLOW),
        ("pressure_bias", FORCE),
    ],
)
def test_own_simulator_closes_the_gap_of_a_combined_equation(effect, lacking):
    log = poor(effect, lacking, seed=5)
    actual = NOMINAL.replace(effects=[(effect, dict(make_effect(effect).values))])
    for name in evaluate_log(log, NOMINAL):
        equation = all_equations()[name]
        nominal, own = (evaluate_log(log, params, [name])[name] for params in (NOMINAL, actual))
        if equation.combines and equation.changed_by(all_effects()[effect]):
            assert nominal.rmse > 3 * nominal.noise_floor, name
            assert own.rmse < 0.1 * nominal.rmse or own.rmse < 1.5 * own.noise_floor, name


def test_fault_of_a_missing_sensor_changes_nothing():
    equations, library = all_equations(), all_effects()
    assert not equations["joint_modelled"].changed_by(library["force_bias"])
    assert not equations["gas_valve"].changed_by(library["flow_lag"])
    assert equations["joint_modelled"].changed_by(library["pressure_bias"])
    assert equations["gas_valve"].changed_by(library["leakage"])


@pytest.mark.parametrize(
    ("effect", "values", "lacking"),
    [
        ("viscous_friction", {"coefficient": 120.0}, FORCE),
        ("valve_dead_zone", {}, FLOW),
        ("leakage", {}, FORCE + FLOW),
        (None, {}, FORCE + FLOW),
    ],
)
def test_diagnosis_without_the_sensors(effect, values, lacking):
    found = diagnose(poor(effect, lacking, seed=2, **values), NOMINAL, FEW)
    if effect is None:
        assert found.verdict == "none"
        assert found.candidates[0].confidence > 0.9
    else:
        assert len(found.causes) == 1
        assert effect in found.causes[0].effects
        assert all_equations()[found.causes[0].equation].combines


def test_none_says_what_it_could_not_show():
    found = diagnose(poor(None, FORCE), NOMINAL, [*FEW, "force_bias", "force_gain"])
    assert found.cannot_show == ["force_bias", "force_gain"]
    told = answers(found)
    assert told.verdict == "No gap beyond the noise in what could be tested"
    assert "Force and joint were tested together, since the log lacks the tension of each muscle." in told.where
    assert "force–joint" in told.where
    assert told.which.startswith("None of the effects that this log can show")
    assert "It cannot show force bias or force gain." in told.which
