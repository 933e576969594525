"""Readings of a position with an error that repeats along the way: sizes recovered, and none invented."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from pamid.effects.ripples import PeriodicReading
from pamid.gap import diagnose_simulator
from pamid.report import answers
from pamid.simulators import FunctionSimulator, Port

NOISE = 2e-4


def slide() -> FunctionSimulator:
    def rates(t, x, u, p):
        return [x.v, (u.F - 4.0 * x.v) / p.m]

    ports = (Port("F", "input", "N"), Port("s", "state", "m"), Port("v", "state", "m/s"))
    return FunctionSimulator(rates, ports, {"m": (2.0, 0.02, "kg")})


def slide_log(*, speed: bool, amplitude: float = 0.0, rate: float = 0.0, phase: float = 0.0) -> pd.DataFrame:
    """A log of a slide, integrated in steps of a tenth of a sample."""
    rng, parts, dt = np.random.default_rng(5), [], 0.01
    for k in range(3):
        t = np.arange(0, 6, dt)
        F = 5.0 * np.sin((1.4 + 0.5 * k) * t + k) + 3.0 * np.sin(3.7 * t + 1.0)
        s, v, rows = 0.0, 0.0, []
        for force in F:
            rows.append((s, v))
            for _ in range(10):
                v += dt / 10 * (force - 4.0 * v) / 2.0
                s += dt / 10 * v
        s, v = np.array(rows).T
        read = {"s": s + amplitude * np.sin(rate * s + phase) + NOISE * rng.standard_normal(len(t))}
        if speed:
            read["v"] = v + 2e-3 * rng.standard_normal(len(t))
        parts.append(pd.DataFrame({"trajectory": f"run{k}", "time": t, "F": F, **read}))
    return pd.concat(parts, ignore_index=True)


@pytest.mark.parametrize("speed", [True, False])
def test_a_ripple_of_a_reading_is_named_with_its_size_and_period(speed: bool) -> None:
    amplitude, rate, phase = 6e-3, 17.3, 0.7
    log = slide_log(speed=speed, amplitude=amplitude, rate=rate, phase=phase)
    [cause] = diagnose_simulator(log, slide()).causes
    assert cause.effects == ("sensor_ripple",) and cause.where == ("s",)
    values = {name: p.value for name, p in cause.parameters.items()}
    assert values["rate"] == pytest.approx(rate, rel=3e-3)
    assert np.hypot(values["sine"], values["cosine"]) == pytest.approx(amplitude, rel=0.05)
    assert np.arctan2(values["cosine"], values["sine"]) == pytest.approx(phase, abs=0.1)
    assert [cause.parameters[name].unit for name in ("sine", "rate")] == ["m", "1/m"]


@pytest.mark.parametrize("speed", [True, False])
def test_a_faultless_reading_has_no_ripple(speed: bool) -> None:
    assert diagnose_simulator(slide_log(speed=speed), slide()).verdict == "none"


@pytest.mark.parametrize("speed", [True, False])
def test_a_hum_in_time_is_no_ripple(speed: bool) -> None:
    log = slide_log(speed=speed)
    log["s"] += 2e-3 * np.sin(40.0 * log["time"])
    found = diagnose_simulator(log, slide())
    assert found.verdict == "unknown" and not found.causes


def test_only_readings_along_a_way_have_ripples() -> None:
    from pamid.gap.simulated import evidence_of

    evidence = evidence_of(slide_log(speed=True), slide())
    assert {p.port for p in evidence.placements.values() if p.name == "sensor_ripple"} == {"s"}


def test_a_ripple_is_undone() -> None:
    made, q = PeriodicReading(sine=0.05, cosine=-0.04, rate=9.0), np.linspace(-2.0, 2.0, 1001)
    assert np.allclose(made.restore(made.measure(q, np.zeros(0)), 0.1, np.zeros(1, int)), q, atol=1e-12)


def wheel() -> FunctionSimulator:
    def rates(t, x, u, p):
        return [x.w, (u.T - 0.02 * x.w) / p.J]

    ports = (Port("T", "input", "N m"), Port("q", "state", "rad"), Port("w", "state", "rad/s"))
    return FunctionSimulator(rates, ports, {"J": (2e-3, 0.02, "kg m^2")})


def test_the_cogging_of_a_motor_that_turns_many_times_is_named_with_its_periods_in_a_turn() -> None:
    rng, parts, dt = np.random.default_rng(6), [], 0.005
    for k in range(2):
        t, q, w, rows = np.arange(0, 8, dt), 0.0, 0.0, []
        drive = 0.25 + 0.15 * np.sin((0.9 + 0.4 * k) * t) + 0.1 * np.sin(2.9 * t + k)
        for torque in drive:
            rows.append((q, w))
            for _ in range(20):
                w += dt / 20 * (torque - 0.02 * w - 0.03 * np.sin(12.0 * q + 0.4)) / 2e-3
                q += dt / 20 * w
        q, w = np.array(rows).T + [[2e-4], [5e-3]] * rng.standard_normal((2, len(t)))
        parts.append(pd.DataFrame({"trajectory": f"run{k}", "time": t, "T": drive, "q": q, "w": w}))
    log = pd.concat(parts, ignore_index=True)
    assert np.ptp(log["q"]) > 10 * np.pi  # over which 40 periods are fewer than 12 in a turn
    answer = diagnose_simulator(log, wheel(), ["periodic_force", "coulomb_friction", "viscous_friction"])
    [cause] = answer.causes
    assert cause.effects == ("periodic_force",)
    values = {name: p.value for name, p in cause.parameters.items()}
    assert values["rate"] == pytest.approx(12.0, rel=1e-3)
    assert np.hypot(values["sine"], values["cosine"]) == pytest.approx(0.03, rel=0.05)
    assert "rate 12 1/rad" in answers(answer).which
