"""The twin: published counts, reproducibility, accuracy of the integrator, balances, agreement with the laws."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from benchmarks._balance import balances
from pamid.bench import (
    DATASETS,
    IDEAL,
    SENSORS,
    BenchParameters,
    contraction,
    dataset,
    hold,
    isobaric,
    isometric,
    multisine,
    sealed_hold,
    simulate,
    sine,
    step,
    triangle,
    unfold,
)
from pamid.bench.datasets import step_trajectories, training_trajectories, triangle_trajectories
from pamid.bench.muscles import Muscles
from pamid.bench.references import Trajectory
from pamid.bench.simulation import run_batch
from pamid.effects import Effect, Parameter, Signals, all_effects, make_effect
from pamid.effects._memory import relax
from pamid.errors import DivergedError, ParameterError, TrajectoryError, UnknownOptionError
from pamid.laws.gas import mass_flow, pressure_rate
from pamid.laws.joint import AntagonisticJoint
from pamid.laws.valve import valve_flow

B = BenchParameters.for_muscle("B")
MIXED = [
    sine(10, 25, 500, lead=0.1),
    step(0, 15, 500, at=0.1, lead=0.1),
    triangle(4, 20, 500, lead=0.1),
    step(0, -25, 500, at=0.2, lead=0.1),
]


@pytest.fixture(scope="module")
def training():
    return dataset("D_B", seed=3, truth=True)


# --- data sets ----------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("name", "rows", "runs"),
    [("D_A", 31_464, 20), ("D_B", 31_464, 20), ("D_C", 30_952, 20), ("D_tri", 39_325, 25), ("D_step", 20_000, 10)],
)
def test_published_counts(name, rows, runs):
    log = dataset(name)
    assert len(log) == rows
    assert log["trajectory"].nunique() == runs
    codes = pd.factorize(log["trajectory"])[0]
    assert (np.diff(codes) >= 0).all()  # rows of a run are contiguous
    for _, run in log.groupby("trajectory"):
        np.testing.assert_allclose(run["time"], np.arange(len(run)) * 1e-3, atol=1e-12)
    signals = log.drop(columns=["trajectory", "time"])
    assert (signals.dtypes == np.float32).all() and np.isfinite(signals.to_numpy()).all()
    for m in "12":  # taut, within supply, the valve within its range
        assert log[f"F{m}"].min() > 20 and log[f"P{m}"].between(1.1e5, 6.9e5).all() and log[f"u{m}"].abs().max() <= 1
    assert log["mdot1"].abs().max() > 1e-4


def test_slow_training_runs_cover_the_cycle_together():
    runs = [r for r in training_trajectories() if r.name.startswith("sine-1-")]
    phases = np.concatenate(
        [(2 * np.pi * k / 5 + 1e-3 * np.arange(r.n_samples)) % (2 * np.pi) for k, r in enumerate(runs)]
    )
    assert np.histogram(phases, 24, (0, 2 * np.pi))[0].min() > 100
    for k, run in enumerate(runs):
        want = np.radians(5 * (k + 1)) * np.sin(2 * np.pi * k / 5)
        assert run.q_ref[run.lead] == pytest.approx(want)


def test_names_and_trajectories():
    assert [t.name for t in step_trajectories()][:2] == ["step-0-5", "step-0--5"]
    assert triangle_trajectories()[0].name == "triangle-0.5-5"
    assert sine(1, 10, 10).name == "sine-1-10"
    like = {"paper_like", "paper_like_tri", "paper_like_step"}
    assert set(DATASETS) == {"D_A", "D_B", "D_C", "D_tri", "D_step"} | like


def test_a_seed_gives_one_log_and_another_seed_another_noise(training):
    again = dataset("D_B", seed=3)
    pd.testing.assert_frame_equal(training[0], again)
    other = dataset("D_B", seed=4)
    np.testing.assert_array_equal(other["u1"], again["u1"])
    assert not np.array_equal(other["P1"], again["P1"])


def test_a_run_does_not_depend_on_those_beside_it():
    alone = simulate(B, [MIXED[0]], sensors=IDEAL)
    both = simulate(B, [MIXED[0], sine(4, 10, 900)], sensors=IDEAL)
    a, b = alone.drop(columns="trajectory"), both.iloc[:500].drop(columns="trajectory")
    np.testing.assert_allclose(a, b, rtol=1e-6, atol=1e-9)


def test_noise_is_that_of_the_sensors(training):
    log, true = training
    for channel, columns in {"q": ["q"], "P": ["P1", "P2"], "F": ["F1", "F2"], "mdot": ["mdot1", "mdot2"]}.items():
        error = np.concatenate([log[c].to_numpy(float) - true[c] for c in columns])
        assert np.std(error) == pytest.approx(SENSORS[channel].standard_deviation, rel=0.03)
        assert abs(np.mean(error)) < 0.05 * np.std(error)


# --- against the laws ---------------------------------------------------------------------------------------
def test_fused_right_hand_side_is_the_laws():
    rng = np.random.default_rng(0)
    shape = (2, 400)
    muscles = Muscles(B, shape)
    L, L_rate = rng.uniform(0.14, 0.2, shape), rng.normal(0, 0.1, shape)
    P, u = rng.uniform(1.02e5, 6.99e5, shape), rng.uniform(-1, 1, shape)
    u[:, :50] = 0.0
    P[:, 50:60] = 7.2e5  # above supply: no flow against the pressure
    muscles.hold(u)
    rate = np.empty(shape)
    muscles.evaluate(L, L_rate, P, rate, 0.0)
    plant, g = B.plant(), B.gas
    eps = 1 - L / plant.rest_length
    mdot = valve_flow(
        u,
        P,
        g.supply_pressure,
        g.atmospheric_pressure,
        sonic_conductance=plant.sonic_conductance,
        critical_pressure_ratio=plant.critical_pressure_ratio,
        reference_density=plant.reference_density,
    )
    np.testing.assert_allclose(muscles.mdot, mdot, rtol=1e-10, atol=1e-18)
    np.testing.assert_allclose(
        muscles.F, (P - g.atmospheric_pressure) / plant.rest_length * plant.volume_slope(eps), rtol=1e-10
    )
    dV = plant.volume_slope(eps) * L_rate / -plant.rest_length
    np.testing.assert_allclose(rate, pressure_rate(P, mdot, plant.volume(eps), dV), rtol=1e-9, atol=1e-3)


def test_nominal_log_fits_the_nominal_equations_to_the_noise(training):
    log, true = training
    plant = B.plant()
    rows = unfold(log, B)
    eps, P, u, mdot, F = (rows[c].to_numpy() for c in ("eps", "P", "u", "mdot", "F"))
    per_pressure = plant.volume_slope(eps) / plant.rest_length
    force = F - (P - plant.atmospheric_pressure) * per_pressure
    sd = {c: s.standard_deviation for c, s in SENSORS.items()}
    assert np.std(force) == pytest.approx(np.hypot(sd["F"], sd["P"] * per_pressure.mean()), rel=0.05)
    law = {
        "sonic_conductance": plant.sonic_conductance,
        "critical_pressure_ratio": plant.critical_pressure_ratio,
        "reference_density": plant.reference_density,
    }
    valve = mdot - valve_flow(u, P, plant.supply_pressure, plant.atmospheric_pressure, **law)
    assert np.std(valve) == pytest.approx(sd["mdot"], rel=0.05)
    for m in "12":  # the flow needs rates: the true ones, against the measured flow
        V, dV = true[f"V{m}"], plant.volume_slope(true[f"eps{m}"]) * true[f"deps{m}"]
        flow = log[f"mdot{m}"].to_numpy(float) - mass_flow(true[f"P{m}"], true[f"dP{m}"], V, dV)
        assert np.std(flow) == pytest.approx(sd["mdot"], rel=0.05)
    j = B.joint
    joint = AntagonisticJoint(j.pulley_radius, B.muscle.rest_length, 0.12, j.inertia, j.viscous_damping)
    left = joint.residual(true["F1"], true["F2"], true["dq"], true["ddq"])
    assert np.abs(left).max() < 1e-9


# --- the integrator -----------------------------------------------------------------------------------------
def test_step_halving_shows_fourth_order():
    reference = run_batch(B, MIXED, substeps=12, truth=True).y
    errors = np.array([np.abs(run_batch(B, MIXED, substeps=s, truth=True).y - reference).max(0) for s in (1, 2, 4)])
    order = np.log2(errors[:-1] / errors[1:])[:, (0, 2, 3)]
    assert np.median(order) > 3.7
    # One step a period is already far below what the sensors see.
    assert errors[0, 0].max() < 1e-3 * SENSORS["q"].noise and errors[0, 2:].max() < 1e-2 * SENSORS["P"].noise


@pytest.mark.parametrize("gamma", [1.0, 1.4])
def test_gas_and_energy_balance(gamma):
    params = B.replace(heat_capacity_ratio=gamma)
    coarse, fine = balances(params, MIXED, 1), balances(params, MIXED, 2)
    for name, left in coarse.items():
        assert left < 1e-7
        assert fine[name] < left / 8  # what is left is the integrator's error
    assert ("gas_energy" in coarse) == (gamma > 1)


# --- special runs -------------------------------------------------------------------------------------------
def test_sealed_valves_keep_the_gas_and_leakage_loses_it():
    run = sealed_hold(10, 1500, after=0.3)
    log, true = simulate(B, [run], sensors=IDEAL, truth=True)
    after = slice(310, None)
    assert (log["u1"].iloc[after] == 0).all() and (true["mdot1"].iloc[after] == 0).all()
    content = true["P1"] ** (1 / 1.4) * true["V1"]
    assert np.ptp(content.iloc[after]) < 1e-9 * content.iloc[-1]
    leaking = simulate(B, [run], sensors=IDEAL, effects=[("leakage", {"conductance": 1e-10})])
    assert leaking["P1"].iloc[-1] < log["P1"].iloc[-1] - 1e3


def test_isobaric_and_isometric_runs_are_what_they_say():
    runs = [
        isobaric(2, 10, 2000, muscle=2),
        isometric(10, 8e4, 2000, frequency=3.0),
        hold(-5, 2000),
        multisine(6, 10, 2000),
    ]
    log = simulate(B, runs, sensors=IDEAL)
    by_name = dict(list(log.groupby("trajectory", sort=False)))
    moved = by_name["isobaric2-2-10"]
    assert np.ptp(moved["P2"]) < 0.05 * np.ptp(moved["P1"]) and np.ptp(moved["q"]) > 0.2
    held = by_name["isometric-10-80"]
    assert np.ptp(held["P1"]) > 7e4 and np.ptp(held["q"]) < 0.02
    assert np.ptp(by_name["hold--5"]["q"]) < 1e-3
    assert np.abs(by_name["multisine-6-10"]["q_ref"]).max() <= np.radians(10) + 1e-6


# --- effects ------------------------------------------------------------------------------------------------
def _signals(true, m, log):
    return Signals(
        position=true[f"eps{m}"].to_numpy(),
        velocity=true[f"deps{m}"].to_numpy(),
        pressure=true[f"P{m}"].to_numpy(),
        pressure_rate=true[f"dP{m}"].to_numpy(),
        command=log[f"u{m}"].to_numpy(float),
        flow=true[f"mdot{m}"].to_numpy(),
        force=true[f"F{m}"].to_numpy(),
    )


# Muscles only pull, so that there is no sign to lose; what is lost at a temperature is no gas.
ACTING = [name for name, effect in all_effects().items() if name != "rectification" and effect.domain != "temperature"]


RUNS = [sine(10, 25, 500, lead=0), step(0, 15, 500, at=0.1, lead=0)]


@pytest.fixture(scope="module")
def quiet():
    """The runs without an effect."""
    return simulate(B, RUNS, sensors=IDEAL, truth=True)[1]


@pytest.mark.parametrize("name", ACTING)
def test_simulated_effect_is_the_one_predicted_from_the_log(name, quiet):
    """An effect in the simulator changes its equations by what the same effect predicts from the signals, no others."""
    effect = make_effect(name)
    effect = effect.replace(**{"valve_saturation": {"limit": 0.2}, "threshold_pressure": {"growth": 2e5}}.get(name, {}))
    log, true = simulate(B, RUNS, sensors=IDEAL, effects=[effect], truth=True, substeps=2)
    assert np.isfinite(true.drop(columns="trajectory").to_numpy()).all()
    params = B.replace(effects=[(effect.name, effect.values)]).adjusted()
    plant, starts, hooks = params.plant(), np.array([0, 500]), effect.hooks()
    assert any(not np.allclose(log[c], quiet[c], rtol=1e-4, atol=1e-9) for c in ("q", "P1", "F1", "mdot1"))
    law = {
        "sonic_conductance": plant.sonic_conductance,
        "critical_pressure_ratio": plant.critical_pressure_ratio,
        "reference_density": plant.reference_density,
    }
    for m in (1, 2):
        s = _signals(true, m, log)
        x = effect.trace(s, plant, 1e-3, starts) if effect.n_states and "measure" not in hooks else None
        p = s.pressure - plant.atmospheric_pressure
        F = p / plant.rest_length * plant.volume_slope(s.position) + effect.force(s, x, plant)
        np.testing.assert_allclose(s.force, F, rtol=0, atol=2e-3 * np.ptp(s.force))
        V, dV = plant.volume(s.position), plant.volume_slope(s.position) * s.velocity
        a, b = effect.flow(s, x, plant)
        mdot = mass_flow(s.pressure, s.pressure_rate, V, dV, temperature=plant.temperature) + a + b * s.pressure_rate
        np.testing.assert_allclose(s.flow, mdot, rtol=0, atol=1e-4 * np.ptp(s.flow))
        supply = effect.supply(plant.supply_pressure, s, x, plant)
        u = effect.command(s.command, s, x, plant)
        through = valve_flow(u, s.pressure, supply, plant.atmospheric_pressure, **law) + effect.valve(s, x, plant)
        np.testing.assert_allclose(s.flow, through, rtol=0, atol=1e-4 * np.ptp(s.flow))
    j = params.joint
    joint = AntagonisticJoint(j.pulley_radius, params.muscle.rest_length, 0.12, j.inertia, j.viscous_damping)
    torque = effect.torque(Signals(position=true["q"].to_numpy(), velocity=true["dq"].to_numpy()), None, plant)
    assert np.abs(joint.residual(true["F1"], true["F2"], true["dq"], true["ddq"]) + torque).max() < 1e-9
    if "measure" in hooks:
        columns = {"q": ["q"]}.get(effect.channel, [f"{effect.channel}1", f"{effect.channel}2"])
        for c in columns:
            role = {"q": "position", "P": "pressure", "F": "force", "mdot": "flow"}[effect.channel]
            s = Signals(**{role: true[c].to_numpy()})
            x = effect.trace(s, plant, 1e-3, starts) if effect.n_states else None
            want = effect.measure(true[c].to_numpy(), x)
            np.testing.assert_allclose(log[c], want, rtol=1e-5, atol=1e-6 * np.ptp(want))


@pytest.mark.parametrize("names", [("hysteresis", "creep", "valve_lag"), ("coulomb_friction", "heat_transfer")])
def test_effects_with_memory_converge_with_the_step(names):
    effects = [make_effect(name) for name in names]
    runs = MIXED[:2]
    reference = run_batch(B, runs, effects, substeps=8, truth=True).y
    errors = [
        np.sqrt(np.mean((run_batch(B, runs, effects, substeps=s, truth=True).y - reference) ** 2, axis=(0, 2)))
        for s in (1, 2)
    ]
    assert np.all(errors[1] < 0.75 * errors[0])  # a reversal inside a step costs friction an order
    assert errors[0][0] < 0.1 * SENSORS["q"].noise and errors[0][2:].max() < 0.1 * SENSORS["P"].noise


def test_two_alike_lags_in_one_chain_remember_each_its_own():
    lag = ("valve_lag", {"time_constant": 0.004})
    runs = [step(0, 15, 300, at=0.05, lead=0)]
    once, twice = (simulate(B, runs, sensors=IDEAL, effects=effects, truth=True)[1] for effects in ([lag], [lag, lag]))
    opened = [np.argmax(t["mdot1"].to_numpy() > 1e-3) for t in (once, twice)]
    assert opened[1] > opened[0]


def test_memory_at_the_joint_is_carried():
    class Twist(Effect):
        name = "twist"
        family = "viscoelasticity"
        equations = ("joint",)
        site = "joint"
        roles = ("position",)
        source = "none"
        n_states = 1
        parameters = (Parameter("stiffness", "N m/rad", 0.0, 100.0, 2.0, "relaxing spring", linear=True),)

        def start(self, s, plant, dt):
            return s.position[None].copy()

        def step(self, x, s0, s1, dt, plant):
            return relax(x, s0.position, s1.position, dt, 0.1)

        def torque(self, s, x, plant):
            return -self.stiffness * (s.position - x[0])

    try:
        runs = [sine(10, 20, 400, lead=0)]
        _, true = simulate(B, runs, sensors=IDEAL, effects=["twist"], truth=True)
        effect = make_effect("twist")
        s = Signals(position=true["q"].to_numpy())
        torque = effect.torque(s, effect.trace(s, None, 1e-3, np.array([0])), None)
        joint = AntagonisticJoint(0.04, 0.2, 0.12, 0.02, 0.08)
        left = joint.residual(true["F1"], true["F2"], true["dq"], true["ddq"]) + torque
        assert np.abs(torque).max() > 0.3 and np.abs(left).max() < 1e-4
    finally:
        del Effect.registry["twist"]


def test_effects_of_a_simulator_file_are_simulated(tmp_path):
    path = tmp_path / "sim.toml"
    B.replace(effects=[("viscous_friction", {"coefficient": 80.0})]).to_toml(path)
    a = simulate(BenchParameters.from_toml(path), MIXED)
    b = simulate(B, MIXED, effects=[("viscous_friction", {"coefficient": 80.0})])
    pd.testing.assert_frame_equal(a, b)


# --- unfolding and errors -----------------------------------------------------------------------------------
def test_unfold_gives_one_row_per_muscle_and_sample(training):
    log, true = training
    rows = unfold(log, B)
    assert len(rows) == 2 * len(log) and rows["trajectory"].nunique() == 2 * log["trajectory"].nunique()
    second = rows[rows["muscle"] == 2]
    assert second["trajectory"].iloc[0] == f"{log['trajectory'].iloc[0]}#2"
    np.testing.assert_allclose(second["eps"], true["eps2"], atol=5 * SENSORS["q"].noise)
    np.testing.assert_array_equal(second["P"].to_numpy(), log["P2"].to_numpy(float))
    assert contraction(0.1, 1, B) == pytest.approx(0.14)
    assert list(unfold(log.drop(columns=["F1", "mdot1", "mdot2"]), B).columns) == [
        "trajectory", "run", "muscle", "time", "eps", "P", "u",
    ]  # fmt: skip


def test_errors():
    with pytest.raises(UnknownOptionError, match="D_B"):
        dataset("D_X")
    with pytest.raises(TrajectoryError, match="sine-1-10"):
        simulate(B, [sine(1, 10, 20), sine(1, 10, 30)])
    with pytest.raises(TrajectoryError):
        simulate(B, [])
    with pytest.raises(ParameterError):
        Trajectory("x", np.array([np.nan, 0.0]))
    with pytest.raises(ParameterError):
        simulate(B, MIXED, substeps=0)
    with pytest.raises(ParameterError):
        isobaric(1, 1, 10, muscle=3)
    with pytest.raises(DivergedError, match="sine-10-25"), np.errstate(all="ignore"):
        simulate(B, [sine(10, 25, 1500)], effects=[("viscous_friction", {"coefficient": 1e5})])
