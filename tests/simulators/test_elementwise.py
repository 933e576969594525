"""Functions of numbers that use max, min, float and math: asked at many instants at once, with the same answers."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum
from math import atan2 as turned

import numpy as np
import pytest

from pamid.errors import SimulatorRunError
from pamid.simulators import FunctionSimulator, Port
from pamid.simulators.elementwise import elementwise

TANK = [Port("q", "input", "m3/s"), Port("h", "state", "m"), Port("w", "state", "m/s")]
ASKED: list[int] = []
COUNT = 0


def flow(level, *, least=0.0):
    return math.sqrt(max(level, least))


def emptying(t, x, u, p):
    ASKED.append(1)
    slow = min([x.w, float(u.q), 0.3]) * turned(x.w, 2.0)
    return [(u.q - p.k * flow(x.h)) / p.A, slow + max(v * x.h for v in (1, 2))]


def kinds(t, x, u, p):
    return [float(x.h) if isinstance(p.k, float) else u.q, float("2")]


def counting(t, x, u, p):
    global COUNT
    COUNT += 1
    return [max(x.h, COUNT), x.w]


def plain(t, x, u, p):
    return [u.q - x.h, x.w]


def rooted(t, x, u, p):
    return [math.sqrt(x.h), x.w]


def asked(function, n=50):
    simulator = FunctionSimulator(function, TANK, {"k": 2.0, "A": 3.0})
    rng = np.random.default_rng(1)
    x, u = rng.normal(size=(2, n)), rng.normal(size=(1, n))
    x[:, 7] = [np.nan, 0.0]
    given = np.zeros(n), x, u, np.repeat([[2.0], [3.0]], n, axis=1)
    return simulator, given


def test_max_min_and_math_go_element_by_element() -> None:
    simulator, (t, x, u, p) = asked(emptying)
    found = simulator.rate(t, x, u, p)
    ASKED.clear()
    assert np.array_equal(simulator.rate(t, x, u, p), found, equal_nan=True) and len(ASKED) == 1
    assert simulator.at_once
    one_by_one = [np.ravel(simulator.rate(t[k : k + 1], x[:, [k]], u[:, [k]], p[:, [k]])) for k in range(50)]
    assert np.allclose(found, np.transpose(one_by_one), equal_nan=True)
    numbers = [FunctionSimulator(emptying, TANK, {"k": 2.0, "A": 3.0}).rate(t[:1], x[:, [k]], u[:, [k]], p[:, :1])
               for k in range(50)]  # fmt: skip
    assert np.allclose(found, np.hstack(numbers), equal_nan=True)


def test_what_is_neither_larger_nor_smaller_is_kept_as_python_keeps_it() -> None:
    def first(a, b):
        return max(a, b), min(a, b)

    a, b = np.array([np.nan, 1.0, 2.0, -0.0]), np.array([1.0, np.nan, 3.0, 0.0])
    many = elementwise(first)
    assert many is not None
    expected = np.array([first(*one) for one in zip(a, b, strict=True)]).T
    assert np.array_equal(np.array(many(a, b)), expected, equal_nan=True)
    assert many(1, 2) == (2, 1) and many([3], [1]) == ([3], [1])


def test_a_function_that_keeps_count_is_asked_one_by_one() -> None:
    simulator, given = asked(counting)
    simulator.rate(*given)
    assert not simulator.at_once


def test_a_number_is_still_known_as_one() -> None:
    simulator, (t, x, u, p) = asked(kinds)
    assert np.array_equal(simulator.rate(t, x, u, p), [x[0], np.full(50, 2.0)], equal_nan=True)


def test_only_functions_that_ask_for_numbers_are_made_anew() -> None:
    assert elementwise(plain) is None and elementwise(counting) is None and elementwise(np.sin) is None
    assert elementwise(rooted).__name__ == "rooted"


@dataclass(frozen=True)
class Edge:
    """A valve's edge, which is asked for in all the ways that classes have."""

    width: float

    @property
    def slope(self):
        return math.tan(self.width)

    @staticmethod
    def opening(w):
        return max(-1.0, min(1.0, w))

    @classmethod
    def usual(cls):
        return cls(math.pi / 5.0)


class Part:
    """What plants have in common."""

    def level(self, h):
        return math.sqrt(max(h, 0.0))


class Plant(Part):
    """A plant that is made of others."""

    edge = Edge(0.3)

    def __init__(self):
        self.inner = Edge(0.4)
        self.whole = self

    def rates(self, t, x, u, p):
        ASKED.append(1)
        opening = self.edge.opening(x.w) * self.inner.slope + Edge.usual().slope
        if opening < p.k * 0.3:
            return [u.q - opening * self.level(x.h), x.w + USUAL.slope]
        return [u.q, math.exp(-opening)]

    __call__ = rates


class Counted(Plant):
    """One that answers something else each time."""

    asked = 0

    def rates(self, t, x, u, p):
        self.asked += 1
        return [self.asked + math.sin(x.h), x.w]


class Way(Enum):
    """A class that has no others of its kind."""

    ON = 1

    def times(self, x):
        return self.value * math.cos(x)


USUAL, PLANT = Edge.usual(), Plant()


def of_objects(t, x, u, p):
    return PLANT.rates(t, x, u, p)


def by_name(t, x, u, p):
    return [Way.ON.times(x.h), x.w]


@pytest.mark.parametrize("function", [PLANT.rates, PLANT, of_objects])
def test_what_a_function_uses_of_classes_and_objects_goes_element_by_element(function) -> None:
    simulator, (t, x, u, p) = asked(function)
    found = simulator.rate(t, x, u, p)
    ASKED.clear()
    assert np.array_equal(simulator.rate(t, x, u, p), found, equal_nan=True)
    assert simulator.at_once and len(ASKED) <= 4  # three ways, one of them by the NaN
    one_by_one = [np.ravel(simulator.rate(t[k : k + 1], x[:, [k]], u[:, [k]], p[:, [k]])) for k in range(50)]
    assert np.allclose(found, np.transpose(one_by_one), equal_nan=True) and len(ASKED) >= 50
    assert type(PLANT) is Plant and type(PLANT.inner) is Edge and math.sqrt is PLANT.level.__globals__["math"].sqrt


def test_what_is_set_on_an_object_later_holds_at_many_instants_too() -> None:
    class Gain:
        k = 1.0

        def rates(self, t, x, u, p):
            return [self.k * math.sin(x.h), x.w]

    gain = Gain()
    gain.k = 2.0
    simulator, given = asked(gain.rates)
    before = simulator.rate(*given)
    gain.k = 3.0
    assert simulator.at_once and np.allclose(simulator.rate(*given)[0], 1.5 * before[0], equal_nan=True)


@pytest.mark.parametrize("function", [Counted().rates, by_name])
def test_what_cannot_be_made_anew_is_asked_one_by_one(function) -> None:
    simulator, given = asked(function)
    found = simulator.rate(*given)
    assert not simulator.at_once and found.shape == (2, 50) and np.isfinite(found[:, :7]).all()


@pytest.mark.parametrize("many", [1, 50])
def test_a_function_has_no_value_where_math_raises(many) -> None:
    simulator, (t, x, u, p) = asked(rooted)
    inside, at = np.abs(np.nan_to_num(x)), (t[:many], u[:, :many], p[:, :many])
    below = (at[0], -inside[:, :many] - 1.0, *at[1:])
    with pytest.raises(SimulatorRunError, match=r"rooted raised ValueError in line \d+: math domain error"):
        simulator.rate(*below)  # it never answered
    simulator.rate(t, inside, u, p)
    assert not np.isfinite(simulator.rate(*below)).all()
