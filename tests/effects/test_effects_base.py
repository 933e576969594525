"""Every effect keeps the contract of `pamid.effects.base`; each memory is exact for straight signals."""

from __future__ import annotations

import importlib
import math
import pickle
import sys

import numpy as np
import pytest

from pamid.bench import BenchParameters
from pamid.effects import Effect, Parameter, Signals, all_effects, make_effect, parameter
from pamid.effects._memory import bouc_wen, dahl, relax, stopped, stops_along
from pamid.effects.base import EQUATIONS, KINDS
from pamid.effects.plant import Plant
from pamid.effects.registry import chosen_effects
from pamid.errors import ImplausibleParameterError, ParameterError, UnknownOptionError, UnknownParameterError

EFFECTS = list(all_effects())
VOCABULARY = [
    "coulomb_friction",
    "viscous_friction",
    "stribeck_friction",
    "hysteresis",
    "bladder_elasticity",
    "thread_extensibility",
    "end_cap",
    "creep",
    "leakage",
    "heat_transfer",
    "polytropic_exponent",
    "dead_volume",
    "gas_temperature",
    "valve_conductance",
    "valve_dead_zone",
    "valve_saturation",
    "valve_asymmetry",
    "valve_lag",
    "transport_delay",
    "supply_droop",
    "pressure_bias",
    "pressure_gain",
    "pressure_lag",
    "force_bias",
    "force_gain",
    "force_lag",
    "flow_bias",
    "flow_lag",
    "angle_gain",
    "angle_delay",
    "length",
    "diameter",
    "braid_angle",
    "braid_geometry",
    "inertia",
    "gravity",
    "joint_damping",
    "quadratic_drag",
    "backlash",
    "load_dependent_friction",
    "bladder_preload",
    "threshold_pressure",
    "slack",
    "tube",
    "pressure_hysteresis",
    "pressure_relaxation",
    "prandtl_ishlinskii",
    "actuator_hysteresis",
    "actuator_backlash",
    "maxwell",
    "directional_friction",
    "torque_loss",
    "back_emf",
    "output_saturation",
    "overflow",
    "quantisation",
    "rectification",
    "compliance",
    "effective_contraction",
    "constant_area",
    "directional_damping",
    "slew_rate",
    "resonance",
    "periodic_force",
    "heat_loss",
]
PLANT = BenchParameters.for_muscle("B").plant()
DT = 1e-3


def signals(n=400, shape=(2,), seed=0):
    t = np.arange(n) * DT
    phase = np.random.default_rng(seed).uniform(0, 6, shape)
    w = 2 * np.pi * 3
    arg = w * t.reshape(-1, *([1] * len(shape))) + phase
    eps, P = 0.12 + 0.05 * np.sin(arg), 3e5 + 5e4 * np.cos(arg)
    return Signals(
        time=t,
        position=eps,
        velocity=0.05 * w * np.cos(arg),
        pressure=P,
        pressure_rate=-5e4 * w * np.sin(arg),
        command=0.3 * np.sin(arg),
        flow=1e-3 * np.sin(arg),
        force=300 + 10 * np.sin(arg),
    )


def test_the_library_holds_the_vocabulary():
    assert set(VOCABULARY) <= set(EFFECTS)


def test_an_effect_that_states_no_equations_has_those_that_its_hooks_enter():
    class Both(Effect):
        size = parameter("N", 0.0, 1.0, 0.5, "size")

        def command(self, u, s, x, plant):
            return u

        def force(self, s, x, plant):
            return 0.0

    assert Both.equations == ()  # of ports alone
    named = type("Named", (Both,), {"name": "both_at_once"})
    del Effect.registry["both_at_once"]
    assert named.equations == ("force", "valve") and named.narrowed().equations == named.equations


