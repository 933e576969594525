"""A gap in a second equation is in the headline, and commands that were mixed up are told."""

import numpy as np
import pandas as pd
import pytest

from pamid.bench import BenchParameters, simulate, sine
from pamid.equations import unit_doubts
from pamid.gap import diagnose, diagnose_simulator
from pamid.report import answers
from pamid.simulators import EquationSimulator, Port

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


@pytest.mark.slow
@pytest.mark.parametrize("sway", [0.005, 0.3])
def test_a_second_gap_at_ports_is_in_the_headline_and_hides_no_cause(sway: float) -> None:
    """A cart with friction, and a level that sways for no reason of the library."""
    ports = [Port("a", "input", "N"), Port("b", "input", "V"), Port("x", "state", "m"), Port("v", "state", "m/s"),
             Port("y", "state", "m")]  # fmt: skip
    given = EquationSimulator({"dx/dt": "v", "dv/dt": "a/2", "dy/dt": "5*b - y"}, ports, {})
    rng, t, x, v, y, rows = np.random.default_rng(0), np.arange(0.0, 6.0, 0.01), 0.0, 0.0, 0.0, []
    a, b = np.sin(1.3 * t) + 0.5 * np.sin(4.0 * t), np.cos(2.1 * t) + 0.4 * np.sin(5.0 * t)
    for push, drive in zip(a, b, strict=True):
        rows.append((x, v, y))
        for _ in range(10):
            v += 1e-3 * (push - 1.5 * v) / 2.0
            x += 1e-3 * v
            y += 1e-3 * (5.0 * drive - y)
    x, v, y = (np.array(rows) + [1e-5, 1e-4, 1e-4] * rng.standard_normal((len(t), 3))).T
    table = {"trajectory": "run", "time": t, "a": a, "b": b, "x": x, "v": v, "y": y + sway * np.sin(7.7 * t)}
    found = diagnose_simulator(pd.DataFrame(table), given, ["viscous_friction", "coulomb_friction"])
    assert [c.effects for c in found.causes] == [("viscous_friction",)] and found.unexplained == ["y"]
    assert answers(found).verdict.endswith("; and a gap in the rate of y that the library does not explain")
