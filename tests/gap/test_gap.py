"""The diagnosis of a gap: its statistics piece by piece, and its answers on logs whose cause is known."""

from __future__ import annotations

import json
import math
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from scipy.optimize import lsq_linear

from pamid.bench import BenchParameters, hold, simulate, sine, step, triangle
from pamid.effects import all_effects, make_effect
from pamid.equations import evaluate_log
from pamid.errors import ExcitationError, MissingColumnError, UnknownOptionError
from pamid.gap import diagnose, state_table
from pamid.gap.diagnosis.localise import regions
from pamid.gap.diagnosis.remainder import _rhythm
from pamid.gap.inference.competition import Competition
from pamid.gap.inference.gauss_newton import Fitter
from pamid.gap.inference.hypotheses import degenerate
from pamid.gap.inference.occam import occam
from pamid.gap.inference.sensitivity import templates
from pamid.gap.inference.significance import library_test
from pamid.gap.inference.student_t import bounded, form_cost, loglik, scale, solve
from pamid.gap.residuals.bench import Evidence
from pamid.gap.residuals.checks import notes_on
from pamid.signals.paths import play, reversals

NOMINAL = BenchParameters.for_muscle("B").replace(
    tolerance={"rest_diameter": 0.005, "braid_angle": 0.005, "sonic_conductance": 0.02, "inertia": 0.02}
)
_OFF = {"rest_diameter": 1.003, "sonic_conductance": 0.99, "inertia": 1.01}
ACTUAL = NOMINAL.replace(**{name: NOMINAL.get(name) * factor for name, factor in _OFF.items()})
RUNS = [sine(2, 15, 1200), sine(6, 10, 1200), sine(9, 20, 1200), step(0, 15, 1200), triangle(3, 12, 1200)]
LIBRARY = ["coulomb_friction", "viscous_friction", "leakage", "flow_bias", "valve_dead_zone", "force_bias", "gravity"]


def log_with(*effects: tuple[str, dict[str, float]], seed: int = 0) -> pd.DataFrame:
    """Simulate the runs on a bench with effects, its parameters a little off within their tolerances."""
    return simulate(ACTUAL.replace(effects=list(effects)), RUNS, seed=seed)


@pytest.fixture(scope="module")
def clean() -> pd.DataFrame:
    return log_with()


@pytest.fixture(scope="module")
def evidence(clean) -> Evidence:
    return Evidence(clean, NOMINAL)


# --- paths ----------------------------------------------------------------------------------------------------
def test_play_is_that_of_single_steps():
    x = np.cumsum(np.random.default_rng(0).normal(size=(257, 2)), axis=0)
    slow = np.empty_like(x)
    held = slow[0] = x[0]
    for k in range(1, len(x)):
        held = slow[k] = np.clip(held, x[k] - 1.3, x[k] + 1.3)
    np.testing.assert_array_equal(play(x, 1.3), slow)


def test_reversals_are_where_a_signal_turns():
    np.testing.assert_array_equal(reversals(np.array([0.0, 1, 2, 2, 1, 1, 3])), [0, 3, 5, 6])
    np.testing.assert_array_equal(reversals(np.zeros(4)), [0, 3])


# --- likelihood -----------------------------------------------------------------------------------------------
def test_the_scale_of_noise_is_its_width():
    z = np.random.default_rng(0).normal(size=200_000)
    assert scale(3.0 * z) == pytest.approx(3.0, rel=0.01)
    assert scale(0.5 * z) == 1.0
    assert scale(0.5 * z, least=0.0) == pytest.approx(0.5, rel=0.01)
    z[:2000] *= 50.0
    assert scale(z) < 1.1


def test_bounded_least_squares_is_that_of_scipy():
    rng = np.random.default_rng(0)
    for _ in range(60):
        k = int(rng.integers(1, 8))
        A, b = rng.normal(size=(30, k)), 5 * rng.normal(size=30)
        low, high = -rng.random(k), rng.random(k)
        best = lsq_linear(A, b, (low, high), method="bvls", tol=1e-14).x
        found = bounded(A.T @ A, A.T @ b, low, high)
        assert np.all((found >= low) & (found <= high))
        assert np.sum((A @ found - b) ** 2) <= np.sum((A @ best - b) ** 2) * (1 + 1e-7)


