"""Functions that branch on numbers are asked at many instants at once, and answer as they do one by one."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pamid.errors import SimulatorRunError
from pamid.simulators import FunctionSimulator, Port
from pamid.simulators.branches import Instants, ManyWaysError, Parting, by_branches

N = 1_000
PORTS = [Port("u", "input", "-"), Port("x", "state", "m"), Port("v", "state", "m/s")]


def friction(t, x, u, p):
    """Return rates with a branch in another."""
    if abs(x.v) < 0.1:
        force = 0.0 if abs(u.u) < 0.5 else u.u
    elif x.v > 0.0 and u.u < 1.0:
        force = u.u - 0.5
    else:
        force = u.u + 0.5
    return [x.v, force - p.k * x.x]


def stops(t, x, u, p):
    """Return rates by name, with built-in functions of numbers, a branch on time and one on a parameter."""
    force = max(min(u.u, 1.0), -1.0) if t > 0.5 else 0.0
    if p.k > 3.0 and not x.x < 0.0:
        force -= p.k * x.x
    return {"v": force, "x": x.v}


def roots(t, x, u, p):
    """Return rates with a function of `math` in a branch."""
    return [x.v, math.sqrt(u.u) if u.u > 0.0 else u.u]


def chosen(t, x, u, p):
    """Return rates with branches on what functions of numpy and max make of numbers."""
    opening = np.interp(u.u, [-1.0, 0.0, 1.0], [-0.5, 0.0, 1.0])
    force = np.where(opening > 0.2, u.u, opening)
    if opening < 0.0:
        return [x.v, force]
    return [x.v if max(force, x.x) > 1.0 else 0.0, force - p.k * x.x]


def counted(t, x, u, p):
    """Return rates with a loop whose length depends on the state, within a guard that catches errors."""
    try:
        n = 0
        while n < 5 and n < x.x:
            n += 1
    except Exception:
        n = -1
    return [x.v, float(n)]


def asked(function, n: int = N) -> tuple[FunctionSimulator, np.ndarray, np.ndarray]:
    """Return a simulator, its rates at many instants, and what the function says one by one."""
    rng = np.random.default_rng(5)
    x, u, t = rng.standard_normal((2, n)) * [[3.0], [0.3]], rng.standard_normal((1, n)), rng.random(n)
    simulator = FunctionSimulator(function, PORTS, {"k": 4.0}, form="ode")
    p = np.full((1, n), 4.0)
    single = [np.array(simulator.rate(t[k : k + 1], x[:, k : k + 1], u[:, k : k + 1], p[:, :1])) for k in range(n)]
    return simulator, simulator.rate(t, x, u, p), np.concatenate(single, axis=1)


@pytest.mark.parametrize("function", [friction, stops, roots, chosen, counted])
def test_many_instants_at_once_are_what_each_is(function):
    simulator, many, single = asked(function)
    assert many == pytest.approx(single, rel=1e-12)
    assert simulator.at_once


def test_a_function_is_asked_a_few_times_for_many_instants():
    calls = 0

    def rates(t, x, u, p):
        nonlocal calls
        calls += 1
        return friction(t, x, u, p)

    simulator, *_ = asked(rates)
    rng, n = np.random.default_rng(6), N - 1
    x, u = rng.standard_normal((2, n)), rng.standard_normal((1, n))
    counts = []
    for near in (x, x + 1e-9, rng.standard_normal((2, n))):
        calls = 0
        simulator.rate(np.zeros(n), near, u, np.full((1, n), 4.0))
        counts.append(calls)
    first, again, elsewhere = counts
    assert again < first < 20  # numbers near the last ones take the same branches
    assert elsewhere < 2 * 20


def test_a_branch_that_first_comes_later_is_taken_one_by_one():
    def rates(t, x, u, p):
        return [x.v, u.u if u.u < 5.0 else complex(u.u).real]

    rng = np.random.default_rng(7)
    simulator = FunctionSimulator(rates, PORTS, {"k": 4.0}, form="ode")
    x, u, p = rng.standard_normal((2, N)), rng.standard_normal((1, N)), np.full((1, N), 4.0)
    assert simulator.rate(np.zeros(N), x, u, p)[1] == pytest.approx(u[0])
    u[0, 17:20] = 6.0, 7.0, 8.0
    assert simulator.rate(np.zeros(N), x, u, p)[1] == pytest.approx(u[0])


def test_many_ways_of_a_function_without_a_value_somewhere_are_asked_one_by_one():
    def rates(t, x, u, p):
        n = 0
        while n < 400 and n < 100.0 * x.x:
            n += 1
        return [x.v, n + math.log(u.u)]

    rng = np.random.default_rng(8)
    simulator = FunctionSimulator(rates, PORTS, {"k": 4.0}, form="ode")
    x, u, p = rng.random((2, N)) * [[0.001], [1.0]], 1.0 + rng.random((1, N)), np.full((1, N), 4.0)
    assert simulator.rate(np.zeros(N), x, u, p)[1] == pytest.approx(1.0 + np.log(u[0]))
    x[0], u[0, 5] = 4.0 * rng.random(N), -1.0
    found = simulator.rate(np.zeros(N), x, u, p)[1]
    assert np.isnan(found[5]) and np.isfinite(np.delete(found, 5)).all()


def test_an_error_of_a_function_is_still_reported():
    def rates(t, x, u, p):
        if u.u > 0.0:
            raise RuntimeError("out of its range")
        return [x.v, u.u]

    with pytest.raises(SimulatorRunError, match="out of its range"):
        asked(rates)


def test_parts_take_the_same_ways_and_hold_all():
    x, seen = np.arange(20.0).view(Instants), []

    def ask(rows):
        part = x[rows]
        if part < 5.0 or part > 15.0:
            seen.append(np.asarray(part))
        else:
            seen.append(-np.asarray(part))

    assert len(by_branches(ask, 20, 20)) == 3
    assert sorted(np.abs(np.concatenate(seen))) == list(range(20))
    with pytest.raises(ManyWaysError):
        by_branches(ask, 20, 2)


def test_no_condition_is_parted_where_it_holds_throughout_or_nowhere():
    x = np.arange(3.0).view(Instants)
    assert (x >= 0.0) and not (x > 2.0)
    assert bool(x[:1] == 0.0)
    with pytest.raises(Parting):
        bool(x > 1.0)
    with pytest.raises(ValueError, match="ambiguous"):
        bool(np.ones((2, 2)).view(Instants))
