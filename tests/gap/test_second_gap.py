"""A gap in a second equation is in the headline, and commands that were mixed up are told."""

import pytest

from pamid.bench import BenchParameters, simulate, sine
from pamid.equations import unit_doubts
from pamid.gap import diagnose
from pamid.report import answers

NOMINAL = BenchParameters.for_muscle("B")
RUBBING = simulate(NOMINAL, [sine(2, 10, 800), sine(6, 10, 800)], seed=0, effects=["viscous_friction"])
LIBRARY = ["viscous_friction", "valve_conductance", "leakage", "coulomb_friction"]


def mixed_up(how: str):
    u1, u2 = RUBBING["u1"], RUBBING["u2"]
    return RUBBING.assign(**{"turned": {"u1": -u1, "u2": -u2}, "swapped": {"u1": u2, "u2": u1}}[how])


@pytest.mark.parametrize("how", ["turned", "swapped"])
def test_a_broken_second_equation_is_in_the_headline(how: str) -> None:
    found = diagnose(mixed_up(how), NOMINAL, LIBRARY)
    assert found.causes[0].effects == ("viscous_friction",) and found.unexplained == ["valve"]
    assert found.as_dict()["unexplained"] == ["valve"]
    told = answers(found)
    assert told.verdict.endswith("; and a gap in the valve equation that the library does not explain")
    assert "valve" in told.where
    assert max(found.equations, key=lambda e: e.share).equation == "valve"
    words = {"turned": "u1 and u2 look like a signal of the opposite sign", "swapped": "look like each other's"}[how]
    assert any(words in note for note in found.notes)


def test_what_causes_explain_leaves_no_second_gap() -> None:
    found = diagnose(RUBBING, NOMINAL, LIBRARY)
    assert found.unexplained == [] and "library does not explain" not in answers(found).verdict


@pytest.mark.parametrize("channel", ["P", "mdot"])
def test_columns_of_the_other_muscle_are_told(channel: str) -> None:
    log = simulate(NOMINAL, [sine(2, 15, 800)], seed=0)
    one, two = f"{channel}1", f"{channel}2"
    doubts = unit_doubts(log.assign(**{one: log[two], two: log[one]}), NOMINAL)
    assert doubts and "each other's" in doubts[0] and one in doubts[0]
    assert unit_doubts(log, NOMINAL) == []
