"""How firmly a name stands in somebody's own simulator, and that a set holds one law once."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from pamid.effects.dry_friction import CoulombFriction, StribeckFriction
from pamid.gap.diagnosis import open_set
from pamid.gap.inference.competition import Competition
from pamid.gap.inference.sensitivity import root_of
from pamid.gap.inference.subsets import Subsets


@pytest.mark.parametrize(
    ("left", "grade", "closes"),
    [(0.001, "sure", True), (0.24, "reserve", True), (0.26, "family", True), (0.6, "family", False)],
)
def test_a_name_halves_the_error_or_is_one_of_a_family(
    left: float, grade: str, closes: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    doubtful = {"left": 1.0} if left > 0.01 else {}
    signs = dict.fromkeys(open_set.ALONE, 0.0) | doubtful
    signs |= {"left_where_it_acts": left, "unclosed_of_gap": left, "unsupported": 0.0}
    monkeypatch.setattr(open_set, "signs_of", lambda *_: {"drag@x": signs})
    monkeypatch.setattr(open_set, "taken_back", lambda *_: {})
    competition = SimpleNamespace(evidence=SimpleNamespace(exact=False, simulates=True))
    outcome = SimpleNamespace(best=SimpleNamespace(fit=SimpleNamespace(spec={"drag@x": {}})))
    found = open_set.trust(competition, outcome, {}, {})["drag@x"]
    assert (found.grade, found.closes) == (grade, closes)
    assert (found.probability >= open_set.TRUSTED) == (grade != "family")


def test_dry_friction_and_its_breakaway_are_one_law_at_a_joint() -> None:
    assert root_of("stribeck_friction@j2", StribeckFriction) == root_of("coulomb_friction@j2", CoulombFriction)
    assert root_of("stribeck_friction@j2", StribeckFriction) != root_of("coulomb_friction@j1", CoulombFriction)
    assert root_of("lag (second order)@u", None) == "lag@u"


def test_of_sets_as_likely_as_each_other_the_one_that_fits_best_stands_for_them() -> None:
    """A lag of which the form may be inexact scores as a delay does that leaves the noise alone."""

    def of(name: str, score: float, plain: float) -> SimpleNamespace:
        return SimpleNamespace(names=frozenset({name}), score=score, plain=plain)

    lag, delay, worse = of("lag", 102.3, 108.2), of("delay", 101.8, 127.8), of("compliance", 98.5, 130.0)
    search = Competition.__new__(Competition)
    search._ranked = lambda h: (True, h.score)  # type: ignore[method-assign]
    search._done = {h.names: h for h in (lag, delay, worse)}  # type: ignore[misc]
    assert search._plainest(lag) is delay and search._plainest(delay) is delay
    delay.plain = 109.0
    assert search._plainest(lag) is lag


def test_pairs_of_the_best_effects_are_scored_from_either() -> None:
    roots = ["coulomb_friction@j", "coulomb_friction@j", "actuator_gain@u", *(f"lag@{k}" for k in range(20))]
    library = Subsets.__new__(Subsets)
    library.library = [SimpleNamespace(root=root) for root in roots]  # type: ignore[misc]
    singles = [SimpleNamespace(templates=(k,), score=-float(k)) for k in range(len(roots))]
    pairs = {(parent.templates[0], t) for parent, t in library._both_ways(singles)}  # type: ignore[arg-type]
    assert {(0, 2), (2, 0), (1, 2), (2, 1)} <= pairs  # whichever comes first
    assert not {(0, 1), (1, 0)} & pairs and max(map(max, pairs)) < 10  # one law twice, or one of the worse effects
