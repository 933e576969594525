"""Parameters of effects come back from logs of simulations of their own, which share no code with the library."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pandas as pd
import pytest
from scipy.integrate import solve_ivp
from support.bench_logs import RUNS

from pamid.bench import BenchParameters, simulate
from pamid.effects import Effect, Parameter, Signals, make_effect
from pamid.gap import diagnose, diagnose_simulator
from pamid.gap.diagnosis.result import Diagnosis
from pamid.gap.simulated import evidence_of
from pamid.report.sentences import which
from pamid.simulators import FunctionSimulator, Port
from pamid.systems.cylinder import Cylinder

DT, FINE = 5e-3, 10
PORTS = [Port("F", "input", "N"), Port("x", "state", "m"), Port("v", "state", "m/s")]
MASS = 2.0
PLANT = BenchParameters.for_muscle("B").plant()


def simulator() -> FunctionSimulator:
    return FunctionSimulator(lambda t, x, u, p: [x.v, u.F / p.m], PORTS, {"m": (MASS, 0.0, "kg")})


def carts(
    resists: Callable[[float, float], float],
    runs: int = 3,
    n: int = 1200,
    seed: int = 0,
    followed: Callable[[float, float], float] = lambda force, wanted: wanted,
) -> pd.DataFrame:
    """Return runs of a cart under a force, held over each sample, and what resists it; steps of a tenth of a sample.

    ``followed`` gives the force after such a step from the force before it and the one that is wanted.
    """
    tables = []
    for run in range(seed, seed + runs):
        rng, t = np.random.default_rng(run), DT * np.arange(n)
        phase, w = rng.uniform(0.0, 6.0, 3), np.array([1.9, 5.1, 8.3])
        F = np.array([6.0, 5.0, 4.0]) @ np.sin(np.outer(w, t) + phase[:, None])
        x = v = 0.0
        pushes = F[0]
        path, speed = np.empty(n), np.empty(n)
        for k in range(n):
            path[k], speed[k] = x, v
            for _ in range(FINE):
                pushes = followed(pushes, F[k])
                middle = v + 0.5 * DT / FINE * (pushes - resists(x, v)) / MASS
                v += DT / FINE * (pushes - resists(x + 0.5 * DT / FINE * v, middle)) / MASS
                x += DT / FINE * middle
        noise = rng.standard_normal((2, n))
        columns = {
            "trajectory": str(seed),
            "time": t,
            "F": F,
            "x": path + 1e-5 * noise[0],
            "v": speed + 1e-3 * noise[1],
        }
        tables.append(pd.DataFrame(columns))
    return pd.concat(tables, ignore_index=True)


def sizes(found: Diagnosis, name: str) -> dict[str, float]:
    """Return the parameters of the only cause, which must be the one named."""
    assert [c.effects[0] for c in found.causes] == [name]
    return {k: p.value for k, p in found.causes[0].parameters.items()}


# --- viscous friction ---------------------------------------------------------------------------------------
def test_a_damper_has_a_slope_for_either_direction() -> None:
    log = carts(lambda x, v: 3.0 * v if v > 0.0 else 5.0 * v)
    library = ["viscous_friction", "directional_damping", "quadratic_drag", "force_bias"]
    found = sizes(diagnose_simulator(log, simulator(), library), "directional_damping")
    assert (found["forward"], found["backward"]) == pytest.approx((3.0, 5.0), rel=0.02)


def test_a_damper_that_is_alike_in_both_directions_is_the_simple_one() -> None:
    library = ["viscous_friction", "directional_damping"]
    found = sizes(diagnose_simulator(carts(lambda x, v: 4.0 * v), simulator(), library), "viscous_friction")
    assert found["coefficient"] == pytest.approx(4.0, rel=0.02)


# --- heat ---------------------------------------------------------------------------------------------------
def warm_gas(tau: float, leaves_warm: bool) -> tuple[Signals, np.ndarray]:
    """Return a chamber that is filled and vented while its volume changes, and the flow that an adiabatic one lacks.

    Mass and internal energy are integrated; the conductance of the walls is that of the time constant at each mass.
    """
    g, R, T = PLANT.heat_capacity_ratio, PLANT.gas_constant, PLANT.temperature
    cp, cv = g * R / (g - 1.0), R / (g - 1.0)
    t = np.arange(0.0, 8.0, 2e-3)

    def eps(s: np.ndarray | float) -> np.ndarray:
        return np.asarray(0.1 + 0.05 * np.sin(2.3 * np.asarray(s)))

    def flow(s: np.ndarray | float) -> np.ndarray:
        return np.asarray(4e-4 * np.sin(3.1 * np.asarray(s)) + 2e-4 * np.sin(7.7 * np.asarray(s)))

    def volume(s: float) -> tuple[float, float]:
        return float(PLANT.volume(eps(s))), float(PLANT.volume_slope(eps(s)) * 0.05 * 2.3 * np.cos(2.3 * s))

    def rate(s: float, y: np.ndarray) -> list[float]:
        (mass, energy), (V, grows), into = y, volume(s), float(flow(s))
        warm = energy / (mass * cv)
        enthalpy = cp * (T if into > 0.0 or not leaves_warm else warm) * into
        return [into, enthalpy - (g - 1.0) * energy / V * grows - mass * cp / tau * (warm - T)]

    mass = 4e5 * volume(0.0)[0] / (R * T)
    found = solve_ivp(rate, (0.0, t[-1]), [mass, mass * cv * T], t_eval=t, rtol=1e-9, atol=1e-12, max_step=1e-2).y
    V, P = np.asarray(PLANT.volume(eps(t))), (g - 1.0) * found[1] / np.asarray(PLANT.volume(eps(t)))
    rates = np.array([rate(s, y) for s, y in zip(t, found.T, strict=True)])
    grows = np.array([volume(s)[1] for s in t])
    dP = (g - 1.0) * (rates[:, 1] - found[1] * grows / V) / V
    s = Signals(time=t, position=eps(t), velocity=0.05 * 2.3 * np.cos(2.3 * t), pressure=P, pressure_rate=dP)
    return s, flow(t) - V * dP / (g * R * T) - P * grows / (R * T)


def left_of(missing: np.ndarray, s: Signals, **values: float) -> float:
    """Return the share of the missing flow's square that heat transfer leaves."""
    effect = make_effect("heat_transfer", **values)
    a, b = effect.flow(s, effect.trace(s, PLANT, 2e-3, np.array([0])), PLANT)
    return float(np.sum((missing - a - b * s.pressure_rate) ** 2) / np.sum(missing**2))


