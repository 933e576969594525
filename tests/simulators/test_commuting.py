"""Faults that commute with a linear simulator: nobody can tell on which side of it they act."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from pamid.gap import diagnose_simulator
from pamid.simulators import FunctionSimulator, Port
from pamid.simulators.commuting import commuting_paths, delayed_path, rests

STEP = 0.01


def heater(square: float = 0.0) -> FunctionSimulator:
    """Return a first-order plant; with a squared loss it is no longer linear."""
    ports = [Port("u", "input", "V"), Port("y", "state", "K")]
    return FunctionSimulator(lambda t, x, u, p: [(2.5 * u.u - x.y - square * x.y**2) / 0.3], ports, {})


def pole_at(place: str) -> pd.DataFrame:
    rng, runs = np.random.default_rng(5), []
    for run in range(4):
        u = np.repeat(rng.uniform(-4.0, 4.0, 40), 15)
        y, lagged, read, out = 0.0, 0.0, 0.0, []
        for command in u:
            out.append(read if place == "output" else y)
            for _ in range(40):
                h = STEP / 40
                y += h * (2.5 * (lagged if place == "input" else command) - y) / 0.3
                lagged += h * (command - lagged) / 0.06
                read += h * (y - read) / 0.06
        noisy = np.array(out) + 0.03 * rng.standard_normal(len(u))
        runs.append(pd.DataFrame({"trajectory": str(run), "time": STEP * np.arange(len(u)), "u": u, "y": noisy}))
    return pd.concat(runs, ignore_index=True)


@pytest.mark.parametrize("place", ["input", "output"])
@pytest.mark.parametrize("library", ["all", ("actuator_lag", "sensor_lag", "actuator_gain")], ids=["all", "three"])
def test_a_pole_before_or_behind_a_linear_plant_is_one_class(place: str, library: str | tuple[str, ...]) -> None:
    found = diagnose_simulator(pole_at(place), heater(), library)
    [cause] = found.causes
    assert set(cause.effects) == {"actuator_lag", "sensor_lag"}
    for parameters in (cause.parameters, *cause.others):
        assert parameters["time_constant"].value == pytest.approx(0.06, rel=0.06)


def test_only_linear_paths_from_one_input_to_one_reading_commute() -> None:
    rng = np.random.default_rng(0)
    x, u, t = rng.uniform(-1, 1, (1, 50)), rng.uniform(-1, 1, (1, 50)), np.arange(50.0)
    assert commuting_paths(heater(), t, x, u, ["u"], {"y"}) == {"u": "y"}
    assert commuting_paths(heater(0.2), t, x, u, ["u"], {"y"}) == {}
    ports = [Port("u", "input", "N"), Port("x", "state", "m"), Port("v", "state", "m/s")]
    mass = FunctionSimulator(lambda t, x, u, p: [x.v, u.u - x.x], ports, {})
    both = rng.uniform(-1, 1, (2, 50))
    assert commuting_paths(mass, t, both, u, ["u"], {"x"}) == {"u": "x"}
    assert commuting_paths(mass, t, both, u, ["u"], {"x", "v"}) == {}


def test_a_gain_commutes_where_no_weight_acts_beside_its_input() -> None:
    ports = [Port("u", "input", "N"), Port("x", "state", "m"), Port("v", "state", "m/s")]
    u, t = np.ones((1, 50)), np.arange(50.0)
    for weight in (0.0, 9.81):
        drone = FunctionSimulator(lambda t, x, u, p: [x.v, u.u - p.g - x.v], ports, {"g": weight})
        assert rests(drone, t, u, ["u"]) == (weight == 0.0)
        assert not rests(drone, t, u, [])  # an input that stands still is a weight, too


def test_a_delay_commutes_with_any_simulator_that_is_the_same_at_any_time() -> None:
    """A squared loss is the same later; a loss that grows with time is not, and of two readings one may be late."""
    rng = np.random.default_rng(0)
    x, u, t = rng.uniform(-1, 1, (1, 50)), rng.uniform(-1, 1, (1, 50)), np.arange(50.0)
    assert delayed_path(heater(0.2), t, x, u, ["u"], {"u", "y"}) == {"u": "y"}
    ports = [Port("u", "input", "V"), Port("y", "state", "K")]
    ageing = FunctionSimulator(lambda t, x, u, p: [2.5 * u.u - (1.0 + 0.1 * t) * x.y], ports, {})
    assert delayed_path(ageing, t, x, u, ["u"], {"y"}) == {}
    assert delayed_path(heater(0.2), t, x, u, ["u", "w"], {"y"}) == {}


def test_a_late_reading_of_a_nonlinear_plant_is_one_class_with_a_late_command() -> None:
    rng, runs = np.random.default_rng(3), []
    for run in range(3):
        u, y, past = np.repeat(rng.uniform(0.0, 4.0, 40), 15), 0.0, [0.0] * 5
        for command in u:
            past.append(y)
            runs.append((str(run), command, past[-6]))
            for _ in range(20):
                y += STEP / 20 * (2.5 * command - y - 0.2 * y**2) / 0.3
    log = pd.DataFrame(runs, columns=["trajectory", "u", "y"])
    log = log.assign(
        time=STEP * log.groupby("trajectory").cumcount(), y=log["y"] + 0.03 * rng.standard_normal(len(log))
    )
    [cause] = diagnose_simulator(log, heater(0.2), "all").causes
    assert {*zip(cause.effects, cause.where, strict=True)} >= {("actuator_delay", "u"), ("sensor_delay", "y")}
    assert cause.parameters["delay"].value == pytest.approx(5 * STEP, rel=0.1)


def test_so_is_a_late_reading_of_an_angle() -> None:
    """Noise of an angle, of which an acceleration is derived, prefers a command that comes late."""
    rng, dt, runs = np.random.default_rng(8), 0.005, []
    for run in range(3):
        t = dt * np.arange(500)
        torque, q, w, path = 4.0 * np.sin((2.0 + run) * t) + 3.0 * np.sin(7.3 * t + run), 0.0, 0.0, []
        for u in torque:
            path.append(q)
            for _ in range(10):
                w += 0.1 * dt * (u - 6.0 * np.sin(q) - 0.4 * w)
                q += 0.1 * dt * w
        late = np.interp(t - 0.02, t, path) + 1e-4 * rng.standard_normal(len(t))
        runs.append(pd.DataFrame({"trajectory": str(run), "time": t, "torque": torque, "q": late}))
    ports = [Port("torque", "input", "N m"), Port("q", "state", "rad"), Port("w", "state", "rad/s")]
    pendulum = FunctionSimulator(lambda t, x, u, p: [x.w, u.torque - 6.0 * np.sin(x.q) - 0.4 * x.w], ports, {})
    found = diagnose_simulator(pd.concat(runs), pendulum, ["actuator_delay", "sensor_delay", "viscous_friction"])
    [cause] = found.causes
    assert set(cause.effects) == {"actuator_delay", "sensor_delay"}
