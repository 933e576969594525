"""A sensor that reads a magnitude, as the pulse counter of the coupled electric drives does."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from pamid.gap import diagnose_simulator
from pamid.gap.simulated import evidence_of, free_run
from pamid.simulators import FunctionSimulator, Port, Simulator

DT, NOISE = 0.02, 0.01
FEW = [
    "sensor_rectification",
    "sensor_lag",
    "sensor_gain",
    "sensor_saturation",
    "actuator_dead_zone",
    "coulomb_friction",
]


def belt(lost: float, runs: int = 4, n: int = 150, offset: float = 0.0) -> pd.DataFrame:
    """Speed of a belt between two drives, of which a share of the sign is lost; integrated by small steps."""
    rng, parts = np.random.default_rng(5), []
    for run in range(runs):
        u = np.repeat(rng.uniform(-1.5, 1.5, n // 25), 25) + offset
        x, rows = np.zeros(3), []
        for command in u:
            rows.append(x[1])
            for _ in range(40):
                drive, speed, rate = x
                bend = 110.0 * (drive - speed) - 1.7 * rate
                x = x + DT / 40 * np.array([1.2 * (1.9 * command - drive), rate, bend])
        y = np.array(rows)
        y = np.where(y < 0.0, (1.0 - 2.0 * lost) * y, y) + NOISE * rng.standard_normal(n)
        parts.append(pd.DataFrame({"trajectory": str(run), "time": np.arange(n) * DT, "u": u, "speed": y}))
    return pd.concat(parts, ignore_index=True)


def belt_model() -> FunctionSimulator:
    def rates(t, x, u, p):
        return [p.a * (p.k * u.u - x.drive), x.rate, p.c * (x.drive - x.speed) - p.d * x.rate]

    ports = [Port("u", "input", "V"), Port("drive", "state", "V"), Port("speed", "state", "V"), Port("rate", "state")]
    return FunctionSimulator(rates, ports, {"a": (1.1, 0.2, "1/s"), "k": (2.0, 0.2, "-"), "c": 110.0, "d": 1.7})


def axle(read: str, n: int = 800) -> pd.DataFrame:
    """Speed of an axle with a torque, which is the only state."""
    rng, t = np.random.default_rng(2), np.arange(n) * DT
    torque = 3.0 * np.sin(1.3 * t) + np.sin(0.31 * t)
    v = np.zeros(n)
    for k in range(n - 1):
        v[k + 1] = torque[k] / 0.8 + (v[k] - torque[k] / 0.8) * np.exp(-0.8 * DT / 0.5)
    v = np.abs(v) if read == "magnitude" else v
    noisy = v + NOISE * rng.standard_normal(n)
    return pd.DataFrame({"trajectory": "1", "time": t, "torque": torque, "v": noisy})


def axle_model() -> FunctionSimulator:
    ports = [Port("torque", "input", "N m"), Port("v", "state", "rad/s")]
    return FunctionSimulator(lambda t, x, u, p: [(u.torque - 0.8 * x.v) / p.J], ports, {"J": (0.5, 0.05, "kg m^2")})


def test_a_speed_without_its_sign_is_named() -> None:
    """No initial state lets a simulator follow a magnitude: in stretches so short that some do, a lag was named."""
    log = belt(1.0)
    found = diagnose_simulator(log, belt_model(), FEW)
    assert [(c.effects[0], c.where[0]) for c in found.causes] == [("sensor_rectification", "speed")]
    assert found.causes[0].parameters["share"].value == pytest.approx(1.0, abs=0.03)
    assert isinstance(found.corrected, Simulator)
    left = log["speed"] - free_run(log, found.corrected)["speed"]
    assert float(np.std(left)) < 1.5 * NOISE
    again = evidence_of(log, found.corrected)
    assert np.sqrt(np.mean(np.square(again.z0))) < 1.2, "with the effect nothing is left but noise"


def test_half_a_range_is_seen() -> None:
    evidence = evidence_of(belt(0.5), belt_model(), refit=True)
    assert evidence.folds == {"speed": 0.5}
    rms = {s: np.sqrt(np.mean(np.square(evidence.z({"sensor_rectification@speed": {"share": s}})))) for s in (0.5, 1.0)}
    assert rms[0.5] < 0.1 * rms[1.0]


def test_a_magnitude_is_seen_where_the_log_holds_all_states() -> None:
    """Rates turn back where a magnitude does: they show nothing of a sensor."""
    found = diagnose_simulator(axle("magnitude"), axle_model(), FEW)
    assert [c.effects[0] for c in found.causes] == ["sensor_rectification"]


def test_a_speed_with_its_sign_is_none() -> None:
    assert not getattr(evidence_of(axle("speed"), axle_model()), "folds", {})
    assert not getattr(evidence_of(belt(0.0), belt_model()), "folds", {})
    assert not getattr(evidence_of(belt(0.0, offset=6.0), belt_model()), "folds", {}), "it never turns back"