def test_a_fit_is_not_misled_by_outliers_and_improves_the_likelihood():
    rng = np.random.default_rng(1)
    A = rng.normal(size=(2000, 2))
    z = rng.normal(size=2000) - A @ [3.0, -2.0]
    z[:40] += 80.0
    parts = [slice(0, 1000), slice(1000, 2000)]
    found = solve(z, A, np.full(2, -10.0), np.full(2, 10.0), parts)
    np.testing.assert_allclose(found.x, [3.0, -2.0], atol=0.1)
    assert found.loglik > loglik(z, parts)[0]
    assert form_cost(A, found, parts, np.ones(2)) == pytest.approx(math.log(2001.0), abs=0.7)


# --- evidence -------------------------------------------------------------------------------------------------
def test_residuals_under_effects_are_those_of_the_equations(clean, evidence):
    spec = {"leakage": {"conductance": 1e-10}, "viscous_friction": {"coefficient": 20.0}}
    changed = evidence.raw(evidence.z(spec))
    corrected = NOMINAL.replace(effects=[(k, v) for k, v in spec.items()])
    for name, part in zip(evidence.equations, evidence.parts, strict=True):
        rms = float(np.sqrt(np.mean(np.square(changed[part] * evidence.noise[part]))))
        assert rms == pytest.approx(evaluate_log(clean, corrected)[name].rmse, rel=0.1)
    untouched = evidence.parts[evidence.equations.index("joint")]
    np.testing.assert_array_equal(changed[untouched], evidence.raw(evidence.z0)[untouched])


def test_the_refit_within_tolerances_reaches_the_noise(evidence):
    base = Fitter(evidence).base()
    assert np.all(base.scales < 1.15) and np.all(np.abs(base.x) <= 1.1)


def test_a_tangent_is_exact_where_it_touches(evidence):
    x = np.array([0.9, -0.8, 0.5, 0.7])
    for spec in ({}, {"leakage": {"conductance": 1e-10}}):
        exact = evidence.z(spec, dict(zip(evidence.free, x, strict=True)), equations=None)
        np.testing.assert_allclose(evidence.tangent(spec, x) + evidence.J @ x, exact, atol=1e-9)
    assert np.abs(evidence.z0 + evidence.J @ x - exact).max() > 1.0  # the model is not linear in its tolerances


def test_what_a_diagnosis_leaves_is_what_its_correction_leaves():
    d = diagnose(log_with(("coulomb_friction", {"amplitude": 3.0})), NOMINAL, effects=LIBRARY)
    left = d.windows[d.windows["equation"] == "force"]["after"]
    log = log_with(("coulomb_friction", {"amplitude": 3.0}))
    rmse = evaluate_log(log, d.corrected, ["force"])["force"].rmse
    assert rmse == pytest.approx(float(np.sqrt(np.mean(np.square(left)))), rel=0.05)


def test_the_price_of_an_effect_is_what_its_parameters_bend():
    rng = np.random.default_rng(0)
    amplitude, time = all_effects()["creep"].parameters[:2]
    assert amplitude.linear and not time.linear
    D, J, w = rng.normal(size=(2000, 2)), np.zeros((2000, 0)), np.ones(2000)
    one = 0.5 * np.log(2000)
    assert occam(D[:, :1], J, w, [amplitude], [1.0], 100.0) == pytest.approx(one)
    idle = occam(D * [1.0, 1e-6], J, w, [amplitude, time], [1.0, 1.0], 100.0)
    busy = occam(D, J, w, [amplitude, time], [1.0, 1.0], 100.0)
    assert idle == pytest.approx(one, abs=0.1) and one + 1.0 < busy <= 2 * one
    # What a tolerance takes up is not bent by the effect.
    assert occam(D, D[:, 1:], w, [amplitude, time], [1.0, 1.0], 100.0) < busy - 1.0