@pytest.mark.parametrize("name", EFFECTS)
def test_contract(name):
    effect = make_effect(name)
    assert effect.hooks() and effect.family and effect.source
    assert effect.equations and set(effect.equations) <= set(EQUATIONS)
    assert effect.site in ("muscle", "joint")
    for p in effect.parameters:
        assert p.lower <= p.nominal <= p.upper and p.unit and p.description
    assert pickle.loads(pickle.dumps(effect)) == effect
    assert effect.replace() == effect
    s = signals()
    starts = np.array([0, 150])
    x = effect.trace(s, PLANT, DT, starts)
    if effect.n_states:
        assert x.shape[1:] == (400, 2)
        # what lies before a border leaves no mark behind it, and the other way round
        alone = effect.trace(s.at(slice(150, None)), PLANT, DT, np.array([0]))
        np.testing.assert_allclose(x[:, 150:], alone, rtol=1e-12, atol=1e-12)
    read = s.pressure if effect.n_states else s.pressure - 3e5  # of both signs, but for what remembers the pressure
    changed = {
        "force": lambda: effect.force(s, x, PLANT),
        "flow": lambda: sum(effect.flow(s, x, PLANT)) + 0.0 * s.pressure,
        "command": lambda: effect.command(s.command, s, x, PLANT) - s.command,
        "supply": lambda: effect.supply(7e5, s, x, PLANT) - 7e5,
        "torque": lambda: effect.torque(s, x, PLANT),
        "measure": lambda: effect.measure(read, x) - read,
        "adjust": lambda: np.array([*effect.adjust(BenchParameters.for_muscle("B").values()).values()]),
        "valve": lambda: effect.valve(s, x, PLANT),
    }
    if name != "valve_saturation":  # its nominal limit lies above these commands
        for hook in effect.hooks():
            if hook != "restore":
                value = changed[hook]()
                assert np.all(np.isfinite(value)) and np.max(np.abs(value)) > 0


