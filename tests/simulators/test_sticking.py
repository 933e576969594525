"""Dry friction in steps that are long beside the distance within which it turns over."""

import numpy as np
import pytest

from pamid.effects.registry import all_effects
from pamid.simulators import FunctionSimulator, Port
from pamid.simulators.integrate import Runner
from pamid.simulators.placement import Placement, Scales

MASS, DAMPING, DT, T = 12.0, 30.0, 0.02, 500


def block():
    ports = [Port("F", "input", "N"), Port("x", "state", "m"), Port("v", "state", "m/s")]
    return FunctionSimulator(lambda t, x, u, p: [x.v, (u.F - DAMPING * x.v) / MASS], ports, {})


def friction(name="coulomb_friction", joint=("x", "v", "F"), **values):
    position, velocity, force = joint
    follows = {"position": position, "velocity": velocity}
    place = Placement(f"{name}@{position}", name, position, all_effects()[name], "input", force, follows, Scales())
    return place, place.made({"presliding": 1e-6, **values})


def drive(seed=0):
    """Return times and a force that stops a block, holds it, and turns it without holding it."""
    t = DT * np.arange(T)[:, None]
    rng = np.random.default_rng(seed)
    steps = np.repeat(rng.uniform(-45.0, 45.0, T // 25 + 1), 25)[:T, None]
    return t, steps[:, None, :]


def held_exactly(force, level, parts=2000):
    """Return the block's position under friction of one size, in steps so short that they need no solution."""
    x, v, h, out = 0.0, 0.0, DT / parts, [0.0]
    for u in force[:-1]:
        for _ in range(parts):
            free = (v + h * u / MASS) / (1.0 + h * DAMPING / MASS)
            held = h * level / MASS / (1.0 + h * DAMPING / MASS)
            v = np.sign(free) * max(abs(free) - held, 0.0)
            x += h * v
        out.append(x)
    return np.array(out)


def test_a_block_stops_and_turns_where_it_does_in_steps_a_thousand_times_shorter():
    (t, u), none = drive(), np.zeros((0, 1))
    run = Runner(block(), DT).states(t, np.zeros((2, 1)), u, none, [friction(amplitude=20.0)])
    exact = held_exactly(u[:, 0, 0], 20.0)
    assert np.max(np.abs(run[:, 0, 0] - exact)) < 1e-3 * np.ptp(exact)
    held = np.abs(u[:, 0, 0]) < 19.0
    later = held & np.roll(held, 5) & np.roll(held, 10)  # a block that was fast needs some steps to stop
    assert later.sum() > 50 and np.median(np.abs(run[later, 1, 0])) < 1e-4


@pytest.mark.parametrize("name, values", [
    ("coulomb_friction", {"amplitude": 20.0, "exponent": 0.0}),
    ("coulomb_friction", {"amplitude": 20.0, "transition": 1e-3}),
    ("stribeck_friction", {"coulomb": 12.0, "breakaway": 6.0, "velocity": 0.05}),
    ("directional_friction", {"forward": 20.0, "backward": 8.0}),
])  # fmt: skip
def test_every_form_of_friction_comes_to_what_short_steps_come_to(name, values):
    (t, u), none, some = drive(1), np.zeros((0, 1)), slice(0, 60)
    acting = [friction(name, **{**values, "presliding": 1e-5})]
    coarse, fine = (
        Runner(block(), DT, (), parts).states(t[some], np.zeros((2, 1)), u[some], none, acting) for parts in (1, 10)
    )
    # What changes within a step, as the breakaway part does, is taken at its end.
    assert np.max(np.abs(coarse[:, 0] - fine[:, 0])) < 1e-2 * np.ptp(fine[:, 0])


def test_joints_that_push_each_other_are_held_together():
    ports = [
        Port("F", "input", "N"), Port("G", "input", "N"), Port("x", "state", "m"), Port("v", "state", "m/s"),
        Port("y", "state", "m"), Port("w", "state", "m/s"),
    ]  # fmt: skip
    inverse = np.linalg.inv([[12.0, 4.0], [4.0, 3.0]])

    def rates(t, x, u, p):
        a = u.F - 30.0 * x.v, u.G - 10.0 * x.w
        return [x.v, inverse[0, 0] * a[0] + inverse[0, 1] * a[1], x.w, inverse[1, 0] * a[0] + inverse[1, 1] * a[1]]

    simulator, (t, force), none = FunctionSimulator(rates, ports, {}), drive(2), np.zeros((0, 1))
    u = np.concatenate([force, 0.4 * drive(3)[1]], axis=1)[:80]
    u[30:] *= 0.2  # both come to rest
    acting = [friction(amplitude=15.0), friction(joint=("y", "w", "G"), amplitude=5.0)]
    coarse, fine = (
        Runner(simulator, DT, (), parts).states(t[:80], np.zeros((4, 1)), u, none, acting) for parts in (1, 10)
    )
    for row in (0, 2):
        assert np.max(np.abs(coarse[:, row] - fine[:, row])) < 2e-2 * np.ptp(fine[:, row])
    assert np.max(np.abs(coarse[:40, [1, 3]])) > 0.1 and np.max(np.abs(coarse[-10:, [1, 3]])) < 1e-4


def test_what_holds_leaves_no_speed_at_rest_and_all_of_it_in_motion():
    acting, runner = [friction(amplitude=20.0)], Runner(block(), DT)
    x = np.array([[0.3, 0.3], [0.0, 0.5]])
    memory = [np.array([[0.5, 1.0]])]
    kept = runner.kept(np.zeros(2), x, np.array([[10.0, 10.0]]), np.zeros((0, 2)), acting, memory)
    assert abs(kept[0][1, 1]) < 0.01
    np.testing.assert_allclose(kept[1], np.eye(2), atol=1e-6)
    assert runner.kept(np.zeros(2), x, np.zeros((1, 2)), np.zeros((0, 2)), [], []) is None


def test_all_steps_at_once_come_to_what_they_come_to_one_by_one():
    (t, u), none = drive(4), np.zeros((0, 1))
    acting, runner = [friction(amplitude=20.0)], Runner(block(), DT)
    exact = runner.states(t, np.zeros((2, 1)), u, none, acting)
    np.testing.assert_allclose(runner.states(t, np.zeros((2, 1)), u, none, acting, near=exact + 1e-3), exact, atol=1e-9)


def test_a_run_is_the_same_alone_and_beside_others():
    (t, u), none = drive(5), np.zeros((0, 1))
    acting = [friction("stribeck_friction", coulomb=12.0, breakaway=9.0, velocity=0.02)]
    both = np.concatenate([u, drive(6)[1]], axis=2)[:60]
    runs = [Runner(block(), DT).states(t[:60], np.zeros((2, 1)), both[:, :, [k]], none, acting) for k in range(2)]
    found = Runner(block(), DT).states(np.repeat(t[:60], 2, axis=1), np.zeros((2, 2)), both, np.zeros((0, 2)), acting)
    np.testing.assert_allclose(found, np.concatenate(runs, axis=2), atol=1e-9)
