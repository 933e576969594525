"""What a name must show: agreement of runs, the numbers that decide, trust fitted from cases, a learned remainder."""

import ast
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from benchmarks.withheld import trust
from pamid.bench import BenchParameters, simulate, sine
from pamid.gap import diagnose, settings
from pamid.gap.diagnosis import signs
from pamid.gap.diagnosis.agreement import agreement, over_rates
from pamid.gap.diagnosis.trusted import ALONE, BESIDE, SURE, TRUSTED
from pamid.gap.learned import learn, predict

NOMINAL = BenchParameters.for_muscle("B")
RUNS = [sine(2, 10, 600), sine(5, 12, 600), sine(8, 10, 600)]
LEAKING = simulate(NOMINAL.replace(effects=[("leakage", {"conductance": 2e-10})]), RUNS, seed=0)


@pytest.fixture(scope="module")
def leak():
    return diagnose(LEAKING, NOMINAL, ["leakage", "flow_bias", "coulomb_friction"])


def test_cochrans_q_is_that_of_the_books():
    # Five studies: effects and variances; Q and I² by hand.
    theta, variance = np.array([0.1, 0.3, 0.35, 0.65, 0.45]), np.array([0.03, 0.03, 0.05, 0.01, 0.05])
    h = 1.0 / variance
    mean = np.sum(h * theta) / h.sum()
    q = np.sum(h * (theta - mean) ** 2)
    found = agreement(h, h * theta)
    assert found.q == pytest.approx(q)
    assert found.i2 == pytest.approx(1.0 - 4.0 / q)
    assert found.spread**2 == pytest.approx((q - 4.0) / (h.sum() - np.sum(h**2) / h.sum()))


def test_runs_that_agree_have_no_spread_and_one_run_says_nothing():
    assert agreement(np.full(5, 400.0), np.zeros(5)).spread == 0.0
    rng = np.random.default_rng(0)
    chance = [agreement(np.array([90.0, 5.0, 5.0]), rng.normal(0.0, [9.5, 2.2, 2.2])) for _ in range(400)]
    assert 0.02 < np.mean([found.least > 0.0 for found in chance]) < 0.09
    assert np.mean([found.spread > 0.0 for found in chance]) > 0.3
    assert agreement(np.array([100.0]), np.array([3.0])).half == 1.0


def test_a_cause_is_held_against_those_of_its_own_equation():
    main = {"lag": 0, "leak": 1, "friction": 0}
    part_of = {"lag": 0.95, "leak": 0.001, "friction": 0.05}
    assert signs.beside(main, part_of) == pytest.approx({"lag": 0.95, "leak": 1.0, "friction": 0.05})


def test_at_most_twenty_five_numbers_decide():
    tree = ast.parse(Path(settings.__file__).read_text(encoding="utf-8"))
    plain = [
        node
        for assigned in tree.body
        if isinstance(assigned, ast.Assign)
        for node in (assigned.value.elts if isinstance(assigned.value, ast.Tuple) else [assigned.value])
        if isinstance(node, ast.Constant)
    ]
    assert 15 <= len(plain) <= 25


@pytest.mark.parametrize("module", ["decide", "belief", "open_set", "signs", "agreement"])
def test_no_number_that_decides_stands_elsewhere(module):
    path = Path(settings.__file__).parent / "diagnosis" / f"{module}.py"
    tree = ast.parse(path.read_text(encoding="utf-8"))
    named = [n for n in tree.body if isinstance(n, ast.Assign) and isinstance(n.value, ast.Constant)]
    named = [n for n in named if not isinstance(n.value.value, str)]
    assert {t.id for n in named for t in n.targets if isinstance(t, ast.Name)} <= {"LAGS", "OCTAVES", "STRETCHES"}


def test_every_sign_is_weighed_and_only_speaks_against_a_name(leak):
    conditions = {"unsupported", "unclosed_of_gap", "left_where_it_acts"}  # these decide by themselves
    assert set(ALONE) | conditions == set(BESIDE) | conditions == {"constant", *leak.signs}
    assert set(leak.signs) == set(leak.causes[0].signs)
    assert all(weight <= 0.0 for each in (ALONE, BESIDE) for name, weight in each.items() if name != "constant")
    assert 0.5 <= TRUSTED < 1.0
    assert all(0.0 <= v <= 1.0 for v in leak.signs.values())