def test_regions_agree_with_where_the_gap_is(evidence):
    part = evidence.parts[evidence.equations.index("force")]
    power = np.zeros(len(evidence.z0))
    inside = (evidence.state["eps"][part] > 0.13) & (evidence.state["deps"][part] > 0)
    power[part] = np.where(inside, 1.0, 0.01)
    found = regions(evidence, "force", power)
    side = evidence.side[part]
    named = np.zeros(len(inside), dtype=bool)
    for muscle in (0, 1):
        own = side == muscle
        table = pd.DataFrame(
            {f"{c}{muscle + 1}": evidence.state[c][part][own] for c in ("eps", "deps", "P", "dP", "u")}
        )
        rows = np.flatnonzero(own)
        for query in (r.query for r in found if f"{muscle + 1} " in r.query):
            named[rows[table.query(query).index.to_numpy()]] = True
    assert 2 * np.sum(named & inside) / (named.sum() + inside.sum()) > 0.9
    assert sum(r.share for r in found) > 0.75


@pytest.mark.parametrize("name", ["leakage", "coulomb_friction", "diameter", "gravity"])
def test_templates_are_the_effects_own_changes(evidence, name):
    for t in templates(evidence, name)[:2]:
        x = 1e-3 * np.where(np.isfinite(t.upper), np.minimum(t.upper, 1.0), 1.0)
        exact = evidence.z({name: t.starts(x)[0]}) - evidence.z0
        np.testing.assert_allclose(t.columns @ x, exact, atol=0.03 * np.abs(exact).max() + 1e-9)


def test_p_values_without_a_gap_are_not_small():
    values = []
    for seed in range(6):
        e = Evidence(log_with(seed=seed), NOMINAL)
        found = [t for name in LIBRARY for t in templates(e, name)]
        values.append(library_test(e, Fitter(e).base(), found, np.random.RandomState(0)).p_value)
    assert min(values) > 0.005 and max(values) > 0.2


def test_an_effect_that_turned_into_another_one_is_told(evidence):
    fit = Fitter(evidence).at(
        {"stribeck_friction": {"coulomb": 3.0, "breakaway": 0.0, "velocity": 0.1, "presliding": 1e-4}}
    )
    assert degenerate(make_effect("stribeck_friction", **fit.spec["stribeck_friction"]), 10.0)
    fit = Fitter(evidence).at(
        {"hysteresis": {"amplitude": 1.0, "slip": 0.0, "displacement": 1e-3, "shape": 0.5, "spread": 0.0}}
    )
    assert degenerate(make_effect("hysteresis", **fit.spec["hysteresis"]), 10.0)
    assert not degenerate(make_effect("leakage"), 10.0)


# --- answers --------------------------------------------------------------------------------------------------
def test_no_gap(clean):
    d = diagnose(clean, NOMINAL, LIBRARY)
    assert d.verdict == "none" and not d.gap and d.p_value > 0.01
    assert not d.causes and not d.closure and d.candidates[0].effect == "none"
    assert d.corrected.effects == ()


CAUSES = [
    ("coulomb_friction", {"amplitude": 2.0}, "force"),
    ("leakage", {"conductance": 5e-11}, "flow"),
    ("valve_dead_zone", {"width": 0.02}, "valve"),
    ("gravity", {"moment": 0.2}, "joint"),
]


@pytest.mark.parametrize("name, values, equation", CAUSES, ids=[c[0] for c in CAUSES])
def test_one_cause_is_named_located_and_closed(name, values, equation):
    d = diagnose(log_with((name, values)), NOMINAL, [*LIBRARY, "stribeck_friction", "pressure_bias", "diameter"])
    assert d.verdict in ("cause", "class") and d.p_value < 1e-3
    assert d.causes[0].effects[0] == name and d.candidates[0].effect == name
    assert d.equations[0].equation == equation == d.causes[0].equation
    for key, value in values.items():
        found = d.causes[0].parameters[key]
        assert found.value == pytest.approx(value, rel=0.15) and found.ci90[0] <= found.value <= found.ci90[1]
    closed = next(c for c in d.closure if c.equation == equation)
    assert closed.closed_share > 0.9 and closed.rmse_after < closed.rmse_before
    # the corrected simulator holds on runs that were not in the log
    future = simulate(ACTUAL.replace(effects=[(name, values)]), [sine(4, 12, 1500)], seed=9)
    nominal, corrected = (evaluate_log(future, p)[equation] for p in (NOMINAL, d.corrected))
    assert corrected.rmse < 0.5 * nominal.rmse


