"""The withheld check: its benches obey the nominal equations, effects enter where they should, figures are right."""

from __future__ import annotations

import json
import math
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

ROOT = Path(__file__).resolve().parents[2]
if not (ROOT / "benchmarks" / "withheld").is_dir():
    pytest.skip("needs the repository", allow_module_level=True)
sys.path.append(str(ROOT))

from benchmarks.withheld import generator, judge, metrics, novelty, regions, report, runner, suites  # noqa: E402
from benchmarks.withheld.catalogue import CONFUSABLE, FOREIGN, VOCABULARY, catalogue  # noqa: E402
from benchmarks.withheld.generator import Spec  # noqa: E402
from benchmarks.withheld.metrics import Answer, Truth  # noqa: E402
from benchmarks.withheld.strength import refit, residuals, rms  # noqa: E402
from pamid.effects import all_effects  # noqa: E402
from pamid.equations import evaluate_log  # noqa: E402

LAYOUT = (2, 500)
WHERE = {
    "friction": {"force"}, "hysteresis": {"force"}, "elasticity": {"force", "flow"}, "viscoelasticity": {"force"},
    "gas": {"flow", "valve"}, "valve": {"valve"}, "sensor": {"force", "flow", "valve", "joint"},
    "geometry": {"force", "flow"}, "load": {"joint"},
}  # fmt: skip
"""Equations in which a family may show most."""


def spec(index: int = 0, muscle: str = "B", **targets: float) -> Spec:
    return Spec("single" if targets else "none", index, (11, index), muscle, targets)


@pytest.fixture(scope="module")
def plain() -> list[generator._Draw]:
    return [generator.draw(spec(k, m), *LAYOUT) for k, m in enumerate("ABC")]


@pytest.fixture(scope="module")
def runs(plain):
    return generator.simulate(plain, False)


# --- the benches --------------------------------------------------------------------------------------------
def test_without_an_effect_force_gas_valve_and_joint_balance(plain, runs) -> None:
    for d, case in zip(plain, runs, strict=True):
        for run in case:
            clean, noisy = residuals(d.true(), run.clean), residuals(d.true(), run.noisy)
            for equation, left in clean.items():
                assert rms(left) < 0.1 * rms(noisy[equation] - left), equation


def test_the_energy_that_enters_is_the_energy_that_is_there(plain, runs) -> None:
    d, run = plain[1], runs[1][0].clean
    n = d.true()
    b2, k = generator.Plant([n], [], [0]).b2[0], generator.Plant([n], [], [0]).k[0]
    eps = n.eps0 + n.r / n.L0 * run.q[:, None] * np.array([1.0, -1.0])
    L = n.L0 * (1 - eps)
    V = k * (b2 * L - L**3)
    heat = n.gamma * n.R * n.T / (n.gamma - 1) * 0.5 * (run.mdot[:-1] + run.mdot_end[:-1]) * 1e-3
    work = 0.5 * (run.P[1:] + run.P[:-1]) * np.diff(V, axis=0)
    energy = run.P * V / (n.gamma - 1)
    gained = np.cumsum(heat - work, axis=0)
    assert np.ptp(energy) > 1.0
    np.testing.assert_allclose(energy[1:] - energy[0], gained, atol=2e-3 * np.ptp(energy))


def test_the_librarys_equations_find_the_noise_and_nothing_else() -> None:
    case = generator.generate([spec(4, "B")], (3, 1200))[0]
    offsets = case.key["offsets"]
    params = judge.simulator(case.sim_toml)
    true = params.replace(**{generator_long(k): params.get(generator_long(k)) * (1 + v) for k, v in offsets.items()})
    for equation, found in evaluate_log(case.log, true).items():
        assert 0.85 < found.rmse / case.key["floors"][equation] < 1.15, equation
    assert case.key["strength"] < 0.1


def generator_long(name: str) -> str:
    from benchmarks.withheld.quantities import LONG

    return LONG[name]