def test_a_cause_that_is_not_trusted_is_left_to_the_remainder(monkeypatch):
    from pamid.gap.diagnosis import open_set

    both = NOMINAL.replace(effects=[("leakage", {"conductance": 2e-10}), ("viscous_friction", {"coefficient": 150.0})])
    log, library = simulate(both, RUNS, seed=1), ["leakage", "viscous_friction"]
    monkeypatch.setattr(open_set, "BESIDE", {"constant": 9.0})
    found = diagnose(log, NOMINAL, library)
    assert found.verdict == "several"
    closed = {c.equation: c.closed_share for c in found.closure}
    assert min(closed["force"], closed["flow"]) > 0.9
    # One of the two is said by chance, as it were; what it explains stays as it is.
    each = {c.effects[0]: c.signs for c in found.causes}
    sign = max(each["leakage"], key=lambda n: each["viscous_friction"][n] - each["leakage"][n])
    middle = 0.5 * (each["viscous_friction"][sign] + each["leakage"][sign])
    monkeypatch.setattr(open_set, "BESIDE", {"constant": 1e6 * middle, sign: -1e6})
    less = diagnose(log, NOMINAL, library)
    assert less.verdict == "cause"
    assert less.causes[0].effects == ("leakage",)
    assert {c.equation: c.closed_share for c in less.closure}["force"] < 0.1
    assert less.remainder["equation"] == "force"
    assert [name for name, _ in less.corrected.effects] == ["leakage"]


def test_a_true_cause_shows_no_sign_and_leads_the_hypotheses(leak):
    assert leak.verdict == "cause"
    assert leak.signs["left"] == leak.signs["undone"] == leak.signs["alike"] == 0.0
    assert leak.signs["disagreeing"] < 0.1
    first, *others = leak.as_dict()["hypotheses"]
    assert first["effects"] == ["leakage"]
    assert all(first["gain"] >= h["gain"] for h in others)


def test_a_gap_in_an_equation_without_any_cause_speaks_against_a_name(leak):
    both = NOMINAL.replace(effects=[("leakage", {"conductance": 2e-10}), ("gravity", {"moment": 1.0})])
    found = diagnose(simulate(both, RUNS, seed=1), NOMINAL, ["leakage", "flow_bias"])
    assert leak.signs["elsewhere"] == 0.0
    assert found.signs["elsewhere"] > 0.9
    assert 0.3 < {c.effect: c.confidence for c in found.candidates}["leakage"] < leak.causes[0].confidence - 0.2


@pytest.mark.parametrize(("constant", "reserve"), [(5.0, False), (0.5 * (TRUSTED + SURE), True)])
def test_a_name_that_is_not_sure_is_said_with_reserve(monkeypatch, constant, reserve):
    from pamid.gap.diagnosis import open_set
    from pamid.report import answers

    p = constant if constant < 1.0 else 1.0 / (1.0 + np.exp(-constant))
    monkeypatch.setattr(open_set, "ALONE", {"constant": float(np.log(p / (1.0 - p)))})
    found = diagnose(LEAKING, NOMINAL, ["leakage", "flow_bias"])
    assert found.verdict == "cause"
    assert found.with_reserve is reserve
    assert found.as_dict()["with_reserve"] is reserve
    assert ("or something that looks like it on this log" in answers(found).verdict) is reserve


def test_every_member_of_a_class_has_its_parameters_and_one_at_its_end_says_so():
    from pamid.report import answers, report_html

    nominal = NOMINAL.replace(tolerance={"rest_diameter": 0.005, "braid_angle": 0.005})
    log = simulate(nominal.replace(effects=[("polytropic_exponent", {"exponent": 1.36})]), RUNS, seed=3)
    cause = diagnose(log, nominal, ["polytropic_exponent", "dead_volume", "leakage"]).causes[0]
    assert len(cause.effects) == 1 + len(cause.others) == 2
    each = dict(zip(cause.effects, (cause.parameters, *cause.others), strict=True))
    assert each["polytropic_exponent"]["exponent"].value == pytest.approx(1.36, abs=0.02)
    assert each["dead_volume"]["volume"].value > 0.0

    isothermal = NOMINAL.replace(effects=[("polytropic_exponent", {"exponent": 1.0})])
    found = diagnose(simulate(isothermal, RUNS, seed=4), NOMINAL, ["polytropic_exponent"])
    parameters = found.causes[0].parameters
    assert parameters["exponent"].at_bound
    assert not parameters["skew"].at_bound
    assert "at its physical limit" in answers(found).which
    assert "at its physical limit" in report_html(found)


