"""What was before a log: inputs that were zero, and readings whose fault cannot be undone without their noise."""

import numpy as np
import pandas as pd

import pamid
from pamid.gap.at_ports import DROWNED
from pamid.gap.residuals.choice import PREDICTED_IF, rates_are_hidden
from pamid.gap.simulated import evidence_of
from pamid.simulators import EquationSimulator, Port

CAR = EquationSimulator(
    {"dv/dt": "(F - c*v*abs(v))/m"},
    [Port("F", "input", "N"), Port("v", "state", "m/s")],
    {"m": (1400.0, 0.03, "kg"), "c": (0.42, 0.1, "N s^2/m^2")},
)


def car_log(lag, seed=0):
    """A car whose engine was at rest, where the log begins under a force; its lag is that of a control unit."""
    rng, runs, dt = np.random.default_rng(seed), [], 0.1
    for k in range(4):
        F = 900 + np.repeat(rng.uniform(-2200, 2200, 20), 60) + 300 * np.sin(0.9 * dt * np.arange(1200) + k)
        v, drive, rows = 10.0, 0.0, []
        for f in F:
            drive += (f - drive) * (1 - np.exp(-dt / lag)) if lag else f - drive
            rows.append(v)
            for _ in range(10):
                v += 0.1 * dt * (drive - 0.42 * v * abs(v)) / 1400
        noise = 0.03 * rng.standard_normal(len(F))
        runs.append(
            pd.DataFrame({"trajectory": str(k), "time": dt * np.arange(len(F)), "F": F, "v": np.array(rows) + noise})
        )
    return pd.concat(runs, ignore_index=True)


def test_a_lag_that_was_at_rest_before_the_log_is_one():
    [cause] = pamid.diagnose(car_log(0.35), CAR).causes
    assert cause.effects == ("actuator_lag",) and cause.grade == "sure"
    assert abs(cause.parameters["time_constant"].value - 0.35) < 0.04


def test_what_an_input_was_before_acts_through_a_lag_alone():
    evidence = evidence_of(car_log(0.35), CAR, refit=True)
    k = evidence.free.index("start of F")
    assert not evidence.J[:, k].any()
    column = evidence.slopes({"actuator_lag@F": {"time_constant": 0.03}}, np.zeros(len(evidence.free)))[:, k]
    begin = evidence.time < 4.0
    assert np.linalg.norm(column[begin]) > 0.95 * np.linalg.norm(column) > 0.0


def test_an_input_that_begins_at_zero_was_zero():
    log = car_log(0.0)
    log.loc[log["time"] == 0.0, "F"] = 0.0
    assert "start of F" not in evidence_of(log, CAR).free


# --- a slow thermometer -------------------------------------------------------------------------------------
OVEN = EquationSimulator(
    {"dT/dt": "(P - h*(T - 20))/C"},
    [Port("P", "input", "W"), Port("T", "state", "degC")],
    {"h": (4.0, 0.05, "W/K"), "C": (900.0, 0.05, "J/K")},
)


def oven_log(lag, seed=0):
    rng, runs, dt = np.random.default_rng(seed), [], 5.0
    for k in range(3):
        P, T, read, rows = np.repeat(rng.uniform(0, 400, 20), 60), 60.0, 60.0, []
        for p in P:
            rows.append(read if lag else T)
            for _ in range(10):
                T += 0.1 * dt * (p - 4 * (T - 20)) / 900
                read += 0.1 * dt * (T - read) / lag if lag else 0.0
        noise = 0.05 * rng.standard_normal(len(P))
        runs.append(
            pd.DataFrame({"trajectory": str(k), "time": dt * np.arange(len(P)), "P": P, "T": np.array(rows) + noise})
        )
    return pd.concat(runs, ignore_index=True)


def test_a_slow_thermometer_is_predicted_since_undoing_its_lag_would_drown_the_rest_in_noise():
    found = pamid.diagnose(oven_log(60.0), OVEN)
    assert DROWNED in found.notes
    assert any("lag" in name for cause in found.causes for name in cause.effects)


FERMENTER = EquationSimulator(
    {"dX/dt": "(mu*S/(K + S) - D)*X", "dS/dt": "D*(F - S) - mu*S/(K + S)*X/Y"},
    [Port("D", "input", "1/s"), Port("X", "state", "kg/m3"), Port("S", "state", "kg/m3")],
    {"mu": (1.2e-4, 0.05, "1/s"), "K": (0.35, 0.1, "kg/m3"), "Y": (0.48, 0.05), "F": 60.0},
)


def fermenter_log(lag, seed=0):
    rng, runs, dt = np.random.default_rng(seed), [], 360.0
    for k in range(2):
        D, X, S = np.repeat(rng.uniform(5e-6, 9e-5, 14), 29)[:400], 3.0 + 3 * k, 10.0 - 6 * k
        read, rows = S, []
        for d in D:
            rows.append((X, read))
            for _ in range(20):
                grown = 1.2e-4 * S / (0.35 + S) * X
                X, S = X + dt / 20 * (grown - d * X), S + dt / 20 * (d * (60.0 - S) - grown / 0.48)
                read += dt / 20 * (S - read) / lag
        X, S = np.array(rows).T + 0.05 * rng.standard_normal((2, len(D)))
        runs.append(pd.DataFrame({"trajectory": str(k), "time": dt * np.arange(len(D)), "D": D, "X": X, "S": S}))
    return pd.concat(runs, ignore_index=True)


def test_a_lag_that_leaves_nothing_but_noise_is_predicted_before_a_delay_that_leaves_a_gap_is_named(monkeypatch):
    others = [one for one in PREDICTED_IF if one[0] is not rates_are_hidden]
    monkeypatch.setattr("pamid.gap.residuals.choice.PREDICTED_IF", others)
    found = pamid.diagnose(fermenter_log(1800.0), FERMENTER, effects=["sensor_lag@S", "sensor_delay@S"])
    [cause] = found.causes
    assert DROWNED in found.notes
    assert cause.effects[0] == "sensor_lag" and abs(cause.parameters["time_constant"].value - 1800.0) < 150.0


# --- how large what acts at a joint may be ------------------------------------------------------------------
def test_effects_at_a_joint_that_is_predicted_have_the_size_of_accelerations():
    coil = EquationSimulator(
        {"dx/dt": "v", "dv/dt": "(F - k*x - b*v)/m"},
        [Port("F", "input", "N"), Port("x", "state", "m"), Port("v", "state", "m/s")],
        {"k": 1500.0, "b": 4.0, "m": 0.02},
    )
    t = 1e-3 * np.arange(1500)
    F = 5 * np.sin(2 * np.pi * 20 * t) + 3 * np.sin(2 * np.pi * 47 * t)
    x, v, rows = 0.0, 0.0, []
    for f in F:
        rows.append(x)
        for _ in range(20):
            v += 5e-5 * (f - 1500 * x - 4 * v) / 0.02
            x += 5e-5 * v
    log = pd.DataFrame({"trajectory": "0", "time": t, "F": F, "x": rows})
    evidence = evidence_of(log, coil, simulated=True)
    shaken = np.std(np.gradient(np.gradient(np.array(rows), 1e-3), 1e-3))
    assert 0.5 < evidence.sizes.gaps["x"] / (0.3 * shaken) < 2.0