def test_at_amplitude_zero_nothing_is_changed(plain, runs) -> None:
    shapes = {
        name: {**cls().draw(np.random.default_rng(1), plain[0].simulator), "a": 0.0}
        for name, cls in catalogue().items()
        if not hasattr(cls, "key")
    }
    again = generator.simulate([replace(plain[0], shapes=shapes)], False)[0]
    for before, after in zip(runs[0], again, strict=True):
        np.testing.assert_allclose(after.clean.P, before.clean.P, rtol=1e-9)
        np.testing.assert_allclose(after.clean.F, before.clean.F, rtol=1e-9)
        np.testing.assert_allclose(after.clean.mdot, before.clean.mdot, atol=1e-12)


def test_every_effect_shows_where_it_belongs_and_stays_finite() -> None:
    draws = [generator.draw(spec(50 + k, "B", **{name: 5.0}), 2, 500) for k, name in enumerate(VOCABULARY)]
    for d in draws:
        if "valve_saturation" in d.shapes:  # a usual one shows only where a command is full
            d.shapes["valve_saturation"] |= {"a": 0.6, "sharp": 8.0}
    for d, case in zip(draws, generator.simulate(draws, False), strict=True):
        name = next(iter(d.shapes))
        found = generator._measure(d, case)
        assert np.isfinite(case[0].logged).all(), name
        assert found.total > 0.15, name
        assert found.equation in WHERE[VOCABULARY[name]], (name, found.net)


def test_strength_is_what_was_asked_for() -> None:
    asked = {"coulomb_friction": 4.0, "leakage": 0.5}
    cases = generator.generate([spec(k, "C", **{n: s}) for k, (n, s) in enumerate(asked.items())], LAYOUT)
    for case, (name, strength) in zip(cases, asked.items(), strict=True):
        assert case.key["effects"][name]["strength"] == pytest.approx(strength, rel=0.15)
        assert name not in case.sim_toml


def test_a_delay_is_not_whole_samples_and_really_delays() -> None:
    d = generator.draw(spec(9, "B", transport_delay=50.0), 1, 600)
    d.shapes["transport_delay"]["a"] = 3.4e-3
    run = generator.simulate([d], False)[0][0]
    whole = np.roll(run.clean.u, 4, axis=0)  # four samples late at a sample, three from 0.4 ms after it
    n = d.true()
    follow = residuals(n, replace(run.clean, u=whole))["valve"]
    assert rms(follow[2:]) < 0.02 * rms(residuals(n, run.clean)["valve"][2:])
    assert d.shapes["transport_delay"]["a"] % 1e-3 == pytest.approx(4e-4)


def test_with_much_heat_transfer_the_gas_is_isothermal() -> None:
    d = generator.draw(spec(12, "B", heat_transfer=50.0), 1, 600)
    d.shapes["heat_transfer"] |= {"a": 300.0, "own": 0.0, "forced": 0.0, "area": 0.0}
    run = generator.simulate([d], False)[0][0].clean
    n = d.true()
    isothermal = replace(n, gamma=1.0)
    assert rms(residuals(isothermal, run)["flow"]) < 0.05 * rms(residuals(n, run)["flow"])


def test_refit_finds_the_true_numbers(plain, runs) -> None:
    d = plain[2]
    found = refit(d.simulator, [r.clean for r in runs[2]])
    for name, value in d.offsets.items():
        assert found[name] == pytest.approx(value, abs=2e-4), name


# --- the suites ---------------------------------------------------------------------------------------------
def test_suites_have_seeds_of_their_own_and_every_name() -> None:
    listed = [s for b in suites.batches(suites.COUNTS, 3) for s in b.specs]
    assert len({s.entropy for s in listed}) == len(listed) == sum(suites.COUNTS.values())
    assert len({s.name for s in listed}) == len(listed)
    single = [s for s in listed if s.suite == "single"]
    assert {n for s in single for n in s.targets} == set(VOCABULARY)
    for name in VOCABULARY:
        strong = [s.targets[name] >= 1 for s in single if name in s.targets]
        assert 0.4 < np.mean(strong) < 0.6
    off = [s for s in listed if s.suite == "off-library"]
    assert {s.left_out[0] for s in off if s.left_out} == set(VOCABULARY)
    assert {n for s in off if not s.left_out for n in s.targets} == set(FOREIGN)
    assert suites.specs("single", 5, 3) == suites.specs("single", 600, 3)[:5]


