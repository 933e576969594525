"""Simulators with ports: what they are, effects at their ports, and the diagnosis of a log against them."""

from __future__ import annotations

import math

import numpy as np
import pandas as pd
import pytest

from pamid.effects import all_effects
from pamid.errors import MissingColumnError, PamidError, ParameterError, ShapeError, UnknownOptionError
from pamid.gap import diagnose_simulator
from pamid.gap.simulated import evidence_of
from pamid.simulators import FunctionSimulator, Port, Simulator, port_effects
from pamid.simulators.dimensions import powers, unit_text
from pamid.simulators.ports import Values

CART = (Port("F", "input", "N"), Port("x", "state", "m"), Port("v", "state", "m/s"))


def cart(friction: str = "none", size: float = 0.0, bias: float = 0.0, runs: int = 4, seed: int = 0) -> pd.DataFrame:
    """A log of a cart of 2 kg on a rail, integrated in steps of a tenth of a sample."""
    rng, parts, dt = np.random.default_rng(seed), [], 0.01
    for k in range(runs):
        t = np.arange(0, 8, dt)
        F = 6 * np.sin((1 + k) * t) + 4 * np.sin(0.7 * t + k)
        x, v, rows = 0.0, 0.0, []
        for f in F:
            rows.append((x, v))
            for _ in range(10):
                loss = {
                    "none": 0.0,
                    "viscous": size * v,
                    "coulomb": size * math.tanh(v / 0.002),
                    "drag": size * v * abs(v),
                }[friction]
                v += dt / 10 * (f - loss) / 2.0
                x += dt / 10 * v
        x, v = np.array(rows).T
        noisy = {"x": x + 1e-5 * rng.standard_normal(len(t)), "v": v + bias + 1e-3 * rng.standard_normal(len(t))}
        parts.append(pd.DataFrame({"trajectory": f"run{k}", "time": t, "F": F, **noisy}))
    return pd.concat(parts, ignore_index=True)


def rail(mass: float = 2.0, tolerance: float = 0.05) -> FunctionSimulator:
    def rates(t, x, u, p):
        return [x.v, u.F / p.m]

    return FunctionSimulator(rates, CART, {"m": (mass, tolerance, "kg")})


LIBRARY = [
    "viscous_friction", "quadratic_drag", "coulomb_friction", "stribeck_friction", "actuator_gain",
    "actuator_dead_zone", "sensor_gain", "actuator_lag",
]  # fmt: skip


# --- ports and values ---------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("wrong", "what"),
    [
        (lambda: Port("two words", "input"), "named"),
        (lambda: Port("a", "socket"), "kind"),
        (lambda: Port("a", "state", start=math.nan), "start"),
        (lambda: FunctionSimulator(print, [Port("a", "input"), Port("a", "output")]), "a names more than one port"),
        (lambda: FunctionSimulator(print, [Port("a", "input")], {"a": 1.0}), "port or parameter"),
        (lambda: FunctionSimulator(print, [Port("j", "joint", velocity="w")]), "velocity"),
        (lambda: FunctionSimulator(print, [Port("a", "input")], {"k": math.inf}), "parameter"),
        (lambda: FunctionSimulator(print, [Port("a", "input")], {"k": (1.0, -0.1)}), "tolerance"),
        (lambda: FunctionSimulator(print, [Port("a", "input")], form="guess"), "form"),
    ],
)
def test_what_is_no_port_or_parameter_is_refused(wrong, what: str) -> None:
    with pytest.raises(PamidError, match=what):
        wrong()


def test_values_go_by_name_place_and_attribute() -> None:
    v = Values.of(np.array([[1.0, 2.0], [3.0, 4.0]]), ("a", "b"))
    a, b = v
    assert np.array_equal(v["b"], v.b) and np.array_equal(b, v[1]) and np.array_equal(a, [1.0, 2.0])
    with pytest.raises(KeyError, match="there are a, b"):
        v["c"]
    with pytest.raises(AttributeError, match="there are a, b"):
        v.c  # noqa: B018


