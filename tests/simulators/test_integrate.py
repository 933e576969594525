"""Runs that start from states near theirs are those that go from step to step."""

import numpy as np
import pytest

from pamid.effects.registry import all_effects
from pamid.simulators import FunctionSimulator, Port
from pamid.simulators.integrate import Runner
from pamid.simulators.placement import Placement, Scales

T, DT, RUNS = 500, 0.02, 3


def pendulum(gravity=9.81):
    ports = [Port("torque", "input", "N m"), Port("q", "state", "rad"), Port("dq", "state", "rad/s")]

    def rates(t, x, u, p):
        return [x.dq, u.torque - p.g * np.sin(x.q) - 1.5 * x.dq]

    return FunctionSimulator(rates, ports, {"g": gravity})


def given(seed=0):
    rng = np.random.default_rng(seed)
    t = np.repeat(DT * np.arange(T)[:, None], RUNS, axis=1)
    u = 4.0 * np.sin(2.0 * t + rng.uniform(0.0, 6.0, RUNS))[:, None, :]
    return t, rng.normal(0.0, 0.5, (2, RUNS)), u


def calls_of(simulator, run):
    """Return what a function returns, and how often it called the simulator."""
    rate, calls = simulator.rate, []
    simulator.rate = lambda *a: calls.append(1) or rate(*a)
    found = run()
    simulator.rate = rate
    return found, len(calls)


@pytest.mark.parametrize("lines", [False, True])
@pytest.mark.parametrize("substeps", [1, 3])
def test_states_near_a_run_lead_to_it_in_few_calls(lines, substeps):
    simulator, (t, x0, u) = pendulum(), given()
    p = np.full((1, RUNS), 9.81)
    runner = Runner(simulator, DT, (), substeps, lines)
    near = runner.states(t, x0 + 0.1, 0.9 * u, 1.2 * p)
    exact, often = calls_of(simulator, lambda: runner.states(t, x0, u, p))
    found, few = calls_of(simulator, lambda: runner.states(t, x0, u, p, near=near))
    assert np.max(np.abs(near - exact)) > 0.1
    np.testing.assert_allclose(found, exact, atol=1e-10)
    assert few < 0.3 * often


def test_an_effect_without_memory_is_part_of_it():
    simulator, (t, x0, u) = pendulum(), given()
    kind, follows = all_effects()["viscous_friction"], {"position": "q", "velocity": "dq"}
    place = Placement("viscous_friction@q", "viscous_friction", "q", kind, "input", "torque", follows, Scales())
    acting, p = [(place, place.made({"coefficient": 0.4}))], np.full((1, RUNS), 9.81)
    runner = Runner(simulator, DT)
    near = runner.states(t, x0, u, p)
    exact = runner.states(t, x0, u, p, acting)
    np.testing.assert_allclose(runner.states(t, x0, u, p, acting, near=near), exact, atol=1e-10)


@pytest.mark.parametrize("name", ["coulomb_friction", "hysteresis"])
def test_effects_that_remember_are_part_of_it(name):
    simulator, (t, x0, u) = pendulum(), given()
    follows = {"position": "q", "velocity": "dq"}
    place = Placement(f"{name}@q", name, "q", all_effects()[name], "input", "torque", follows, Scales())
    made = place.made({"amplitude": 0.4})
    p = np.full((1, RUNS), 9.81)
    runner = Runner(simulator, DT)
    near = runner.states(t, x0, u, p)
    exact, often = calls_of(simulator, lambda: runner.states(t, x0, u, p, [(place, made)]))
    found, few = calls_of(simulator, lambda: runner.states(t, x0, u, p, [(place, made)], near=near))
    assert made.n_states
    assert np.max(np.abs(near - exact)) > 0.05
    np.testing.assert_allclose(found, exact, atol=1e-9)
    assert few < 0.3 * often