def test_every_name_of_the_vocabulary_is_in_the_library() -> None:
    assert set(VOCABULARY) <= set(all_effects())
    assert not set(FOREIGN) & set(all_effects())
    assert {n for pair in CONFUSABLE for n in pair} <= set(VOCABULARY)


def test_the_generator_uses_nothing_of_the_librarys_physics() -> None:
    for file in (ROOT / "benchmarks" / "withheld").glob("*.py"):
        if file.stem in ("judge", "novelty", "oracle", "rivals", "runner", "report", "trust", "__main__"):
            continue
        assert "pamid" not in file.read_text(encoding="utf-8"), file.name


# --- figures ------------------------------------------------------------------------------------------------
def said(name: str = "none", sure: float = 0.9, **more) -> Answer:
    gap = name != "none"
    verdict = {"none": "none", "unknown": "unknown"}.get(name, "cause")
    confidence = {name: sure, "other": 1 - sure}
    return Answer(gap, verdict, confidence, causes=((name,),) if verdict == "cause" else (), **more)


def true(suite: str = "single", in_library: bool = True, **effects: float) -> Truth:
    return Truth(suite, effects, dict.fromkeys(effects, "f"), ("force",) if effects else (), in_library)


def test_wilson() -> None:
    assert metrics.wilson(0, 10) == pytest.approx((0.0, 0.27753), abs=1e-4)
    assert metrics.wilson(50, 100) == pytest.approx((0.40383, 0.59617), abs=1e-4)
    assert metrics.wilson(0, 0) == (0.0, 1.0)


def test_detection_and_names_are_counted() -> None:
    records = [
        (true("none"), said("none")),
        (true("none"), said("a")),
        (true(a=2.0), said("a", equation="force")),
        (true(a=2.0), said("b", equation="flow")),
        (true(a=0.5), said("none")),
        (true(a=0.05), said("none")),  # too weak to count
    ]
    assert metrics.false_alarms(records).value == 0.5
    found = metrics.detected(records)
    assert (found.value, found.n) == (pytest.approx(2 / 3), 3)
    assert metrics.located(records).value == 0.5
    assert metrics.first(records, 1.0).value == 0.5
    assert metrics.first(records, 0.15, 1.0).value == 0.0
    assert metrics.first_three([(true(a=2.0), replace(said("b"), confidence={"b": 0.6, "a": 0.4}))]).value == 1.0
    assert metrics.in_class(records).value == 0.5
    assert metrics.class_size([(true(a=1.0), replace(said("a"), causes=(("a", "b"),)))]).value == 2.0
    assert math.isnan(metrics.both(records).value)


def test_pairs_and_off_library_are_counted() -> None:
    two = true("pairs", a=2.0, b=2.0)
    records = [
        (two, replace(said("a"), verdict="several", causes=(("a",), ("b", "c")))),
        (two, said("a")),
        (two, said("unknown")),
        (true("off-library", False, a=2.0), said("b")),
        (true("off-library", False, a=2.0), said("unknown")),
    ]
    assert metrics.both(records).value == pytest.approx(1 / 3)
    assert metrics.one_of_two(records).value == pytest.approx(2 / 3)
    assert metrics.off_library_named(records).value == 0.5
    assert metrics.correct(two, said("b"))
    assert not metrics.correct(records[3][0], said("a"))


def test_calibration() -> None:
    assert metrics.calibration_error(np.array([0.95, 0.95]), np.array([1.0, 0.0])) == pytest.approx(0.45)
    assert metrics.calibration_error(np.array([0.75, 0.75, 0.75, 0.75, 0.25]), np.array([1, 1, 1, 0, 0.25])) == 0.0
    assert metrics.ece([(true(a=2.0), said("a", 0.8)), (true("none"), said("none", 0.8))]).value == pytest.approx(0.2)