@pytest.mark.parametrize("name", [n for n in EFFECTS if make_effect(n).n_states and not n.endswith("_delay")])
def test_memory_needs_no_small_steps_when_signals_are_straight(name):
    """One step over a straight piece equals many small ones: the property that makes `step` safe in a simulator."""
    effect = make_effect(name)
    a, b = signals().at(0), signals().at(20)
    if "pressure" in effect.roles and name == "heat_transfer":
        b.pressure = a.pressure * 1.0001  # straight in log P
    x0 = effect.start(a, PLANT, DT)

    def between(f):
        return Signals(
            *(None if u is None or r == "time" else u + f * (v - u) for r, u, v in ((r, getattr(a, r), getattr(b, r))
              for r in ("time", "position", "velocity", "pressure", "pressure_rate", "command", "flow", "force")))
        )  # fmt: skip

    if name == "valve_lag":
        b.command = a.command
    once = effect.step(x0, a, between(1.0), 0.02, PLANT)
    x = x0
    for k in range(50):
        x = effect.step(x, between(k / 50), between((k + 1) / 50), 0.02 / 50, PLANT)
    np.testing.assert_allclose(x, once, rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("name", [n for n, c in all_effects().items() if c.path_dependent])
def test_the_memory_of_a_path_depends_on_no_amplitude(name):
    """Fits keep it while amplitudes change."""
    cls, start = all_effects()[name], np.zeros(1, dtype=int)
    plant = BenchParameters.for_muscle("B").plant()
    s = Signals(position=0.1 + 0.05 * np.sin(np.linspace(0, 12, 600))[:, None])
    more = {p.name: 0.5 * (p.lower + p.upper) for p in cls.parameters if p.linear}
    np.testing.assert_array_equal(cls().trace(s, plant, 1e-3, start), cls(**more).trace(s, plant, 1e-3, start))


def test_bouc_wen_solves_its_equation():
    rng = np.random.default_rng(1)
    for shape in (0.5, 0.7, 1.0):
        z0, d = rng.uniform(-0.99, 0.99, 50), rng.uniform(-0.03, 0.03, 50)
        z, m = z0.copy(), 20000
        for _ in range(m):
            z = z + d / m / 0.01 * (1 - np.abs(z) * (shape * np.sign(z * d) + 1 - shape))
        np.testing.assert_allclose(bouc_wen(z0, d, 0.01, shape), z, atol=3e-4)
    np.testing.assert_allclose(bouc_wen(z0, d, 0.01, 1.0), dahl(z0, d, 0.01), atol=1e-9)


def test_relax_follows_a_ramp():
    tau, slope, T = 0.05, 2.0, 0.13
    want = slope * (T - tau * (1 - math.exp(-T / tau))) + 0.7 * math.exp(-T / tau)
    assert relax(0.7, 0.0, slope * T, T, tau) == pytest.approx(want, rel=1e-12)


def test_thread_extensibility_derives_from_one_volume():
    """Force and flow come from V(ε, P); checked against finite differences of that volume."""
    effect = make_effect("thread_extensibility", compliance=5e-8)

    def volume(eps, P):
        L = PLANT.rest_length * (1 - eps)
        b = PLANT.thread_length * (1 + 5e-8 * (P - PLANT.atmospheric_pressure))
        return PLANT.shape * L * (b * b - L * L)

    eps, P, deps, dP, h = 0.15, 3.3e5, 0.4, 2e6, 1e-6
    V_eps = (volume(eps + h, P) - volume(eps - h, P)) / (2 * h)
    V_P = (volume(eps, P + 10) - volume(eps, P - 10)) / 20
    s = Signals(position=np.array(eps), velocity=np.array(deps), pressure=np.array(P))
    force = (P - PLANT.atmospheric_pressure) / PLANT.rest_length * (V_eps - PLANT.volume_slope(eps))
    assert effect.force(s, None, PLANT) == pytest.approx(force, rel=1e-5)
    a, b = effect.flow(s, None, PLANT)
    g, RT = PLANT.heat_capacity_ratio, PLANT.RT
    want = dP * (volume(eps, P) - PLANT.volume(eps)) / (g * RT)
    want += P * ((V_eps - PLANT.volume_slope(eps)) * deps + V_P * dP) / RT
    assert a + b * dP == pytest.approx(want, rel=1e-5)


@pytest.mark.parametrize(("carried", "most"), [(0.0, 0.02), (1.0, 0.05)])
def test_heat_transfer_makes_slow_changes_isothermal_and_leaves_fast_ones_adiabatic(carried, most):
    """What leaves while 5 % of the pressure go to and fro takes its share of a small excess along."""
    effect = make_effect("heat_transfer", time_constant=0.05, carried=carried)
    for w, isothermal in ((0.5, True), (4000.0, False)):
        t = np.linspace(0, 20 * np.pi / w, 40001)
        P = 3e5 * np.exp(0.05 * np.sin(w * t))
        dP = 0.05 * w * np.cos(w * t) * P
        s = Signals(position=0.1 + 0 * t, velocity=0 * t, pressure=P, pressure_rate=dP)
        x = effect.trace(s, PLANT, t[1] - t[0], np.array([0]))
        a, b = effect.flow(s, x, PLANT)
        extra = a + b * dP
        V, g = PLANT.volume(0.1), PLANT.heat_capacity_ratio
        full = dP * V / PLANT.RT * (1 - 1 / g)
        ratio = np.sqrt(np.mean(extra[20000:] ** 2) / np.mean(full[20000:] ** 2))
        assert ratio == pytest.approx(1.0, abs=0.02) if isothermal else ratio < most


def test_delay_passes_the_mean_of_a_shared_period():
    effect = make_effect("transport_delay", delay=2.5e-3)
    u = np.arange(20.0)
    x = effect.trace(Signals(command=u), PLANT, DT, np.array([0]))
    np.testing.assert_allclose(x[0, 5:], u[5:] - 2.5)
    y = effect.start(Signals(command=u[0]), PLANT, DT)
    for k in range(1, 20):
        y = effect.step(y, Signals(command=u[k - 1]), Signals(command=u[k]), DT, PLANT)
        assert y[0] == pytest.approx(x[0, k])


def test_the_library_of_a_kind_leaves_out_what_cannot_be_there():
    bench, muscle, motor = (set(chosen_effects("all", kind)) for kind in ("bench", "muscle", "motor"))
    assert "tube" in muscle - bench and "back_emf" in motor - muscle and "leakage" in bench
    assert set(chosen_effects("all")) == set(EFFECTS)
    assert chosen_effects(["back_emf"], "bench") == ["back_emf"], "what is asked for by name is searched"
    by_name = {name for name, cls in all_effects().items() if not cls.kinds}
    by_name -= {"heat_loss"}  # it acts at temperatures, which are ports alone
    assert by_name == {"constant_area"}, "it stands for the geometry that the others correct"
    assert all(set(cls.kinds) <= set(KINDS) for cls in all_effects().values())


def test_stops_are_the_signal_less_its_play():
    rng = np.random.default_rng(2)
    x = np.cumsum(rng.normal(size=(300, 2)), axis=0)
    z = np.zeros((3, 2))
    along = stops_along(x, 2.0, np.array([0]))
    for k in range(1, 300):
        z = stopped(z, x[k] - x[k - 1], 2.0)
        np.testing.assert_allclose(along[:, k], z, atol=1e-12)
    assert np.abs(along).max() == pytest.approx(1.0)


def test_a_threshold_grows_alike_whatever_angle_a_geometry_was_fitted_with():
    effect = make_effect("threshold_pressure", pressure=5e4, growth=1e6)
    s = Signals(position=np.array([0.0, 0.05, 0.1]), pressure=np.full(3, 7e5))
    left = [effect.braid_pressure(s, Plant.of_muscle(0.2, 0.01, np.radians(angle))) for angle in (25.0, 48.0)]
    np.testing.assert_array_equal(*left)
    assert np.all(np.diff(left[0]) < -1e5)


def test_a_muscle_of_one_area_pulls_alike_at_all_contractions():
    effect = make_effect("constant_area", area=8e-4, growth=1.2e6, displacement=3e-3, onset=1e3)
    short, long = (Plant.of_muscle(length, 0.01) for length in (0.2, 0.4))
    eps, P = np.array([0.0, 0.05, 0.1]), short.atmospheric_pressure + 6e5

    def tension(pressure, plant):
        s = Signals(position=eps, pressure=np.full(3, pressure))
        model = (pressure - plant.atmospheric_pressure) * plant.volume_slope(eps) / plant.rest_length
        return model + effect.force(s, None, plant)

    np.testing.assert_allclose(tension(P + 1e4, short) - tension(P, short), 8e-4 * 1e4, rtol=1e-4)
    np.testing.assert_allclose(tension(short.atmospheric_pressure, short), 0.0, atol=1.0)
    held = [effect.threshold(Signals(position=eps), plant) for plant in (short, long)]
    assert held[0][0] == pytest.approx(2.0 * held[1][0], rel=0.1), "what the ends take falls with the length"
    assert np.all(np.diff(held[0], 2) < 0.0), "each share of the circumference takes the same pressure"


def test_a_bladder_presses_above_its_threshold_alone():
    effect = make_effect("threshold_pressure", pressure=1e5, growth=1e6, onset=0.0)
    P = PLANT.atmospheric_pressure + np.array([5e4, 1e5, 3e5])
    rest = Signals(position=np.zeros(3), pressure=P)
    slope = PLANT.volume_slope(0.0) / PLANT.rest_length
    np.testing.assert_allclose(
        effect.force(rest, None, PLANT), -np.minimum(P - PLANT.atmospheric_pressure, 1e5) * slope
    )
    short = rest.with_(position=np.full(3, 0.1))
    assert effect.force(short, None, PLANT)[2] < -1e5 * PLANT.volume_slope(0.1) / PLANT.rest_length


@pytest.mark.parametrize("name", [n for n, c in all_effects().items() if c.restore is not Effect.restore])
def test_restore_inverts_measure(name):
    effect = make_effect(name)
    role = {"q": "position", "P": "pressure", "F": "force", "mdot": "flow"}[effect.channel]
    s = signals(n=1000)
    value = getattr(s, role)
    x = effect.trace(s, PLANT, DT, np.array([0]))
    back = effect.restore(effect.measure(value, x), DT, np.array([0]))
    inner = slice(60, -60)
    assert np.max(np.abs(back[inner] - value[inner])) < 2e-3 * np.ptp(value)


def test_errors_name_what_is_wrong():
    with pytest.raises(UnknownOptionError, match="coulomb_friction"):
        make_effect("coulomb")
    with pytest.raises(UnknownParameterError, match="only amplitude"):
        make_effect("hysteresis", ampl=1.0)
    for bad in (-1.0, math.nan, math.inf, "3", True):
        with pytest.raises((ImplausibleParameterError, TypeError)):
            make_effect("hysteresis", amplitude=bad)


def test_a_user_adds_an_effect_by_defining_it():
    class Wobble(Effect):
        name = "wobble"
        family = "elasticity"
        equations = ("force",)
        roles = ("position",)
        source = "none"
        parameters = (Parameter("amplitude", "N", 0.0, 10.0, 1.0, "of the wobble", linear=True),)

        def force(self, s, x, plant):
            return self.amplitude * np.sin(100 * s.position)

    try:
        assert make_effect("wobble", amplitude=2.0).force(Signals(position=0.0), None, PLANT) == 0.0
        with pytest.raises(ParameterError, match="named 'leakage'"):
            type("Copy", (Effect,), {"name": "leakage"})
    finally:
        del Effect.registry["wobble"]


@pytest.mark.parametrize("name", [n for n in EFFECTS if all_effects()[n].n_states])
def test_memory_along_a_log_is_that_of_single_steps(name):
    """Whatever shortcut an effect takes over a log, it remembers what it would sample by sample."""
    more = {
        "supply_droop": {"regulation": 3e8, "time_constant": 0.01},
        "hysteresis": {"spread": 1.0},
        "coulomb_friction": {"exponent": 0.4},
        "creep": {"settled": 0.3},
        "valve_lag": {"second": 0.6},
    }
    effect, rng, n = make_effect(name, **more.get(name, {})), np.random.default_rng(0), 300
    x = 0.12 + 0.0025 * np.cumsum(rng.normal(size=(n, 2)), axis=0)
    x[100:150] = x[100]  # at rest
    s = Signals(
        time=np.arange(n)[:, None] * DT,
        position=x,
        velocity=np.gradient(x, DT, axis=0),
        pressure=3e5 + 1e5 * np.sin(30 * x),
        command=np.clip(rng.normal(size=(n, 2)), -1, 1),
        flow=1e-4 * np.sin(20 * x),
        force=100 * np.cos(20 * x),
    )
    starts = np.array([0, 90, 200])
    along = effect.trace(s, PLANT, DT, starts)
    state = None
    for k in range(n):
        fresh = k in starts
        state = effect.start(s.at(k), PLANT, DT) if fresh else effect.step(state, s.at(k - 1), s.at(k), DT, PLANT)
        m = min(len(state), len(along))  # a delay keeps no more of its past along a log than the output
        np.testing.assert_allclose(along[:m, k], state[:m], rtol=1e-9, atol=1e-12)


def test_parameters_are_attributes_that_a_subclass_adds_to_restates_or_fixes():
    class Spring(Effect):
        stiffness = parameter("N", 0.0, 10.0, 1.0, "force per travel", linear=True)
        preload = parameter("N", 0.0, 5.0, 0.0, "force at rest")

    class Stiff(Spring):
        stiffness = parameter("N", 5.0, 10.0, 7.0, "force per travel")
        damping = parameter("N s", 0.0, 1.0, 0.5, "force per speed")
        preload = 2.0

    assert [(p.name, p.nominal) for p in Spring.parameters] == [("stiffness", 1.0), ("preload", 0.0)]
    assert [p.name for p in Stiff.parameters] == ["stiffness", "damping"]
    assert (Stiff().stiffness, Stiff(damping=0.1).damping, Stiff().preload) == (7.0, 0.1, 2.0)
    bound = Spring.narrowed(["preload"], prior=-1.0)
    assert ([p.name for p in bound.parameters], bound().preload, bound.prior) == (["stiffness"], 0.0, -1.0)
    assert Spring().unchecked(stiffness=99.0).stiffness == 99.0
    with pytest.raises(ImplausibleParameterError, match="stiffness"):
        Stiff(stiffness=1.0)


def test_an_old_module_of_one_effect_serves_one_version():
    sys.modules.pop("pamid.effects.creep", None)
    with pytest.warns(FutureWarning, match=r"pamid\.effects\.relaxation"):
        assert importlib.import_module("pamid.effects.creep").Creep is all_effects()["creep"]
    with pytest.raises(ModuleNotFoundError):
        importlib.import_module("pamid.effects.no_such_effect")
