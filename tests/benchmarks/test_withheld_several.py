"""Several effects at once in the withheld check: what is drawn, what each is of the gap, what is counted."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[2]
if not (ROOT / "benchmarks" / "withheld").is_dir():
    pytest.skip("needs the repository", allow_module_level=True)
sys.path.append(str(ROOT))

from benchmarks.withheld import generator, judge, oracle, report, several, suites  # noqa: E402
from benchmarks.withheld.catalogue import CONFUSABLE, VOCABULARY  # noqa: E402
from benchmarks.withheld.generator import Case, Spec  # noqa: E402


@pytest.fixture(scope="module")
def case() -> Case:
    targets = {"coulomb_friction": 12.0, "leakage": 6.0, "gravity": 12.0}
    return generator.generate([Spec("several", 0, (5, 5), "B", targets)], (2, 800))[0]


# --- what is drawn ------------------------------------------------------------------------------------------
def test_effects_are_drawn_in_turn_over_equations_and_within_one() -> None:
    home = {name: e for e, names in several.HOME.items() for name in names}
    assert set(home) == set(VOCABULARY)
    assert sum(map(len, several.HOME.values())) == len(VOCABULARY)
    listed = suites.specs("several", 60, 3)
    rivals = [set(pair) for pair in CONFUSABLE]
    for k, s in enumerate(listed):
        assert len(s.targets) == 3 + k // 2 % 3
        assert not any(pair <= set(s.targets) for pair in rivals)
        at = [home[n] for n in s.targets]
        if k % 2:
            assert max(at.count(e) for e in at) >= (len(at) + 1) // 2
        else:
            assert len(set(at)) >= 3
        strengths = np.array(list(s.targets.values()))
        assert strengths.max() <= several.APART**2 * strengths.min()
    assert listed[:5] == suites.specs("several", 5, 3)
    assert len({n for s in listed for n in s.targets}) > 30
    # A run that is stopped holds as many of each number of effects.
    assert [s for batch in suites.batches({"several": 60}, 3) for s in batch.specs] == listed


# --- what each is of the gap --------------------------------------------------------------------------------
def test_shares_are_of_the_equation_where_an_effect_is_most() -> None:
    floors = {"force": 2.0, "flow": 0.5, "valve": 1.0}
    whole = {"force": np.full((4, 2), 20.0), "flow": np.full((4, 2), 1.0), "valve": np.full((4, 2), 0.1)}
    own = {"force": np.full((4, 2), 2.0), "flow": np.full((4, 2), 0.5), "valve": np.full((4, 2), 0.1)}
    assert several.power(own, floors) == pytest.approx({"force": 8.0, "flow": 8.0, "valve": 0.08})
    assert several.share_of_gap(own, whole, floors) == pytest.approx(0.25)  # of the valve there is no gap
    assert several.part_of_all(own, whole, floors) == pytest.approx(16.08 / 832.08)
    quiet = {e: 1e-3 * c for e, c in whole.items()}
    assert several.share_of_gap(quiet, quiet, floors) == 1.0


def test_what_effects_leave_by_themselves_adds_up(case: Case) -> None:
    for equation, together in case.contributions.items():
        parts = sum(each[equation] for each in case.each.values())
        floor = case.key["floors"][equation]
        apart, size = np.sqrt(np.mean(np.square(together - parts))), np.sqrt(np.mean(np.square(together)))
        assert apart < 0.3 * size + 0.5 * floor, equation
    shares = {n: e["share"] for n, e in case.key["effects"].items()}
    assert shares["gravity"] > 0.5  # alone in its equation
    assert shares["leakage"] > 0.05
    assert all(e["part"] <= e["share"] for e in case.key["effects"].values())


def test_the_oracle_tells_what_leaving_an_effect_out_costs(case: Case) -> None:
    params = judge.simulator(case.sim_toml)
    found = oracle.oracle_each(case, params)
    assert set(found) == set(case.key["effects"])
    assert min(found.values()) > several.DECIDABLE
    twice = {**case.each, "twin": case.each["gravity"]}
    again = oracle.oracle_each(replace(case, each=twice), params)
    assert again["gravity"] < 0.0
    assert again["twin"] < 0.0
    assert again["leakage"] == pytest.approx(found["leakage"], abs=5.0)


def test_what_is_left_is_measured_on_unseen_trajectories(case: Case) -> None:
    before = judge.refitted(case, judge.simulator(case.sim_toml))
    assert judge.left_share(case, before, before) == 1.0
    friction = case.key["effects"]["coulomb_friction"]["parameters"]["a"]
    some = before.replace(effects=[("coulomb_friction", {"amplitude": friction})])
    assert judge.left_share(case, before, some) < 0.9
    assert judge.left_share(case, before, before.replace(effects=[("gravity", {"moment": 50.0})])) > 2.0


# --- what is counted ----------------------------------------------------------------------------------------
def result(index: int, said: list[list[str]], verdict: str = "several", left: float = 0.1, **true: float) -> dict:
    effects = {n: {"share": s, "part": s / 2} for n, s in true.items()}
    return {
        "name": f"several-{index:04d}",
        "key": {"name": f"several-{index:04d}", "suite": "several", "effects": effects},
        "oracle": 1000.0,
        "oracle_each": dict.fromkeys(true, 50.0) | {"faint": 2.0},
        "left": left,
        "answers": {},
        "diagnosis": {
            "verdict": verdict,
            "with_reserve": index == 2,
            "causes": [{"effects": names} for names in said],
            "remainder": {"share": 0.12} if said else {},
            "hypotheses": [{"effects": ["a", "b"], "gain": 997.0}, {"effects": ["z"], "gain": 3.0}],
        },
    }


def test_named_wrong_and_left_are_counted() -> None:
    results = [
        result(0, [["a"], ["b", "x"]], a=0.6, b=0.3, faint=0.02),  # all of at least a twentieth, one in a class
        result(1, [["a"], ["x"]], left=0.3, a=0.6, b=0.3, c=0.1),  # two missed, one name wrong
        result(2, [], "unknown", a=0.5, b=0.4, c=0.1),
    ]
    found = several.found(results)
    assert (found.value, found.n) == (pytest.approx(3 / 8), 8)
    wrong = several.wrong(results)
    assert (wrong.value, wrong.n) == (0.25, 4)
    assert several.whole(results).value == pytest.approx(1 / 3)
    assert several.unknown(results).value == pytest.approx(1 / 3)
    assert several.remainder_right(results).value == 0.5
    assert several.remainder_error(results).value == pytest.approx(0.1)
    # The best set without c is within three nats of all true forms; a and b are told.
    assert several.lead(results[1], "c") == pytest.approx(3.0)
    assert several.lead(results[1], "a") == pytest.approx(50.0)
    assert several.found(results, decidable=True).n == 6
    assert several.found(results, 0.2, of="part").n == 4


def test_the_table_has_a_column_for_each_number_of_effects() -> None:
    results = [result(k, [["a"]], a=0.6, b=0.3, c=0.1, **({"d": 0.1} if k > 1 else {})) for k in range(4)]
    text = report.report(results, "command")
    assert (
        "| figure | target | n | all (4) | 3 effects (2) | 4 effects (2) | over equations (2) | within one (2) |"
        in text
    )
    assert "| effects of ≥ 5 % of the gap of an equation, named | ≥ 85 % | 14 | 28.6 % " in text
    assert "false alarms" not in text