def test_closure_is_counted_for_right_and_wrong_causes() -> None:
    families = {"a": "f", "b": "g"}
    closing = {"predicted": 0.9, "interval": (0.8, 0.96), "families": families}
    records = [
        (true(a=2.0), said("a", realised=0.94, **closing)),
        (true(a=2.0), said("a", realised=0.98, **closing)),
        (true(a=2.0), said("b", realised=0.1, **closing)),
        (true(a=0.5), said("a", realised=0.0, **closing)),  # quiet: its share is mostly chance
    ]
    assert metrics.closed(records).value == pytest.approx(0.96)
    assert metrics.misjudged(records).value == pytest.approx(0.08)
    assert metrics.covered(records).value == pytest.approx(1 / 3)
    assert metrics.wrong_family(records).value == pytest.approx(0.1)


def test_matrices_transpose_each_other() -> None:
    records = [(true(a=1.0), said("a")), (true(a=1.0), said("b")), (true("none"), said("b"))]
    assert metrics.confusion(records) == {"a": {"a": 1, "b": 1}, "none": {"b": 1}}
    assert metrics.inversion(records) == {"a": {"a": 1}, "b": {"a": 1, "none": 1}}


def test_regions_agree_with_where_the_energy_is() -> None:
    contribution = np.zeros((10, 2))
    contribution[:4, 0] = contribution[6:, 1] = 1.0
    table = pd.DataFrame({"eps1": np.linspace(0, 1, 200), "q": 1.0})
    table["eps2"] = 1 - table["eps1"]
    centres = np.arange(10) * 20 + 10

    def score(*queries: str) -> float:
        return regions.agreement(table, queries, centres, regions.true_region(contribution, 1.0))

    assert regions.true_region(contribution[:, 0], 1.0).sum() == 4
    assert score("eps1 < 0.4") == score("eps1 < 0.2", "eps1 >= 0.2 and eps1 < 0.4") == 1.0
    assert score("eps1 < 0.4", "eps2 < 0.4") == 1.0
    assert score("eps2 < 0.4 and eps1 > 2") == 0.0
    assert score("eps1 >= 0.4") == 0.0
    assert score("q > 0") == score() == pytest.approx(2 * 4 / (10 + 4))


def test_amplitudes_are_compared_where_they_mean_the_same() -> None:
    key = {"effects": {"force_bias": {"parameters": {"a": 2.0, "sign": -1.0}}}}
    cause = {"effects": ["force_bias"], "parameters": {"offset": {"value": -2.1, "ci90": [-2.3, -1.9]}}}
    assert judge.amplitude_covered({"causes": [cause]}, key) is True
    cause["parameters"]["offset"]["ci90"] = [1.9, 2.3]
    assert judge.amplitude_covered({"causes": [cause]}, key) is False
    assert judge.amplitude_covered({"causes": [{**cause, "effects": ["length"]}]}, key) is None


# --- running it ---------------------------------------------------------------------------------------------
class Stub:
    """A diagnosis that says what it was told, for the parts of the check that do not depend on how it is made."""

    def __init__(self, params) -> None:
        self.corrected = params

    def as_dict(self) -> dict:
        where = {"equations": [{"equation": "joint", "share": 1.0}], "regions": [], "bands": [], "trajectories": []}
        return {
            "schema": 1, "gap": True, "p_value": 0.01, "verdict": "cause", "where": where,
            "candidates": [
                {"effect": "gravity", "confidence": 0.8}, {"effect": "none", "confidence": 0.1},
                {"effect": "unknown", "confidence": 0.1},
            ],
            "causes": [{"effects": ["gravity"], "equation": "joint"}],
            "closure": [{"equation": "joint", "closed_share": 0.5, "ci90": [0.4, 0.6]}],
        }  # fmt: skip