@pytest.mark.parametrize("many", [True, False])
def test_a_function_is_asked_at_many_instants_or_one_by_one(many: bool) -> None:
    def rates(t, x, u, p):
        return {"v": u.F / p.m if many else math.sqrt(abs(float(u["F"]) if u["F"] > 0 else 0.0)) / p[0], "x": x["v"]}

    s = FunctionSimulator(rates, CART, {"m": 2.0})
    x, u, p = np.ones((2, 7)), np.linspace(1, 4, 7)[None], np.full((1, 7), 2.0)
    found = s.rate(np.zeros(7), x, u, p)
    assert np.allclose(found[0], 1.0)
    assert np.allclose(found[1], u[0] / 2 if many else np.sqrt(u[0]) / 2)


def test_a_port_may_be_called_as_arrays_call_something_of_theirs() -> None:
    """T is a temperature or a torque, mean a mean: not what numpy makes of the rows."""
    x = Values.of(np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]), ("T", "mean"))
    assert x.T.tolist() == [1.0, 2.0, 3.0] and x.mean.tolist() == [4.0, 5.0, 6.0]
    assert (2.0 * x).T.shape == (3, 2)  # what is computed has no names
    ports = [Port("T", "input", "N m"), Port("q", "state", "rad"), Port("w", "state", "rad/s")]
    asked: list[int] = []

    def rates(t, x, u, p):
        asked.append(1)
        return [x.w, u.T / p.size - x.q]

    wheel = FunctionSimulator(rates, ports, {"size": 0.5})
    given = np.arange(100.0), np.ones((2, 100)), 3.0 * np.ones((1, 100)), np.full((1, 100), 0.5)
    assert np.allclose(wheel.rate(*given), [[1.0], [5.0]])
    asked.clear()
    wheel.rate(*given)
    assert len(asked) == 1


def test_a_function_that_returns_too_little_says_what_is_missing() -> None:
    s = FunctionSimulator(lambda t, x, u, p: [0.0], CART)
    with pytest.raises(ShapeError, match="x, v"):
        s.rate(np.zeros(3), np.zeros((2, 3)), np.zeros((1, 3)), np.zeros((0, 3)))


# --- effects at ports ---------------------------------------------------------------------------------------
def test_powers_of_the_position_follow_from_what_stays_the_same() -> None:
    library = all_effects()
    assert powers(library["viscous_friction"], "force") == {"coefficient": -1}
    assert powers(library["quadratic_drag"], "force") == {"coefficient": -2}
    assert powers(library["coulomb_friction"], "force")["presliding"] == 1
    assert powers(library["valve_dead_zone"], "command")["width"] == 1
    assert powers(library["end_cap"], "force") is None  # it knows a muscle's geometry
    assert unit_text([("V", 1), ("s", 1), ("rad", -1)]) == "V s/rad"


def test_the_library_learns_nothing_of_effects_at_ports() -> None:
    before = set(all_effects())
    evidence_of(cart(), rail())
    assert set(all_effects()) == before
    kinds = {"joint", "encoder", "input", "output", "chamber", "link", "parameter"}
    assert kinds == {kind for kind, _ in port_effects().values()}


def test_values_at_a_port_are_those_of_its_units() -> None:
    evidence = evidence_of(cart("viscous", 3.0), rail())
    place = evidence.placements["viscous_friction@x"]
    assert place.units == {"coefficient": "N s/m"}
    made = place.effect(**place.inward({"coefficient": 3.0}))
    s = place.signals({"v": np.array([0.5])})
    assert place.force(made, s, None) == pytest.approx([-1.5])
    assert place.outward(place.inward({"coefficient": 3.0})) == pytest.approx({"coefficient": 3.0})


