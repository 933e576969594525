"""Logs of exactly integrated systems: noise in positions does not make them look as if made in coarse steps."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pandas as pd
import pytest

from pamid.gap import diagnose_simulator
from pamid.simulators import FunctionSimulator, Port

Rates = Callable[[np.ndarray, float], np.ndarray]


def exact(rates: Rates, x: np.ndarray, u: float, dt: float, steps: int = 10) -> np.ndarray:
    """Return states a sample later, by fine steps of the Runge-Kutta method."""
    h = dt / steps
    for _ in range(steps):
        a = rates(x, u)
        b = rates(x + h / 2 * a, u)
        c = rates(x + h / 2 * b, u)
        x = x + h / 6 * (a + 2 * b + 2 * c + rates(x + h * c, u))
    return x


def test_a_beam_is_integrated_exactly():
    def rates(x: np.ndarray, u: float) -> np.ndarray:
        return np.array([x[1], 7.007 * np.sin(x[2]), (u - x[2]) / 0.09])

    rng, dt, rows = np.random.default_rng(131), 0.02, []
    for run in range(2):
        x, slow = np.array([0.05, 0.0, 0.0]), 0.05
        for k in range(3000):
            t, y = k * dt, x[0] + 0.0008 * rng.standard_normal()
            speed = 10.0 * (y - slow)
            slow += (1.0 - np.exp(-10.0 * dt)) * (y - slow)
            wanted = (0.1 * np.sign(np.sin(0.5 * t)), 0.08 * np.sin(0.7 * t) + 0.05 * np.sin(1.9 * t))[run]
            u = float(np.clip(-0.28 * (y - wanted) - 0.26 * speed, -0.25, 0.25))
            rows.append((run, t, u, y, x[2] + 0.0008 * rng.standard_normal()))
            x = exact(rates, x, u, dt, 4)
    log = pd.DataFrame(rows, columns=["trajectory", "time", "u", "x", "angle"])
    ports = [
        Port("u", "input", "rad"),
        Port("x", "state", "m"),
        Port("v", "state", "m/s"),
        Port("angle", "state", "rad"),
    ]
    beam = FunctionSimulator(
        lambda t, x, u, p: [x.v, 7.007 * np.sin(x.angle), (u.u - x.angle) / p.tau], ports, {"tau": (0.09, 0.1, "s")}
    )
    found = diagnose_simulator(log, beam, "coulomb_friction", seed=0)
    assert found.verdict == "none"
    assert not any("integrated" in note or "widen" in note for note in found.notes)
    assert abs(found.deviations["tau"]) < 0.6


@pytest.mark.parametrize("limit", [8.0, np.inf])
def test_a_clipped_drive_of_a_belt_is_seen_through_the_noise_of_positions(limit: float):
    def rates(x: np.ndarray, u: float) -> np.ndarray:
        belt = 8.0 * (x[0] - x[2]) + 0.004 * (x[1] - x[3])
        return np.array([x[1], (0.06 * (u - 0.06 * x[1]) / 1.1 - 3e-4 * x[1] - belt) / 2e-4,
                         x[3], (belt - 1e-3 * x[3]) / 6e-4])  # fmt: skip

    def model(t, x, u, p):
        belt = p.k * (x.m - x.l) + 0.004 * (x.wm - x.wl)
        return [x.wm, (0.06 * (u.U - 0.06 * x.wm) / p.R - 3e-4 * x.wm - belt) / 2e-4, x.wl, (belt - 1e-3 * x.wl) / p.J]

    rng, dt, rows = np.random.default_rng(77), 0.005, []
    for run in range(2):
        x, slow = np.zeros(4), 0.0
        for k in range(2000):
            t, y = k * dt, x[[0, 2]] + 0.025 * rng.standard_normal(2)
            wanted = (6 * np.sign(np.sin(2.5 * t)) + 3 * np.sin(6.9 * t), 5 * np.sin(4.4 * t) + 3 * np.sin(12 * t))[run]
            speed = 60.0 * (y[0] - slow)
            slow += (1.0 - np.exp(-60.0 * dt)) * (y[0] - slow)
            u = float(np.clip(2.2 * (wanted - y[0]) - 0.05 * speed, -24.0, 24.0))
            rows.append((run, t, u, *y))
            x = exact(rates, x, float(np.clip(u, -limit, limit)), dt)
    log = pd.DataFrame(rows, columns=["trajectory", "time", "U", "m", "l"])
    states = [Port(n, "state", unit) for n, unit in zip(("m", "wm", "l", "wl"), 2 * ("rad", "rad/s"), strict=True)]
    numbers = {"k": (8.0, 0.1, "N m/rad"), "R": (1.1, 0.05, "ohm"), "J": (6e-4, 0.05, "kg m2")}
    belt = FunctionSimulator(model, [Port("U", "input", "V"), *states], numbers)
    found = diagnose_simulator(log, belt, ["actuator_saturation", "actuator_gain", "parameter_drift"], seed=0)
    assert [cause.effects[0] for cause in found.causes] == (["actuator_saturation"] if np.isfinite(limit) else [])
    assert not any("integrated" in note for note in found.notes)
