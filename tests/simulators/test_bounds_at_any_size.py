"""What bounds an effect by the sizes of a log leaves room between the bounds, whatever unit a signal has."""

import numpy as np
import pandas as pd
import pytest

from pamid.effects import Parameter
from pamid.effects.values import MOST_PERIODS
from pamid.gap.simulated import evidence_of
from pamid.simulators import FunctionSimulator, Port
from pamid.simulators.catalogue import placements
from pamid.systems.joint import Joint

T = np.arange(0.0, 8.0, 0.02)
TANK = FunctionSimulator(
    lambda t, x, u, p: [(u.u - p.a * x.h) / p.A],
    [Port("u", "input", "V"), Port("h", "state", "m")],
    {"a": (0.5, 0.05, ""), "A": (2.0, 0.05, "")},
)
RAIL = FunctionSimulator(
    lambda t, x, u, p: [x.v, u.F / p.m],
    [Port("F", "input", "N"), Port("x", "state", "m"), Port("v", "state", "m/s")],
    {"m": (2.0, 0.05, "kg")},
)
ARM = FunctionSimulator(
    lambda t, x, u, p: [x.w, u.M / p.J],
    [Port("M", "input", "N m"), Port("q", "state", "rad"), Port("w", "state", "rad/s")],
    {"J": (2.0, 0.05, "kg m^2")},
)
TRAIN = FunctionSimulator(
    lambda t, x, u, p: [x.w1, x.w2, (u.M - p.k * (x.q1 - x.q2)) / p.J, p.k * (x.q1 - x.q2) / p.J],
    [Port("M", "input", "N m"), *(Port(n, "state", "rad") for n in ("q1", "q2")),
     *(Port(n, "state", "rad/s") for n in ("w1", "w2"))],
    {"J": (0.5, 0.05, "kg m^2"), "k": (8.0, 0.05, "N m/rad")},
)  # fmt: skip


def sizes_of(simulator):
    columns = {p.name: np.sin((1.0 + 0.1 * k) * T) + 0.1 for k, p in enumerate(simulator.ports)}
    moves = ("x", "v"), ("q", "w"), ("q1", "w1"), ("q2", "w2")
    columns |= {v: np.gradient(columns[q], T) for q, v in moves if v in columns}
    noisy = {n: x + 1e-4 * np.random.default_rng(0).standard_normal(len(T)) for n, x in columns.items()}
    return evidence_of(pd.DataFrame({"trajectory": "a", "time": T, **noisy}), simulator).sizes


@pytest.mark.parametrize("simulator", [TANK, RAIL, ARM, TRAIN], ids=["tank", "rail", "arm", "train"])
def test_bounds_never_cross(simulator) -> None:
    sizes = sizes_of(simulator)
    for size in 10.0 ** np.arange(-12, 13, 2.0):
        for pace in (1e-4, 1.0, 1e5):
            scaled = {n: {k: v * size for k, v in getattr(sizes, n).items()} for n in ("spans", "tops", "lows", "gaps")}
            here = sizes._replace(**scaled, run_length=sizes.run_length * pace, interval=sizes.interval * pace)
            for key, place in placements(simulator, here).items():
                for p in place.effect.parameters:
                    assert p.lower < p.upper and p.lower <= p.nominal <= p.upper, f"{key} {p} at {size:g}, {pace:g}"
                place.effect()


@pytest.mark.parametrize("span", [1e-9, 5e-6, 0.3, 700.0, 3e4, 1e12])
def test_periods_are_those_that_a_range_resolves(span: float) -> None:
    p = Parameter("rate", "1/rad", 1e-2, 1e6, 10.0, "periods in 2π of the position", periods=True).over(span)
    assert (p.lower, p.upper) == pytest.approx((2 * np.pi / span, MOST_PERIODS * 2 * np.pi / span))
    assert p.lower < p.nominal < p.upper


def test_periods_of_what_turns_round_are_whole_in_a_turn_beyond_those_of_its_range() -> None:
    p = Parameter("rate", "1/deg", 1e-2, 1e6, 10.0, "periods in 2π of the position", periods=True)
    once = 2 * np.pi / 360.0
    rates = np.array(p.over(36_000.0, turn=360.0).resolved())
    fast = rates[rates > MOST_PERIODS * once / 100]
    assert fast == pytest.approx(once * np.arange(1, MOST_PERIODS + 1))
    within = p.over(300.0, turn=360.0)
    assert within == p.over(300.0) and np.max(within.resolved()) < within.upper


@pytest.mark.parametrize("turns", [1e-7, 1.0, 1e6])
def test_a_joint_of_any_travel_has_periods(turns: float) -> None:
    log = pd.DataFrame({"trajectory": "a", "time": T, "q": turns * np.sin(T), "drive": np.sin(1.3 * T)})
    evidence = evidence_of(log, Joint(inertia=0.1))
    (rate,) = [p for p in evidence.effects["periodic_force"].parameters if p.periods]
    assert rate.lower < rate.nominal < rate.upper
    ripple = {"sine": 1.0, "cosine": 0.0, "rate": rate.nominal}
    (found,) = evidence.corrected({"periodic_force": ripple}).effects
    assert found.name == "periodic_force"