@pytest.mark.parametrize("lowest", [0.0, -1.0])
def test_a_dead_zone_has_two_sides_where_its_command_has(lowest: float) -> None:
    """Commands of one sign tell one edge alone: its width and its skew would be any two numbers that make it."""
    log = cart()
    log["F"] = np.maximum(log["F"], lowest)
    zone = evidence_of(log, rail()).placements["actuator_dead_zone@F"]
    assert ("skew" in [p.name for p in zone.effect.parameters]) == (lowest < 0.0)


# --- diagnoses ----------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("friction", "size", "effect", "parameter"),
    [("viscous", 3.0, "viscous_friction", "coefficient"), ("drag", 2.0, "quadratic_drag", "coefficient"),
     ("coulomb", 1.5, "coulomb_friction", "amplitude")],
)  # fmt: skip
def test_friction_on_a_rail_is_named_with_its_size(friction: str, size: float, effect: str, parameter: str) -> None:
    found = diagnose_simulator(cart(friction, size), rail(), LIBRARY)
    assert found.verdict in ("cause", "class") and found.causes[0].effects[0] == effect
    assert found.causes[0].where[0] == "x"
    assert found.causes[0].parameters[parameter].value == pytest.approx(size, rel=0.06)
    # The corrected simulator closes on another log what the diagnosis said of this one.
    assert isinstance(found.corrected, Simulator)
    other = cart(friction, size, seed=1)
    before, after = (float(np.mean(np.square(evidence_of(other, s).value))) for s in (rail(), found.corrected))
    assert 1.0 - after / before >= found.closure[0].closed_share - 0.02


def test_no_gap_is_none_and_a_mass_within_its_tolerance_is_no_gap() -> None:
    assert diagnose_simulator(cart(), rail(), LIBRARY).verdict == "none"
    assert diagnose_simulator(cart(), rail(1.94), LIBRARY).verdict == "none"


def test_two_sensors_of_one_motion_are_held_against_each_other() -> None:
    log = cart()
    assert evidence_of(log, rail()).equations == ["x", "v"]
    # No force knows of the position: only the velocity tells that its sensor is wrong by 5 %.
    faulty = log.assign(x=1.05 * log["x"])
    found = diagnose_simulator(faulty, rail(), ["viscous_friction", "actuator_gain", "sensor_gain", "sensor_bias"])
    assert (found.causes[0].effects[0], found.causes[0].where[0]) == ("sensor_gain", "x")
    assert found.causes[0].parameters["deviation"].value == pytest.approx(0.05, rel=0.05)
    # A position that is read half a step late is no gap: clocks are known to that; the log has a twentieth of its own.
    found = diagnose_simulator(log.assign(x=log["x"] - 0.005 * log["v"]), rail(), LIBRARY)
    assert found.verdict == "none" and found.deviations["skew of v"] == pytest.approx(0.9, abs=0.05)


def test_a_mass_that_is_hardly_known_is_found_where_nothing_is_straight_on_the_way() -> None:
    found = diagnose_simulator(cart(), rail(1.0, 1.5), LIBRARY)
    assert found.verdict == "none" and found.deviations["m"] == pytest.approx(1.0 / 1.5, rel=0.02)  # 2 kg, not 1
    assert found.nominal is not None and found.nominal.get("m") == 1.0


def test_a_command_that_saturates_once_is_a_gap() -> None:
    rng, runs = np.random.default_rng(2), []
    for k in range(4):
        t = np.arange(0, 8, 0.01)
        F = 5 * np.sin((1 + k) * t) + (25 * ((t > 3) & (t < 3.2)) if k == 2 else 0.0)
        v = np.concatenate([[0.0], np.cumsum(np.clip(F, -12, 12)[:-1] / 2.0 * 0.01)])
        x = np.concatenate([[0.0], np.cumsum(0.01 * (v[1:] + v[:-1]) / 2)])
        noisy = {"x": x + 1e-5 * rng.standard_normal(len(t)), "v": v + 1e-3 * rng.standard_normal(len(t))}
        runs.append(pd.DataFrame({"trajectory": str(k), "time": t, "F": F, **noisy}))
    found = diagnose_simulator(pd.concat(runs), rail(), ["actuator_saturation", "actuator_gain", "viscous_friction"])
    assert found.causes[0].effects[0] == "actuator_saturation"
    assert found.causes[0].parameters["limit"].value == pytest.approx(12.0, rel=0.02)