def test_two_causes():
    d = diagnose(
        log_with(("viscous_friction", {"coefficient": 20.0}), ("leakage", {"conductance": 1e-10})), NOMINAL, LIBRARY
    )
    assert d.verdict == "several"
    assert {c.effects[0] for c in d.causes} == {"viscous_friction", "leakage"}
    assert sum(c.share for c in d.causes) == pytest.approx(1.0, abs=0.1)


def test_a_cause_that_is_not_in_the_library_is_unknown():
    library = [name for name in all_effects() if name not in ("leakage", "heat_transfer", "flow_bias")]
    d = diagnose(log_with(("leakage", {"conductance": 1e-10})), NOMINAL, library)
    assert d.verdict == "unknown" and d.gap and not d.causes
    assert d.candidates[0].effect == "unknown" and d.equations[0].equation == "flow"
    assert d.corrected.effects == ()


def test_the_answer_is_json_and_the_same_for_a_seed():
    log = log_with(("leakage", {"conductance": 5e-11}))
    first, second = (diagnose(log, NOMINAL, LIBRARY, seed=3) for _ in range(2))
    assert first.to_json() == second.to_json()
    answer = json.loads(first.to_json())
    assert answer["schema"] == 1 and answer["verdict"] == "cause"
    assert sum(c["confidence"] for c in answer["candidates"]) == pytest.approx(1.0)
    assert {c["effect"] for c in answer["candidates"]} == {*LIBRARY, "none", "unknown"}
    assert set(answer["where"]) == {"equations", "regions", "bands", "trajectories", "events"}
    assert sum(e["share"] for e in answer["where"]["equations"]) == pytest.approx(1.0)
    table = state_table(log, NOMINAL)
    assert len(table) == len(log) and {"eps1", "deps2", "dP1", "dq"} <= set(table.columns)
    for region in answer["where"]["regions"]:
        assert 0 < len(table.query(region["query"])) < len(table)
    before = first.windows.query("equation == 'flow'")
    assert np.sqrt(np.mean(before["after"] ** 2)) < 1.3 * np.sqrt(np.mean(before["noise"] ** 2))


def test_the_order_of_trajectories_does_not_matter():
    log = log_with(("leakage", {"conductance": 5e-11}))
    names = list(dict.fromkeys(log["trajectory"]))
    turned = pd.concat([log[log["trajectory"] == n] for n in reversed(names)], ignore_index=True)
    a, b = (diagnose(x, NOMINAL, LIBRARY).causes[0] for x in (log, turned))
    assert a.effects == b.effects
    assert a.parameters["conductance"].value == pytest.approx(b.parameters["conductance"].value, rel=1e-6)


# --- logs that lack something ---------------------------------------------------------------------------------
def test_without_forces_the_rest_is_diagnosed_and_the_cost_is_said():
    log = log_with(("leakage", {"conductance": 5e-11})).drop(columns=["F1", "F2"])
    d = diagnose(log, NOMINAL, LIBRARY)
    assert d.causes[0].effects[0] == "leakage"
    assert any("F1" in note for note in d.notes)
    friction = next(c for c in d.candidates if c.effect == "coulomb_friction")
    assert friction.confidence == 0.0 and "no more than noise" in friction.ruled_out  # it would show in the motion


def test_one_trajectory_has_no_intervals():
    log = simulate(NOMINAL.replace(effects=[("leakage", {"conductance": 1e-10})]), [sine(5, 15, 3000)], seed=0)
    d = diagnose(log, NOMINAL, LIBRARY)
    assert d.causes[0].effects[0] == "leakage"
    low, high = d.causes[0].parameters["conductance"].ci90
    assert low == -math.inf and high == math.inf
    assert any("only one run" in note for note in d.notes)
    assert json.loads(d.to_json())["causes"][0]["parameters"]["conductance"]["ci90"] == [None, None]


