"""Physics at the ports of a simulator: logs by equations of their own, answers with the whole library."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pandas as pd
import pytest

from pamid.gap import diagnose_simulator
from pamid.simulators import FunctionSimulator, Port

ROTOR = (Port("M", "input", "N m"), Port("q", "state", "rad"), Port("w", "state", "rad/s"))
INERTIA = 0.02


def rotor_log(torque: Callable[[float, float], float], slew: float = np.inf, runs: int = 3) -> pd.DataFrame:
    """A log of a rotor, integrated in steps of a tenth of a sample; ``slew`` is the most that M changes by, N m/s."""
    rng, parts, dt = np.random.default_rng(3), [], 0.005
    for k in range(runs):
        t = np.arange(0, 6, dt)
        asked = 0.12 * np.sign(np.sin((1.3 + 0.4 * k) * t)) + 0.05 * np.sin(4.1 * t + k)
        got, q, w, rows = asked[0], 0.0, 0.0, []
        for M in asked:
            rows.append((q, w))
            got += float(np.clip(M - got, -slew * dt, slew * dt))
            for _ in range(10):
                w += dt / 10 * (got + torque(q, w)) / INERTIA
                q += dt / 10 * w
        q, w = np.array(rows).T
        noisy = {"q": q + 1e-4 * rng.standard_normal(len(t)), "w": w + 2e-3 * rng.standard_normal(len(t))}
        parts.append(pd.DataFrame({"trajectory": f"run{k}", "time": t, "M": asked, **noisy}))
    return pd.concat(parts, ignore_index=True)


def rotor() -> FunctionSimulator:
    def rates(t, x, u, p):
        return [x.w, (u.M - 0.02 * x.w) / p.J]

    return FunctionSimulator(rates, ROTOR, {"J": (INERTIA, 0.02, "kg m^2")})


def test_a_limited_speed_of_a_command_is_named() -> None:
    found = diagnose_simulator(rotor_log(lambda q, w: -0.02 * w, slew=0.8), rotor())
    assert [c.effects[0] for c in found.causes] == ["actuator_slew_rate"]
    rate = found.causes[0].parameters["rate"]
    assert rate.value == pytest.approx(0.8, rel=0.03) and rate.unit == "N m/s"


def test_cogging_is_named_with_its_period() -> None:
    rate = 11.3
    log = rotor_log(lambda q, w: -0.02 * w + 0.025 * np.sin(rate * q + 0.4))
    found = diagnose_simulator(log, rotor())
    assert [c.effects[0] for c in found.causes] == ["periodic_force"]
    values = {name: p.value for name, p in found.causes[0].parameters.items()}
    assert values["rate"] == pytest.approx(rate, rel=2e-3)
    assert np.hypot(values["sine"], values["cosine"]) == pytest.approx(0.025, rel=0.05)
    assert np.arctan2(values["cosine"], values["sine"]) == pytest.approx(0.4, abs=0.1)


def oven_log(lost: Callable[[float], float]) -> pd.DataFrame:
    """A log of an oven, its temperature in °C, integrated in steps of a twentieth of a sample; ``lost`` in K/s of K."""
    rng, parts, dt = np.random.default_rng(4), [], 2.0
    for k in range(3):
        t = np.arange(0, 4000, dt)
        u = 500.0 * (1.0 + np.sign(np.sin((0.006 + 0.003 * k) * t + k)))
        T, rows = 40.0, []
        for heat in u:
            rows.append(T)
            for _ in range(20):
                T += dt / 20 * (heat / 500.0 - 2e-3 * (T - 20.0) - lost(T + 273.15))
        noisy = np.array(rows) + 0.05 * rng.standard_normal(len(t))
        parts.append(pd.DataFrame({"trajectory": f"run{k}", "time": t, "u": u, "T": noisy}))
    return pd.concat(parts, ignore_index=True)


def test_an_oven_radiates_and_does_not_overflow() -> None:
    def rates(t, x, u, p):
        return [u.u / p.C - p.k * (x.T - 20.0)]

    ports = (Port("u", "input", "W"), Port("T", "state", "°C"))
    oven = FunctionSimulator(rates, ports, {"C": (500.0, 0.02, "J/K"), "k": (2e-3, 0.02, "1/s")})
    found = diagnose_simulator(oven_log(lambda T: 8e-12 * (T**4 - 293.15**4)), oven)
    assert not any(c.effect.startswith(("overflow", "leakage")) for c in found.candidates)
    assert "heat_loss" in found.causes[0].effects


def test_the_temperature_of_the_surroundings_is_found_between_far_ends() -> None:
    """Most ends of its range are so far from a room's that a small loss there looks like another law."""
    from pamid.effects.gas import HeatLoss
    from pamid.gap.inference.sensitivity import grid

    ambient = next(p for p in HeatLoss.parameters if p.name == "ambient")
    points = np.array(grid(ambient, 2))
    for room in (273.15, 293.15, 313.15):
        assert np.min(np.abs(points - room)) <= 12.0
