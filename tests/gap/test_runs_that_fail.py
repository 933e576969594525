"""A simulator that fails for some parameters or effects does not end the search for others."""

from __future__ import annotations

import math

import numpy as np
import pandas as pd
import pytest

from pamid.gap.simulated import evidence_of
from pamid.simulators import FunctionSimulator, Port


def tank(t, x, u, p):
    inflow = math.sqrt(max(x.upper, 0.0))
    return [u.pump - inflow, inflow - 0.45 * x.lower + math.exp(p.k * x.lower) - 1.0]


def swing(t, x, u, p):
    return [x.speed, -math.sin(x.angle) - p.d * x.speed]


@pytest.fixture(scope="module")
def levels() -> pd.DataFrame:
    rng, at, rows = np.random.default_rng(0), np.array([1.0, 1.0]), []
    pump = np.repeat(rng.uniform(0.5, 1.5, 20), 20)
    for u in pump:
        rows.append(at[1])
        for _ in range(10):
            out = np.sqrt(max(at[0], 0.0))
            at = at + 0.01 * np.array([u - out, out - 0.45 * at[1]])
    noisy = np.array(rows) + rng.normal(0.0, 1e-3, len(rows))
    return pd.DataFrame({"trajectory": "run", "time": 0.1 * np.arange(len(rows)), "pump": pump, "lower": noisy})


def test_residuals_of_a_run_that_fails_have_slopes(levels, monkeypatch) -> None:
    ports = [Port("pump", "input", "-"), Port("upper", "state", "-"), Port("lower", "state", "-")]
    evidence = evidence_of(levels, FunctionSimulator(tank, ports, {"k": (1e-3, 1.0, "-")}))
    assert np.any(evidence.slopes({}, np.zeros(len(evidence.free))))
    far = 1e3 * (np.array(evidence.free) == "k")
    assert np.all(np.abs(evidence.z({}, {"k": 1e3})[-10:]) > 100.0)  # math.exp raises OverflowError
    explained = evidence._explained
    monkeypatch.setattr(evidence, "_explained", lambda *given: np.nan * explained(*given))
    assert np.isfinite(evidence.slopes({}, far)).all()


def test_a_log_without_inputs() -> None:
    angle, speed, rows = 1.0, 0.0, []
    for _ in range(600):
        rows.append(angle)
        for _ in range(20):
            speed -= 1e-3 * (np.sin(angle) + 0.1 * speed)
            angle += 1e-3 * speed
    log = pd.DataFrame({"trajectory": "run", "time": 0.02 * np.arange(600), "angle": rows})
    ports = [Port("angle", "state", "rad"), Port("speed", "state", "rad/s")]
    evidence = evidence_of(log, FunctionSimulator(swing, ports, {"d": 0.1}))
    assert "viscous_friction@angle" in evidence.library("all") and not evidence.driven()
