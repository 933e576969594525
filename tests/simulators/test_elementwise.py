"""Functions of numbers that use max, min, float and math: asked at many instants at once, with the same answers."""

from __future__ import annotations

import math
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


@pytest.mark.parametrize("many", [1, 50])
def test_a_function_has_no_value_where_math_raises(many) -> None:
    simulator, (t, x, u, p) = asked(rooted)
    inside, at = np.abs(np.nan_to_num(x)), (t[:many], u[:, :many], p[:, :many])
    below = (at[0], -inside[:, :many] - 1.0, *at[1:])
    with pytest.raises(SimulatorRunError, match=r"rooted raised ValueError in line \d+: math domain error"):
        simulator.rate(*below)  # it never answered
    simulator.rate(t, inside, u, p)
    assert not np.isfinite(simulator.rate(*below)).all()