@pytest.mark.parametrize("known_flow", [False, True])
@pytest.mark.parametrize("tau", [0.15, 1.0])
def test_gas_that_leaves_takes_its_excess_along(tau: float, known_flow: bool) -> None:
    s, missing = warm_gas(tau, leaves_warm=True)
    if known_flow:
        V = PLANT.volume(s.position)
        nominal = (
            V * s.pressure_rate / PLANT.heat_capacity_ratio + s.pressure * PLANT.volume_slope(s.position) * s.velocity
        )
        s = s.with_(flow=missing + nominal / PLANT.RT)
    grid = np.geomspace(tau / 4.0, 4.0 * tau, 81)
    left = [left_of(missing, s, time_constant=float(v)) for v in grid]
    assert min(left) < 0.02
    assert grid[int(np.argmin(left))] == pytest.approx(tau, rel=0.1)
    cold = [left_of(missing, s, time_constant=float(v), carried=0.0) for v in grid]
    assert min(cold) > 4.0 * min(left), "a form in which it leaves at the temperature of the walls is another one"


def test_gas_may_leave_at_the_temperature_of_the_walls() -> None:
    s, missing = warm_gas(0.3, leaves_warm=False)
    assert left_of(missing, s, time_constant=0.3, carried=0.0) < 1e-3
    assert left_of(missing, s, time_constant=0.3, carried=1.0) > 5e-3