def test_what_runs_over_runs_on_into_the_tank_below() -> None:
    rng, runs = np.random.default_rng(3), []
    for k in range(3):
        t = np.arange(0, 1200, 4.0)
        u, h, rows = 2.5 + 2.2 * np.sin((1 + k) * t / 300) + 0.3 * np.sin(t / 40), np.array([4.0, 4.0]), []
        for pump in u:
            rows.append(h)
            for _ in range(8):
                over, out = 0.05 * max(h[0] - 6.0, 0.0), 0.05 * np.sqrt(np.maximum(h, 0.0))
                h = h + 0.5 * np.array([0.04 * pump - out[0] - over, out[0] - out[1] + 0.7 * over])
        y = np.array(rows) + 2e-3 * rng.standard_normal((len(t), 2))
        runs.append(pd.DataFrame({"trajectory": str(k), "time": t, "u": u, "h1": y[:, 0], "h2": y[:, 1]}))

    def rates(t, x, u, p):
        one, two = np.sqrt(np.maximum(x.h1, 0.0)), np.sqrt(np.maximum(x.h2, 0.0))
        return [p.k4 * u.u - p.k * one, p.k * one - p.k * two]

    ports = [Port("u", "input", "V"), Port("h1", "state", "cm"), Port("h2", "state", "cm")]
    tanks = FunctionSimulator(rates, ports, {"k": (0.05, 0.05), "k4": (0.04, 0.05)})
    found = diagnose_simulator(pd.concat(runs), tanks, ["overflow", "leakage", "actuator_gain"])
    values = found.causes[0].parameters
    assert (found.causes[0].effects[0], found.causes[0].where[0]) == ("overflow", "h1")
    assert values["level"].value == pytest.approx(6.0, rel=0.02)
    assert values["coefficient"].value == pytest.approx(0.05, rel=0.1)
    assert values["returned"].value == pytest.approx(0.7, abs=0.1)


def test_what_a_log_lacks_is_said() -> None:
    log = cart()
    with pytest.raises(MissingColumnError, match="F"):
        diagnose_simulator(log.drop(columns="F"), rail())
    with pytest.raises(MissingColumnError, match="no state and no output"):
        diagnose_simulator(log.drop(columns=["x", "v"]), rail())
    with pytest.raises(UnknownOptionError, match="sofa"):
        diagnose_simulator(log, rail(), ["sofa"])
    with pytest.raises(ParameterError, match="no port"):
        rail().port("sofa")


def test_where_noise_hides_accelerations_whole_paths_are_predicted() -> None:
    rng, runs, g = np.random.default_rng(1), [], 9.81
    for k in range(4):  # thrown upwards against a linear drag of 0.3 1/s, watched 15 times a second
        t = np.arange(0, 3, 1 / 15)
        end = -g / 0.3
        h = end * t + (3.0 * k - end) / 0.3 * (1 - np.exp(-0.3 * t))
        runs.append(pd.DataFrame({"trajectory": str(k), "time": t, "h": h + 0.05 * rng.standard_normal(len(t))}))
    fall = FunctionSimulator(
        lambda t, x, u, p: [x.v, -p.g + 0.0 * x.v],
        [Port("h", "state", "m"), Port("v", "state", "m/s", column="not logged")],
        {"g": (g, 0.0, "m/s^2")},
    )
    found = diagnose_simulator(pd.concat(runs), fall, ["viscous_friction", "quadratic_drag", "coulomb_friction"])
    assert found.causes[0].effects[0] == "viscous_friction"
    assert found.causes[0].parameters["coefficient"].value == pytest.approx(0.3, rel=0.1)