def test_memory_near_a_run_is_found_without_a_loop_over_its_steps(monkeypatch):
    simulator, (t, x0, u) = pendulum(), given()
    kind, follows, steps = all_effects()["resonance"], {"position": "q", "velocity": "dq"}, []
    place = Placement("resonance@q", "resonance", "q", kind, "input", "torque", follows, Scales())
    made, step = place.made({"mass": 0.1, "frequency": 9.0, "damping": 0.1}), kind.step
    p = np.full((1, RUNS), 9.81)
    runner = Runner(simulator, DT)
    near = runner.states(t, x0, u, p)
    exact = runner.states(t, x0, u, p, [(place, made)])
    monkeypatch.setattr(kind, "step", lambda *a: steps.append(1) or step(*a))
    found = runner.states(t, x0, u, p, [(place, made)], near=near)
    assert np.max(np.abs(near - exact)) > 0.05
    np.testing.assert_allclose(found, exact, atol=1e-9)
    assert len(steps) < T / 2


@pytest.mark.parametrize(("stiffness", "damping", "substeps"), [(100.0, 5.0, 1), (1000.0, 10.0, 4)])
def test_runs_with_many_kinks_are_led_to_in_parts(stiffness, damping, substeps):
    """A mass that rattles between two stops, which damp only where it touches them."""
    ports = [Port("force", "input", "N"), Port("x", "state", "m"), Port("v", "state", "m/s")]

    def rates(t, x, u, p):
        beyond = x.x - np.clip(x.x, -0.1, 0.1)
        return [x.v, u.force - np.where(beyond != 0.0, stiffness * beyond + damping * x.v, 0.0)]

    simulator, (t, x0, u) = FunctionSimulator(rates, ports, {}), given()
    near, p, x0 = np.stack([0.01 * u[:, 0], 0.01 * u[:, 0]], axis=1), np.zeros((0, RUNS)), 0.1 * x0
    runner = Runner(simulator, DT, (), substeps)
    exact, often = calls_of(simulator, lambda: runner.states(t, x0, u, p))
    found, few = calls_of(simulator, lambda: runner.states(t, x0, u, p, near=near))
    np.testing.assert_allclose(found, exact, atol=1e-10)
    assert few < 0.5 * often


def test_what_no_such_round_reaches_is_run_step_by_step():
    ports = [Port("force", "input", "N"), Port("v", "state", "m/s")]
    stuck = FunctionSimulator(lambda t, x, u, p: [u.force - 40.0 * np.sign(x.v - 0.1)], ports, {})
    t, _, u = given()
    p, x0 = np.zeros((0, RUNS)), np.zeros((1, RUNS))
    runner = Runner(stuck, DT)
    exact = runner.states(t, x0, u, p)
    np.testing.assert_array_equal(runner.states(t, x0, u, p, near=np.zeros_like(exact)), exact)


def test_a_function_that_takes_one_instant_at_a_time_is_run_step_by_step():
    ports = [Port("force", "input", "N"), Port("v", "state", "m/s")]
    single = FunctionSimulator(lambda t, x, u, p: [float(f"{u.force - x.v:.17g}")], ports, {})
    t, _, u = given()
    p, x0 = np.zeros((0, RUNS)), np.zeros((1, RUNS))
    runner = Runner(single, DT)
    exact, often = calls_of(single, lambda: runner.states(t, x0, u, p))
    assert not single.at_once
    found, again = calls_of(single, lambda: runner.states(t, x0, u, p, near=exact))
    np.testing.assert_array_equal(found, exact)
    assert again == often


def test_many_runs_side_by_side_go_from_step_to_step():
    """A call for many runs takes as long as its arithmetic: all steps at once would take longer."""
    ports = [Port("force", "input", "N"), Port("v", "state", "m/s")]
    cart = FunctionSimulator(lambda t, x, u, p: [u.force - x.v], ports, {})
    rows, runs = 100, 1000
    t = np.repeat(DT * np.arange(rows)[:, None], runs, axis=1)
    at = t, np.zeros((1, runs)), np.ones((rows, 1, runs)), np.zeros((0, runs))
    runner = Runner(cart, DT)
    known = runner.states(*at)
    found, often = calls_of(cart, lambda: runner.states(*at, near=known))
    assert often == 4 * (rows - 1) and np.array_equal(found, known)