# --- end caps -----------------------------------------------------------------------------------------------
@pytest.mark.parametrize("factor", [0.93, 1.07])
def test_ends_of_a_bench_count_for_less_or_more(factor: float) -> None:
    bench = BenchParameters.for_muscle("B")
    log = simulate(bench, RUNS, effects=[("end_cap", {"factor": factor, "swept": 1.0})], seed=4)
    library = [
        "end_cap",
        "length",
        "diameter",
        "braid_angle",
        "thread_extensibility",
        "bladder_elasticity",
        "force_gain",
    ]
    assert sizes(diagnose(log, bench, library), "end_cap")["factor"] == pytest.approx(factor, abs=0.01)


# --- what repeats with the position -------------------------------------------------------------------------
def test_a_cogging_is_found_among_other_forces_of_the_position() -> None:
    waves = 12.4
    log = carts(lambda x, v: 0.25 * np.sin(waves * x) + 0.1 * np.cos(waves * x))
    library = ["periodic_force", "viscous_friction", "coulomb_friction", "nonlinear_stiffness", "force_bias"]
    found = sizes(diagnose_simulator(log, simulator(), library), "periodic_force")
    assert found["rate"] == pytest.approx(waves, rel=2e-3)
    assert (found["sine"], found["cosine"]) == pytest.approx((-0.25, -0.1), abs=0.02)


# --- commands -----------------------------------------------------------------------------------------------
def test_a_drive_follows_its_command_at_a_limited_speed() -> None:
    step = 30.0 * DT / FINE  # 30 N/s
    log = carts(lambda x, v: 0.0, followed=lambda force, wanted: force + max(-step, min(step, wanted - force)))
    library = ["slew_rate", "valve_lag", "transport_delay", "valve_saturation", "actuator_backlash", "force_gain"]
    found = sizes(diagnose_simulator(log, simulator(), library), "actuator_slew_rate")
    assert found["rate"] == pytest.approx(30.0, rel=0.03)


class Spool(Effect):
    """A spool on a spring, stepped by the midpoint rule."""

    name, family, equations, source = "own_spool", "valve", ("valve",), "none"
    roles, n_states = ("command",), 2
    parameters = (
        Parameter("frequency", "rad/s", 1.0, 1e4, 300.0, "natural frequency"),
        Parameter("damping", "-", 0.0, 5.0, 0.7, "damping ratio"),
    )

    def start(self, s, plant, dt):
        u = np.array(s.command, dtype=float)
        return np.stack([u, 0.0 * u])

    def step(self, x, s0, s1, dt, plant):
        n = max(1, int(np.ceil(20.0 * dt * self.frequency)))
        (y, v), h = x, dt / n
        for _ in range(n):
            a = self.frequency**2 * (s0.command - y) - 2.0 * self.damping * self.frequency * v
            y_half, v_half = y + 0.5 * h * v, v + 0.5 * h * a
            a = self.frequency**2 * (s0.command - y_half) - 2.0 * self.damping * self.frequency * v_half
            y, v = y + h * v_half, v + h * a
        return np.stack([y, v])

    def command(self, u, s, x, plant):
        return x[0]


del Effect.registry["own_spool"]


@pytest.mark.parametrize("damping", [0.6, 1.5])
def test_a_spool_of_second_order_is_one_lag(damping: float) -> None:
    bench, frequency = BenchParameters.for_muscle("B"), 300.0
    Effect.registry["own_spool"] = Spool
    try:
        log = simulate(bench, RUNS, effects=[("own_spool", {"frequency": frequency, "damping": damping})], seed=4)
    finally:
        del Effect.registry["own_spool"]
    library = ["valve_lag", "flow_lag", "transport_delay", "valve_dead_zone", "pressure_lag"]
    found = sizes(diagnose(log, bench, library), "valve_lag")
    assert found["time_constant"] == pytest.approx(2.0 * damping / frequency, rel=0.05)
    assert found["second"] == pytest.approx(0.25 / damping**2, abs=0.05)


# --- a hidden mass ------------------------------------------------------------------------------------------
class Swinging:
    """A mass on a spring and a damper at a cart, stepped with the cart."""

    def __init__(self, mass: float, frequency: float, damping: float) -> None:
        self.mass, self.k, self.c = mass, mass * frequency**2, 2.0 * damping * mass * frequency
        self.y = self.speed = 0.0
        self.again = False

    def __call__(self, x: float, v: float) -> float:
        pull = self.k * (x - self.y) + self.c * (v - self.speed)
        self.again = not self.again
        if not self.again:  # asked twice in a step
            self.speed += DT / FINE * pull / self.mass
            self.y += DT / FINE * self.speed
        return pull