def test_a_simulator_behind_the_face_of_an_estimator() -> None:
    from pamid.estimators import GapDiagnoser

    log, later = cart("viscous", 3.0), cart("viscous", 3.0, seed=1)
    columns = ["time", "F", "x"]
    diagnoser = GapDiagnoser(rail(), ["viscous_friction", "coulomb_friction", "actuator_gain"], random_state=0)
    diagnoser.fit(log[columns], log["v"], groups=log["trajectory"])
    assert diagnoser.causes_[0].effects == ("viscous_friction",) and diagnoser.corrected_.effects
    v = diagnoser.predict(later[columns], groups=later["trajectory"])
    assert float(np.std(v - later["v"])) < 3e-3  # noise is 1e-3; the nominal simulator is off by more than 1 m/s


def test_a_function_of_whole_runs_is_asked_by_name_or_place_and_seldom() -> None:
    rng, asked = np.random.default_rng(4), []

    def heated(u, p, x0):  # a bath with a heater: two stores in series, 1 s a sample
        asked.append(u)
        T, out = [float(x0[0]), float(x0[1])], []
        for watt in np.asarray(u[0]):
            out.append(T[1])
            T[0] += 0.1 * (p[0] * float(watt) - T[0])
            T[1] += 0.05 * (T[0] - T[1])
        return [np.array(out)]

    ports = [Port("watt", "input", "W"), Port("first", "state", "K"), Port("second", "state", "K"),
             Port("bath", "output", "K")]  # fmt: skip
    runs = []
    for k in range(3):
        watt = 2.0 + np.sin(np.arange(400) * 0.03 * (k + 1)) + np.sin(np.arange(400) * 0.011)
        [y] = heated([0.8 * watt], [1.5], [1.0, 1.0])
        noisy = y + 2e-3 * rng.standard_normal(400)
        runs.append(pd.DataFrame({"trajectory": str(k), "time": np.arange(400.0), "watt": watt, "bath": noisy}))
    asked.clear()
    bath = FunctionSimulator(heated, ports, {"gain": (1.5, 0.05, "K/W")}, form="run")
    found = diagnose_simulator(pd.concat(runs), bath, ["actuator_gain", "actuator_lag", "sensor_gain", "sensor_lag"])
    assert np.array_equal(asked[0]["watt"], asked[0][0]) and np.array_equal(asked[0]["time"], np.arange(400.0))
    assert found.verdict == "class" and set(found.causes[0].effects) == {"actuator_gain", "sensor_gain"}
    assert len(asked) <= 120 * len(runs)  # 60 are wanted


def test_a_joint_of_an_output_is_refused_with_the_states_to_name():
    ports = [
        Port("F", "input", "N"), Port("a", "state", "m", column="not logged"),
        Port("b", "state", "m/s", column="not logged either"), Port("q", "output", "m"), Port("w", "output", "m/s"),
        Port("slide", "joint", "N", position="q", velocity="w"),
    ]  # fmt: skip
    simulator = FunctionSimulator(
        lambda t, x, u, p: [x.b, u.F - 2.0 * x.b - p.k * x.a], ports, {"k": 50.0}, output=lambda t, x, u, p: [x.a, x.b]
    )
    t, rng = 0.01 * np.arange(400), np.random.default_rng(0)
    F = np.sin(3.0 * t)
    log = pd.DataFrame({"trajectory": "1", "time": t, "F": F, "q": 0.02 * F, "w": 0.06 * np.cos(3.0 * t)})
    log[["q", "w"]] += 1e-4 * rng.standard_normal((400, 2))
    with pytest.raises(ParameterError, match="position of the joint 'slide' is 'q', which is not a state"):
        diagnose_simulator(log, simulator)
