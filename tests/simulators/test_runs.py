"""How often a simulator runs: what small changes do follows from runs that were made, of states or of whole runs."""

import numpy as np
import pandas as pd
import pytest

from pamid.gap import at_ports, diagnose_simulator
from pamid.gap.residuals.shooting import ShootingEvidence
from pamid.simulators import FunctionSimulator, Port
from pamid.simulators.port_log import port_log

DT = 2.0


def rates(t, x, u, p):
    one, two = np.sqrt(np.maximum(x.h1, 0.0)), np.sqrt(np.maximum(x.h2, 0.0))
    return [p.k1 * u.pump - p.k2 * one, p.k2 * one - p.k3 * two]


def ported():
    ports = [
        Port("pump", "input", "V"), Port("h1", "state", "cm", start=3.0, column="not logged"),
        Port("h2", "state", "cm", column="level"),
    ]  # fmt: skip
    return ports, {"k1": (0.06, 0.05), "k2": (0.05, 0.05), "k3": (0.05, 0.05)}


def tanks():
    return FunctionSimulator(rates, *ported())


def whole(u, p, x0):
    h, out = x0.copy(), []
    for pump in u["pump"]:
        out.append(h[1])
        for _ in range(2):
            one, two = np.sqrt(np.maximum(h, 0.0))
            h = h + DT / 2 * np.array([p.k1 * pump - p.k2 * one, p.k2 * one - p.k3 * two])
    return [np.array(out)]


def whole_tanks():
    ports, numbers = ported()
    states = [Port("h1", "state", "cm", start=3.0), Port("h2", "state", "cm", start=3.0)]
    return FunctionSimulator(whole, [ports[0], Port("level", "output", "cm"), *states], numbers)


def tank_log(k3=0.05, dead=0.0):
    """Two tanks, the lower one read, whose outlet may be another and whose pump may start late."""
    rng, runs = np.random.default_rng(1), []
    for run in range(3):
        h, rows = np.array([3.0, 3.0]), []
        pump = np.repeat(rng.uniform(1.2, 3.6, 10), 20)
        for u in pump:
            rows.append(h[1])
            for _ in range(8):
                one, two = np.sqrt(np.maximum(h, 0.0))
                h = h + DT / 8 * np.array([0.06 * max(u - dead, 0.0) - 0.05 * one, 0.05 * one - k3 * two])
        level = np.array(rows) + 0.01 * rng.standard_normal(len(pump))
        table = {"trajectory": str(run), "time": DT * np.arange(len(pump)), "pump": pump, "level": level}
        runs.append(pd.DataFrame(table))
    return pd.concat(runs, ignore_index=True)


@pytest.mark.parametrize("make", [tanks, whole_tanks])
def test_what_small_changes_do_follows_without_runs(make):
    evidence = ShootingEvidence(port_log(tank_log(), make()), make())
    about = np.zeros(len(evidence.free))
    small = {
        "actuator_gain@pump": {"deviation": 0.01}, "actuator_lag@pump": {"time_constant": 0.5},
        "parameter_deviation@k3": {"deviation": 0.01}, "parameter_drift@k3": {"drift": 0.01},
    }  # fmt: skip
    changes = {name: evidence.change({name: values}, {}, about) for name, values in small.items()}
    before = evidence.simulated
    for name, values in small.items():
        exact = evidence.z({name: values}) - evidence.z0
        assert np.linalg.norm(changes[name] - exact) < 0.06 * np.linalg.norm(exact), name
    assert evidence.simulated - before >= 3.0
    # Another size of the same, and a sum of what is known, are no runs any more.
    before = evidence.simulated
    evidence.change({"actuator_gain@pump": {"deviation": 0.02}}, {}, about)
    evidence.change({"parameter_deviation@k3": {"deviation": -0.02}}, {}, about)
    assert evidence.simulated - before < 1.0


@pytest.mark.parametrize(("make", "most"), [(tanks, 240.0), (whole_tanks, 160.0)])
def test_one_cause_takes_not_too_many_runs(make, most, monkeypatch):
    """Refits of causes that explain as much are asked for in an order that rounding decides: 134 or 150 runs."""
    kept, of = [], at_ports.evidence_of
    monkeypatch.setattr(at_ports, "evidence_of", lambda *a, **k: kept.append(of(*a, **k)) or kept[-1])
    found = diagnose_simulator(tank_log(k3=0.06), make())
    named = zip(found.causes[0].effects, found.causes[0].where, strict=True)  # a gain of the pump says the same
    assert ("parameter_deviation", "k3") in named
    assert kept[0].simulated <= most


def test_repeated_runs_of_a_simulator_without_states_say_how_large_the_noise_is():
    def tank(u, p, x0):
        h, out = 3.0, []
        for pump in u["pump"]:
            out.append(h)
            h = h + DT * (p.k1 * pump - p.k2 * np.sqrt(max(h, 0.0)))
        return [np.array(out)]

    ports = [Port("pump", "input", "V"), Port("level", "output", "cm")]
    simulator = FunctionSimulator(tank, ports, {"k1": 0.06, "k2": 0.05}, form="run")
    rng, t = np.random.default_rng(2), DT * np.arange(200)
    pump = 3.0 + np.sin(0.02 * t)
    [level] = tank({"pump": pump}, type("P", (), {"k1": 0.06, "k2": 0.05}), np.zeros(0))
    runs = [
        pd.DataFrame({"trajectory": f"{k}", "time": t, "pump": pump, "level": level + rng.normal(0, 0.02, len(t))})
        for k in range(2)
    ]
    evidence = ShootingEvidence(port_log(pd.concat(runs), simulator), simulator)
    assert evidence.noise.mean() == pytest.approx(0.02 / np.sqrt(evidence.n), rel=0.5)


def test_whole_runs_without_states_are_fitted_where_they_do_not_follow_the_log():
    def scaled(u, p, x0):
        return [p.gain * u["a"]]

    simulator = FunctionSimulator(
        scaled, [Port("a", "input", "V"), Port("y", "output", "m")], {"gain": (2.0, 0.05)}, form="run"
    )
    a = np.sin(np.arange(300) / 9.0)
    y = 3.0 * a + 1e-3 * np.random.default_rng(0).standard_normal(300)
    log = port_log(pd.DataFrame({"trajectory": "run", "time": 0.02 * np.arange(300), "a": a, "y": y}), simulator)
    assert max(ShootingEvidence(log, simulator, refit=True).without_causes().scales) > 10.0  # the gap is there


def test_a_run_that_failed_says_nothing_of_others():
    def fails(u, p, x0):
        return [x * np.where(np.max(u["pump"]) > 4.0, np.nan, 1.0) for x in whole(u, p, x0)]

    plain = whole_tanks()
    evidence = ShootingEvidence(port_log(tank_log(), plain), FunctionSimulator(fails, plain.ports, plain.parameters))
    about = np.zeros(len(evidence.free))
    evidence.change({"actuator_gain@pump": {"deviation": 0.4}}, {}, about)
    small = {"actuator_gain@pump": {"deviation": 0.01}}
    exact = evidence.z(small) - evidence.z0
    assert np.linalg.norm(evidence.change(small, {}, about) - exact) < 0.06 * np.linalg.norm(exact)