def test_gaps_and_a_stuck_sensor_are_left_out():
    log = log_with(("gravity", {"moment": 0.2}))
    log.loc[100:160, "P1"] = np.nan
    log.loc[1300:1900, "mdot2"] = log.loc[1300, "mdot2"]
    d = diagnose(log, NOMINAL, LIBRARY)
    assert [c.effects[0] for c in d.causes] == ["gravity"]
    assert any("missing value" in note for note in d.notes) and any("mdot2 repeats" in note for note in d.notes)


def test_a_log_in_which_nothing_moves_is_refused():
    log = simulate(NOMINAL, [hold(0, 600)], seed=0)
    still = log.assign(q=0.0, P1=3e5, P2=3e5)
    with pytest.raises(ExcitationError, match="Hardly anything moves"):
        diagnose(still, NOMINAL)


def test_what_cannot_be_diagnosed_is_refused(clean):
    with pytest.raises(UnknownOptionError, match="no effect 'rust'"):
        diagnose(clean, NOMINAL, ["rust"])
    with pytest.raises(MissingColumnError, match="allows no equation"):
        diagnose(clean[["trajectory", "time", "q", "u1", "u2"]], NOMINAL)


def test_runs_that_begin_in_motion_are_said(clean):
    def said(log: pd.DataFrame) -> bool:
        return any("begin in motion" in note for note in notes_on(Evidence(log, NOMINAL)))

    rest = log_with()
    rest = rest[rest["trajectory"].str.startswith("step")]
    cut = clean.groupby("trajectory", sort=False).tail(900)
    assert said(cut) and not said(rest)


def test_no_tolerances_is_said(clean):
    d = diagnose(clean, NOMINAL.replace(tolerance={}), ["leakage"])
    assert any("no tolerances" in note for note in d.notes)


def test_what_is_searched_is_reported(clean):
    heard: list[str] = []
    diagnose(clean, NOMINAL, ["leakage"], progress=heard.append)
    assert heard[0] == "read the log" and any("leakage" in text for text in heard)


def test_every_effect_can_be_searched_alone(evidence):
    """No effect of the library breaks the search, whatever its parameters."""
    names = {"inertia", "heat_transfer", "pressure_lag", "end_cap"}
    outcome = Competition(evidence, sorted(names)).run()
    assert set(outcome.singles) <= names and not outcome.best.names
    for name in all_effects():
        effect = make_effect(name)
        assert np.all(np.isfinite(evidence.z({name: effect.values}))), name


@pytest.mark.parametrize("rate", [51_200.0, 50.0, 1.0 / 30.0])
def test_a_rhythm_is_found_at_any_rate(rate):
    """From an audio circuit to a tank that is read every half minute; samples lost between."""
    n, rng = 6000, np.random.default_rng(0)
    rows = np.flatnonzero(rng.random(n) < 0.9)
    t = rows / rate
    y = np.sin(2 * np.pi * 0.11 * rate * t) + rng.standard_normal(len(t))
    zero = np.zeros(len(t), int)
    found = _rhythm(y, SimpleNamespace(run=zero, side=zero, time=t), slice(0, len(t)))
    assert found["peak_hz"] == pytest.approx(0.11 * rate, rel=1e-3)
    assert found["peak_share"] == pytest.approx(1 / 3, rel=0.15)


def test_what_is_left_is_described():
    """A supply that pulsates: no effect of the library, a line at its frequency."""
    log = simulate(ACTUAL, RUNS, seed=1)
    filling = log["u1"].clip(lower=0) * np.sin(2 * np.pi * 7.0 * log["time"])
    d = diagnose(log.assign(mdot1=log["mdot1"] + 3e-4 * filling), NOMINAL, ["leakage", "valve_conductance"])
    assert d.verdict == "unknown"
    assert d.leftover["peak_hz"] == pytest.approx(7.0, abs=0.3) and d.leftover["peak_share"] > 0.1
    assert set(d.leftover) >= {"equation", "predictable_share", "depends_on", "formula", "formula_share"}
