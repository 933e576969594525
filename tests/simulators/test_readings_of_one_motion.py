"""A position and a velocity say the same twice: what they agree on is no fault of a sensor, and forces are named."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from pamid.gap import diagnose_simulator
from pamid.gap.simulated import evidence_of
from pamid.simulators import FunctionSimulator, Port

MASS, GAIN, COULOMB, VISCOUS = 95.0, 35.0, 20.4, 203.0


def carriage(lag: float = 0.0) -> pd.DataFrame:
    """Return a log of a carriage in a closed loop, friction and all, one record; the speed may be read with a lag."""
    rng, h, m = np.random.default_rng(3), 1e-3, 4
    n, q, v, read = 12_000, 0.0, 0.0, 0.0
    rows = np.empty((n, 3))
    for k in range(n):
        t = k * h
        goal = 0.1 * np.sin(0.9 * t) + 0.04 * np.sin(2.6 * t + 1.0)
        u = float(np.clip(160.0 * (goal - q) - 12.0 * v, -10.0, 10.0))
        rows[k] = u, q, read if lag else v
        for _ in range(m):
            force = GAIN * u - VISCOUS * v - COULOMB * np.tanh(v / 2e-4)
            v += h / m * force / MASS
            q += h / m * v
            read += h / m * (v - read) / lag if lag else 0.0
    noise = np.array([0.0, 1e-6, 2e-4]) * rng.standard_normal((n, 3))
    table = pd.DataFrame(rows + noise, columns=["u", "q", "v"])
    return table.assign(trajectory="record", time=np.arange(n) * h)


def rail(names: tuple[str, ...] = ("q", "v")) -> FunctionSimulator:
    ports = [Port("u", "input", "V"), Port("q", "state", "m"), Port("v", "state", "m/s")]
    numbers = {"m": (MASS, 0.01, "kg"), "k": (GAIN, 0.0, "N/V")}
    return FunctionSimulator(lambda t, x, u, p: [x.v, p.k * u.u / p.m], ports, numbers)


@pytest.mark.parametrize("columns", [["u", "q"], ["u", "q", "v"]], ids=["position", "position and speed"])
def test_two_frictions_are_named_with_and_without_the_speed(columns: list[str]) -> None:
    found = diagnose_simulator(carriage()[["trajectory", "time", *columns]], rail())
    named = {name: c.parameters for c in found.causes for name in c.effects[:1]}
    assert len(found.causes) == 2
    [dry] = [c for c in found.causes if "coulomb_friction" in c.effects]
    [wet] = [c for c in found.causes if "viscous_friction" in c.effects]
    sizes = {name: p for c in (dry, wet) for name, p in zip(c.effects, (c.parameters, *c.others), strict=False)}
    assert sizes["coulomb_friction"]["amplitude"].value * GAIN == pytest.approx(COULOMB, rel=0.1), named
    assert sizes["viscous_friction"]["coefficient"].value * GAIN == pytest.approx(VISCOUS, rel=0.1), named


def test_a_fault_that_shows_between_the_readings_may_be_a_cause() -> None:
    found = diagnose_simulator(carriage(lag=0.02), rail(), ["sensor_lag", "coulomb_friction", "viscous_friction"])
    named = {(c.effects[0], c.where[0]) for c in found.causes}
    assert named == {("sensor_lag", "v"), ("coulomb_friction", "q"), ("viscous_friction", "q")}


def test_a_noisy_speed_takes_nothing_from_what_the_position_shows() -> None:
    log = carriage()
    noise = {"none": log.drop(columns="v")}
    noise |= {size: log.assign(v=log["v"] + size * np.random.default_rng(5).standard_normal(len(log)))
              for size in (2e-4, 2e-2)}  # fmt: skip
    found = {k: evidence_of(table, rail()) for k, table in noise.items()}
    drive = {k: float(np.median(e.noise[e.parts[e.equations.index("q")]])) * np.sqrt(e.n) for k, e in found.items()}
    assert drive[2e-2] < 1.2 * drive["none"]
    assert drive[2e-4] < 1.2 * drive["none"]
    assert any("less noise than v" in note for note in found[2e-2].notes)
    assert not any("less noise than v" in note for note in found["none"].notes)


def test_a_fault_of_a_noisy_speed_shows_beside_the_position() -> None:
    log = carriage()
    log["v"] = 1.2 * log["v"] + 2e-2 * np.random.default_rng(5).standard_normal(len(log))
    found = diagnose_simulator(log, rail(), ["coulomb_friction", "viscous_friction", "sensor_gain"])
    named = {(c.effects[0], c.where[0]) for c in found.causes}
    assert named == {("sensor_gain", "v"), ("coulomb_friction", "q"), ("viscous_friction", "q")}
