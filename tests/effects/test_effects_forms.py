"""Forms of effects beyond their simplest one: a receiver, elements side by side, other bristles, other beginnings."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from pamid.bench import BenchParameters, simulate, sine, step, triangle
from pamid.effects import Signals, make_effect
from pamid.effects._memory import dahl, drawn_along
from pamid.equations import evaluate_log
from pamid.laws.valve import flow_function

B = BenchParameters.for_muscle("B")
PLANT = B.plant()
DT = 1e-3
REGULATION = 1.2e8


def filling(u: np.ndarray, P: float = 3e5) -> Signals:
    return Signals(command=u, pressure=np.full(u.shape, P))


@pytest.mark.parametrize("resistance", [0.0, 4e7])
def test_a_receiver_follows_its_equation(resistance: float) -> None:
    droop = make_effect("supply_droop", resistance=resistance, regulation=REGULATION, time_constant=0.03)
    u = np.zeros((400, 2))
    u[50:250, 0], u[150:300, 1] = 0.8, 0.4
    d = droop.trace(filling(u), PLANT, DT, np.array([0]))[0]

    def rate(t: float, x: np.ndarray) -> np.ndarray:
        inlet = PLANT.supply_pressure - x[0]
        k = PLANT.sonic_conductance * PLANT.reference_density * u[min(int(t / DT + 1e-9), 399)]
        k = k * flow_function(3e5 / inlet, PLANT.critical_pressure_ratio)
        return np.array([(REGULATION * np.sum(k * inlet / (1.0 + resistance * k)) - x[0]) / 0.03])

    t = np.arange(400) * DT
    exact = solve_ivp(rate, (0.0, t[-1]), [0.0], t_eval=t, max_step=DT / 2, rtol=1e-8, atol=1e-3).y[0]
    np.testing.assert_allclose(d[:, 0], exact, atol=0.01 * exact.max())
    np.testing.assert_array_equal(d[:, 0], d[:, 1])  # one receiver for both
    inlet = droop.supply(PLANT.supply_pressure, filling(u), d[None], PLANT)
    np.testing.assert_allclose(inlet[:50], PLANT.supply_pressure)
    assert (inlet[280:, 0] < PLANT.supply_pressure - 1e3).all(), "a valve that is shut feels what the other one drew"


def test_a_receiver_without_regulation_is_a_hose() -> None:
    hose = make_effect("supply_droop", resistance=2e7)
    s = filling(np.full((50, 2), 0.5))
    inlet = hose.supply(PLANT.supply_pressure, s, hose.trace(s, PLANT, DT, np.array([0])), PLANT)
    k = PLANT.sonic_conductance * PLANT.reference_density * 0.5
    k *= flow_function(3e5 / PLANT.supply_pressure, PLANT.critical_pressure_ratio)
    np.testing.assert_allclose(inlet, PLANT.supply_pressure / (1.0 + 2e7 * k))


def test_joined_steps_are_single_steps() -> None:
    rng, starts = np.random.default_rng(0), np.array([0, 37])
    target, decay = rng.normal(size=(99, 2)), rng.uniform(0.9, 1.0, (99, 2))
    x = np.zeros((100, 2))
    for k in range(99):
        x[k + 1] = 0.0 if k + 1 in starts else target[k] + (x[k] - target[k]) * decay[k]
    np.testing.assert_allclose(drawn_along(target, decay, starts), x, atol=1e-12)


@pytest.mark.parametrize("dynamic", [False, True])
def test_the_bench_with_a_droop_is_that_of_its_log(dynamic: bool) -> None:
    values = {"resistance": 0.0, "regulation": 6e7, "time_constant": 0.04} if dynamic else {"resistance": 6e7}
    actual = B.replace(effects=[("supply_droop", values)])
    log = simulate(actual, [sine(6, 20, 1500), step(0, 20, 1500), triangle(5, 15, 1500)], seed=5)
    nominal, own = evaluate_log(log, B)["valve"], evaluate_log(log, actual)["valve"]
    assert nominal.rmse > 3.0 * nominal.noise_floor
    assert own.rmse < 1.2 * own.noise_floor


def test_elements_go_over_one_after_the_other() -> None:
    x = np.concatenate([np.linspace(0.1, 0.2, 400), np.linspace(0.2, 0.1, 400)])[:, None]
    s = Signals(position=x)
    one, many = (make_effect("hysteresis", amplitude=10.0, displacement=0.02, spread=v) for v in (0.0, 1.2))
    force = [e.force(s, e.trace(s, PLANT, DT, np.array([0])), PLANT)[:, 0] for e in (one, many)]
    lengths = 0.02 * np.exp(1.2 * np.arange(-2, 3) / np.sqrt(2))
    alone = [make_effect("hysteresis", amplitude=10.0, displacement=float(d)) for d in lengths]
    mean = np.mean([e.force(s, e.trace(s, PLANT, DT, np.array([0])), PLANT)[:, 0] for e in alone], axis=0)
    np.testing.assert_allclose(force[1], mean, rtol=1e-12)
    # Soon after the reversal the short ones have turned already, and late in the stroke the long ones have not.
    assert force[1][412] > force[0][412] + 0.5
    assert abs(force[1][700]) < abs(force[0][700]) - 0.5


@pytest.mark.parametrize("exponent", [0.0, 0.35, 0.8])
def test_bristles_turn_over_as_dahl_says(exponent: float) -> None:
    """Gradually, straight until they slide, or in between; all that is asked of a step holds for each."""
    w0, moves = 1.6, np.linspace(0.0, 3.0, 61)
    z = dahl(np.full(61, 1.0 - w0), moves * 2e-4, 2e-4, exponent)
    exact = solve_ivp(
        lambda _, w: -(np.maximum(w, 0.0) ** exponent),
        (0.0, 3.0),
        [w0],
        t_eval=moves,
        rtol=1e-9,
        atol=1e-9,
        max_step=1e-3,
    ).y[0]
    np.testing.assert_allclose(z, 1.0 - np.maximum(exact, 0.0), atol=3e-3)
    half = dahl(dahl(0.3, -1e-4, 2e-4, exponent), -1e-4, 2e-4, exponent)
    assert half == pytest.approx(dahl(0.3, -2e-4, 2e-4, exponent), abs=1e-12)
    assert dahl(0.999, 1.0, 2e-4, exponent) == pytest.approx(1.0)


def test_an_asperity_is_elastic_until_it_slides() -> None:
    x = np.concatenate([np.linspace(0.1, 0.101, 50), np.linspace(0.101, 0.1, 101)])
    s = Signals(position=x, pressure=np.full(x.shape, 3e5))
    friction = make_effect("coulomb_friction", amplitude=2.0, presliding=2e-4, exponent=0.0)
    force = friction.force(s, friction.trace(s, PLANT, DT, np.array([0])), PLANT)
    z = np.zeros(len(x))
    for k in range(1, len(x)):
        z[k] = np.clip(z[k - 1] + (x[k] - x[k - 1]) / 2e-4, -1.0, 1.0)
    np.testing.assert_allclose(force, -2.0 * z, atol=1e-9)


def test_elements_slip_as_maxwell_says() -> None:
    rng = np.random.default_rng(3)
    x = 0.12 + 0.004 * np.cumsum(rng.normal(size=300))
    s = Signals(position=x)
    effect = make_effect("hysteresis", amplitude=0.0, slip=6.0, displacement=0.01, spread=0.8)
    force = effect.force(s, effect.trace(s, PLANT, DT, np.array([0])), PLANT)
    yields, z = 0.01 * np.exp(0.8 * np.arange(-2, 3) / np.sqrt(2)), np.zeros((300, 5))
    for k in range(1, 300):
        z[k] = np.clip(z[k - 1] + (x[k] - x[k - 1]) / yields, -1.0, 1.0)
    np.testing.assert_allclose(force, -6.0 * z.mean(axis=1), atol=1e-9)
    both = make_effect("hysteresis", amplitude=2.0, slip=6.0, displacement=0.01, spread=0.8)
    alone = make_effect("hysteresis", amplitude=2.0, displacement=0.01, spread=0.8)
    parts = [e.force(s, e.trace(s, PLANT, DT, np.array([0])), PLANT) for e in (both, alone)]
    np.testing.assert_allclose(parts[0], parts[1] + force, atol=1e-9)


@pytest.mark.parametrize("inertia", [0.0, 0.2, 0.25, 0.6, 1.0])
def test_a_spool_lags_and_swings(inertia: float) -> None:
    u = np.sign(np.sin(0.05 * np.arange(300.0)))[:, None]
    effect = make_effect("valve_lag", time_constant=0.012, second=inertia)
    y = effect.command(u, None, effect.trace(Signals(command=u), PLANT, DT, np.array([0])), PLANT)[:, 0]

    def rate(t: float, x: np.ndarray) -> list[float]:
        gap = float(u[min(int(t / DT + 1e-9), 299), 0]) - x[0]
        return [x[1], (gap - 0.012 * x[1]) / (inertia * 0.012**2)] if inertia else [gap / 0.012, 0.0]

    t = np.arange(300) * DT
    exact = solve_ivp(rate, (0.0, t[-1]), [u[0, 0], 0.0], t_eval=t, max_step=DT / 4, rtol=1e-8, atol=1e-8).y[0]
    np.testing.assert_allclose(y, exact, atol=5e-3)
    assert (np.abs(y).max() > 1.001) == (inertia > 0.25)


@pytest.mark.parametrize("k", [0.7, 1.3])
def test_a_contraction_counts_for_less_or_more(k: float) -> None:
    """Force and flow are those of a muscle whose active part contracts by k ε, and which exchanges no energy twice."""
    eps, P = np.array([0.05, 0.12]), np.array([3e5, 4e5])
    s = Signals(position=eps, velocity=np.array([0.1, -0.2]), pressure=P, pressure_rate=np.zeros(2))
    effect = make_effect("effective_contraction", factor=k)
    p = P - PLANT.atmospheric_pressure
    total = p * PLANT.volume_slope(eps) / PLANT.rest_length + effect.force(s, None, PLANT)
    np.testing.assert_allclose(total, p * PLANT.volume_slope(k * eps) / PLANT.rest_length)
    own = make_effect("end_cap", factor=k)  # one concept on the bench and on a single muscle
    np.testing.assert_allclose(effect.flow(s, None, PLANT).a, own.flow(s, None, PLANT).a)


def test_a_compliant_drive_swings_at_its_frequency() -> None:
    load = np.where(np.arange(2000) < 100, 0.0, 10.0)
    effect = make_effect("compliance", frequency=80.0, damping=0.1)
    felt = effect.measure(load, effect.trace(Signals(force=load), PLANT, DT, np.array([0])))
    t = (np.arange(2000) - 99.5) * DT
    w = 80.0 * np.sqrt(1.0 - 0.01)
    exact = 10.0 * (1.0 - np.exp(-8.0 * t) * (np.cos(w * t) + 8.0 / w * np.sin(w * t)))
    np.testing.assert_allclose(felt[101:], exact[101:], atol=0.02)
    assert felt.max() > 15.0 and abs(felt[-1] - 10.0) < 0.01


def test_springs_remember_where_the_bench_stood() -> None:
    t = np.arange(400) * DT
    x = np.stack([0.15 + 0.02 * np.sin(9 * t), 0.09 - 0.02 * np.sin(9 * t)], axis=1)
    s = Signals(position=x)
    at_rest, fresh = (make_effect("creep", stiffness=100.0, slow_stiffness=0.0, settled=v) for v in (1.0, 0.0))
    force = [e.force(s, e.trace(s, PLANT, DT, np.array([0])), PLANT) for e in (at_rest, fresh)]
    away = x[0] - PLANT.initial_contraction
    np.testing.assert_allclose(force[1] - force[0], -100.0 * away * np.exp(-t / 1.0)[:, None], atol=1e-9)
    # An actuator without a neutral contraction begins where its log does.
    bare = SimpleNamespace(initial_contraction=None)
    np.testing.assert_array_equal(
        fresh.trace(s, bare, DT, np.array([0, 150])), at_rest.trace(s, bare, DT, np.array([0, 150]))
    )


def test_each_direction_has_its_damping() -> None:
    effect = make_effect("directional_damping", forward=167.0, backward=240.0)
    v = np.array([-2.0, 0.0, 0.5])
    np.testing.assert_allclose(effect.force(Signals(velocity=v), None, PLANT), [480.0, 0.0, -83.5])
    alike = make_effect("directional_damping", forward=60.0, backward=60.0).force(Signals(velocity=v), None, PLANT)
    np.testing.assert_allclose(
        alike, make_effect("viscous_friction", coefficient=60.0).force(Signals(velocity=v), None, PLANT)
    )


def test_pressure_may_lift_a_lip() -> None:
    effect = make_effect("directional_friction", forward=9.0, backward=9.0, forward_per_pressure=-1e-5)
    s = Signals(pressure=PLANT.atmospheric_pressure + np.array([0.0, 4e5]))
    np.testing.assert_allclose(effect.force(s, np.ones((1, 2)), PLANT), [-9.0, -5.0])


def test_what_does_not_relax_within_a_run_is_a_spring():
    slow = make_effect("creep", stiffness=0.0, slow_stiffness=7.5, slow_time_constant=1000.0)
    assert slow.elastic(2.6) and not slow.elastic(1000.0)
    assert not make_effect("creep", slow_stiffness=7.5, slow_time_constant=1000.0).elastic(2.6)  # most of it is fast
    assert make_effect("maxwell", fast=0.0, middle=0.0, time_constant=100.0).elastic(2.6)
    assert not make_effect("coulomb_friction").elastic(2.6)