def test_slow_and_fast_changes_that_disagree_are_told():
    rng = np.random.default_rng(3)
    n = 4096
    source = SimpleNamespace(
        parts=[slice(0, n)], time=np.arange(n) * 0.02, side=np.zeros(n, int), run=np.repeat(np.arange(4), n // 4)
    )
    d = 30.0 * (np.sin(0.02 * np.arange(n)) + np.sin(1.9 * np.arange(n)))
    slow, noise = 30.0 * np.sin(0.02 * np.arange(n)), rng.standard_normal(n)
    assert over_rates(source, d, noise).spread < 0.02
    assert over_rates(source, d, noise - 0.5 * slow).spread > 0.1  # slow changes speak for half as much again


def test_weights_are_found_again_and_the_bar_holds_its_bound(monkeypatch):
    monkeypatch.setattr(trust, "RIDGE", 1e-3)
    rng = np.random.default_rng(0)
    S = np.column_stack([np.ones(2000), rng.random((2000, 2))])
    p = 1.0 / (1.0 + np.exp(-(S @ np.array([8.0, -16.0, 0.0]))))
    y = rng.random(2000) < p
    assert trust.fitted(S, y) == pytest.approx([8.0, -16.0, 0.0], abs=2.0)
    low = trust.bar(p, y, np.ones(2000))
    named = p >= low
    assert 0.3 < named.mean() < 0.9
    assert (np.sum(~y[named]) + 1) / named.sum() <= trust.ALPHA


def test_trust_is_measured_on_each_cause_by_itself():
    def case(name: str, suite: str, effects: dict[str, dict], causes: list[tuple[str, ...]], oracle: float) -> dict:
        told = [{"effects": c, "signs": {"left": 0.1}} for c in causes]
        key = {"suite": suite, "effects": effects, "name": name}
        return {"name": name, "key": key, "oracle": oracle, "diagnosis": {"causes": told, "hypotheses": []}}

    results = [
        case("single-0", "single", {"leakage": {}}, [("flow_bias", "leakage")], 100.0),
        case("pairs-0", "pairs", {"leakage": {}, "creep": {}}, [("creep",), ("end_cap",)], 100.0),
        case("pairs-1", "pairs", {"leakage": {}, "creep": {}}, [("creep",)], 1.0),
        case("off-library-0", "off-library", {"end_cap": {}}, [("end_cap",)], 100.0),
    ]
    found = [(c.result["name"], c.right) for c in trust.told(results) if c.decidable]
    assert found == [("single-0", True), ("pairs-0", True), ("pairs-0", False), ("off-library-0", False)]
    assert [c.right for c in trust.told(results) if not c.decidable] == [True]


def test_a_learned_remainder_predicts_other_runs_and_nothing_where_there_is_nothing():
    rng = np.random.default_rng(1)
    t, codes = np.tile(np.arange(0, 4, 0.01), 6), np.repeat(np.arange(6), 400)
    signals = {"position": np.sin(t * (1 + codes)), "velocity": (1 + codes) * np.cos(t * (1 + codes))}
    left = signals["position"] ** 2 * np.sign(signals["velocity"]) + 0.05 * rng.standard_normal(2400)
    model = learn(signals, left, codes, 0.01, seed=0)
    assert model["share"] > 0.5
    assert np.mean((left - predict(model, signals, codes, 0.01)) ** 2) < 0.5 * np.mean(left**2)
    nothing = learn(signals, rng.standard_normal(2400), codes, 0.01, seed=0)
    assert nothing["share"] < 0.02


def test_an_unknown_gap_still_shrinks():
    from pamid.estimators import GapDiagnoser

    rng = np.random.default_rng(2)
    t, run = np.tile(np.arange(0, 4, 0.005), 6), np.repeat(np.arange(6), 800)
    w = np.repeat([2.0, 4.0, 7.0, 9.0, 5.0, 3.0], 800)
    X = pd.DataFrame({"time": t, "eps": 0.1 + 0.05 * np.sin(w * t), "deps": 0.05 * w * np.cos(w * t)})
    y = 20 * np.sin(60 * X["eps"]) * np.cos(8 * X["deps"]) + 0.2 * rng.standard_normal(len(X))
    seen = run < 5
    error = {}
    for learned in (False, True):
        model = GapDiagnoser(random_state=0, learned_remainder=learned).fit(X[seen], y[seen], groups=run[seen])
        assert model.verdict_ == "unknown"
        assert bool(model.remainder_) is learned
        error[learned] = np.sqrt(np.mean((model.predict(X[~seen], groups=run[~seen]) - y[~seen]) ** 2))
    assert error[True] < 0.7 * error[False]