def test_a_mass_on_a_spring_is_named_with_its_frequency() -> None:
    frequency = 25.0
    log = pd.concat([carts(Swinging(0.4, frequency, 0.08), runs=1, seed=k) for k in range(3)], ignore_index=True)
    library = ["resonance", "viscous_friction", "force_lag", "compliance", "maxwell", "actuator_hysteresis"]
    found = sizes(diagnose_simulator(log, simulator(), library), "resonance")
    assert found["mass"] == pytest.approx(0.4, rel=0.05)
    assert found["frequency"] == pytest.approx(frequency, rel=0.03)
    assert found["damping"] == pytest.approx(0.08, abs=0.03)


def test_a_hidden_mass_takes_no_energy_but_in_its_damper() -> None:
    t = DT * np.arange(4000)
    x, v = 0.1 * np.sin(7.0 * t) * (t < 10.0), 0.7 * np.cos(7.0 * t) * (t < 10.0)
    s = Signals(position=x, velocity=v)
    works = {}
    for damping in (0.005, 0.3):
        effect = make_effect("resonance", mass=2.0, frequency=25.0, damping=damping)
        force = effect.force(s, effect.trace(s, PLANT, DT, np.array([0])), PLANT)
        works[damping] = float(np.sum(force * v) * DT)
    assert works[0.3] < works[0.005] < 0.5 * 2.0 * 0.7**2


# --- friction that goes with pressure -----------------------------------------------------------------------
def test_a_seal_that_the_pressure_lifts_has_a_slope_below_zero() -> None:
    """Forwards friction falls with the pressure, backwards it grows; both slopes are in the sentence."""
    tables = []
    for k, w in enumerate((1.0, 1.7, 2.6)):
        rng, t = np.random.default_rng(k), 5e-3 * np.arange(2400)
        x, v = 0.05 + 0.04 * np.sin(w * t), 0.04 * w * np.cos(w * t)
        gauge = 2.5e5 + 2e5 * np.sin(0.31 * w * t)
        friction = np.where(v > 0.0, 30.0 - 4e-5 * gauge, 12.0 + 3e-5 * gauge)
        F = gauge * np.pi / 4 * 0.025**2 - np.sign(v) * friction + 0.2 * rng.standard_normal(len(t))
        tables.append(pd.DataFrame({"trajectory": str(k), "time": t, "x": x, "P": gauge + 101_325.0, "F": F}))
    library = ["directional_friction", "coulomb_friction", "viscous_friction", "force_bias"]
    diagnosis = diagnose_simulator(pd.concat(tables, ignore_index=True), Cylinder(bore=0.025), library)
    found = sizes(diagnosis, "directional_friction")
    assert (found["forward"], found["backward"]) == pytest.approx((30.0, 12.0), abs=0.5)
    slopes = found["forward_per_pressure"], found["backward_per_pressure"]
    assert slopes == pytest.approx((-4e-5, 3e-5), rel=0.05)
    assert "forward per pressure" in which(diagnosis) and "backward per pressure" in which(diagnosis)


# --- what a port stores -------------------------------------------------------------------------------------
@pytest.mark.parametrize(("unit", "brims"), [("m", True), ("K", False), ("degC", False)])
def test_only_what_has_a_brim_runs_over(unit: str, brims: bool) -> None:
    t = np.arange(400.0)
    watt = 2.0 + np.sin(0.03 * t)
    log = pd.DataFrame({"time": t, "watt": watt, "T": 30.0 + 5.0 * np.sin(0.03 * t - 1.0)})
    ports = [Port("watt", "input", "W"), Port("T", "state", unit)]
    store = FunctionSimulator(lambda t, x, u, p: [u.watt - 0.1 * x["T"]], ports)
    assert ("overflow@T" in evidence_of(log, store).placements) == brims