def test_a_stopped_run_goes_on_to_the_same_result(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(runner, "ours", lambda log, params, effects, seed: Stub(params))
    monkeypatch.setattr("benchmarks.withheld.judge.state_table", lambda log, params: log)
    batch = suites.Batch("b", (spec(0, "B", gravity=3.0), spec(1, "A")), (2, 500))
    runner.run([batch], tmp_path, 1, rivals=False)
    before = {p.name: json.loads(p.read_text()) for p in tmp_path.glob("*.json")}
    assert len(before) == 2
    (tmp_path / "single-0000.json").unlink()
    runner.run([batch], tmp_path, 1, rivals=False)
    after = {p.name: json.loads(p.read_text()) for p in tmp_path.glob("*.json")}
    for result in (*before.values(), *after.values()):
        assert "error" not in result, result.get("traceback")
        result["answers"]["ours"].pop("seconds")
    assert before == after
    listed = runner.records([json.loads((tmp_path / "single-0000.json").read_text())], "ours")
    assert metrics.first(listed, 1.0).value == metrics.located(listed).value == 1.0
    assert listed[0][1].realised < 0  # the stub does not even refit the nominal numbers


def test_the_diagnosis_passes_a_very_short_check() -> None:
    asked = [spec(0, "B"), spec(1, "C", leakage=20.0)]
    results = [runner.examine(case, runner.ours, rivals=False) for case in generator.generate(asked, (3, 1200))]
    for result in results:
        assert "error" not in result, result.get("traceback")
        assert result["out_of_form"] == []
    listed = runner.records(results, "ours")
    assert metrics.false_alarms(listed).value == 0.0
    assert metrics.detected(listed).value == metrics.located(listed).value == 1.0
    assert metrics.first(listed, 1.0).value == 1.0
    assert metrics.closed(listed).value > 0.9
    assert "| right effect first: effect ≥ 1 × the floor | ≥ 99 % | 1 | 100.0 %" in report.table(results)


def test_a_diagnosis_that_raises_counts_as_wrong() -> None:
    def raises(*_: object) -> None:
        raise ValueError("no")

    case = generator.generate([spec(0, "B")], (2, 700))[0]
    result = runner.examine(case, raises, rivals=False)
    assert "ValueError" in result["error"]
    assert metrics.false_alarms(runner.records([result], "ours")).value == 1.0


def test_form_is_checked() -> None:
    good = Stub(None).as_dict()
    assert judge.checked(good) == []
    assert judge.checked({**good, "verdict": "none"}) == ["gap True with verdict none"]
    assert judge.checked({**good, "candidates": good["candidates"][:2]})[0].startswith("candidates lack")


# --- rivals for the open set --------------------------------------------------------------------------------
def test_rivals_for_the_open_set_know_what_they_have_seen() -> None:
    rng = np.random.default_rng(0)
    names = list(VOCABULARY)[:6]
    place = {name: 4.0 * rng.standard_normal(12) for name in [*names, "foreign"]}

    def case(k: int, name: str, left_out: tuple[str, ...] = ()) -> dict:
        key = {"effects": {name: {}}, "left_out": left_out}
        return {"name": f"{k}", "key": key, "signature": [*(place[name] + 0.2 * rng.standard_normal(12))]}

    learned = novelty.known([case(k, names[k % 6]) for k in range(180)] + [case(999, "foreign")])
    assert len(learned) == 180
    asked = [case(k, names[k % 6]) for k in range(30)] + [case(k, "foreign") for k in range(30, 45)]
    asked += [case(k, names[k % 6], (names[k % 6],)) for k in range(45, 60)]
    said = novelty.judged(learned, asked)
    for method in novelty.METHODS:
        verdicts = [said[r["name"]][method]["verdict"] for r in asked]
        assert verdicts[:30].count("unknown") <= 6, method
        assert verdicts[30:].count("unknown") >= 25, method
    heads = [said[r["name"]]["conformal test"]["causes"] for r in asked[:30]]
    assert all(h in ((), ((next(iter(r["key"]["effects"])),),)) for h, r in zip(heads, asked, strict=False))
