"""Fast drives read with noise: neither what noise does to slopes nor a smoothed speed is a cause."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from pamid.gap.inference.gauss_newton import Fitter
from pamid.gap.residuals.bends import carried
from pamid.gap.residuals.direct import DirectEvidence
from pamid.gap.residuals.shooting import ShootingEvidence
from pamid.gap.residuals.stretches import SHORT
from pamid.gap.settings import LEAST_GAIN
from pamid.gap.simulated import evidence_of
from pamid.simulators import EquationSimulator, Port
from pamid.simulators.port_log import port_log
from pamid.simulators.ports import ModelParameter

DT, FRICTION = 2e-3, 100.0  # s, rad/s²


def motor() -> EquationSimulator:
    """Return a motor whose current settles within a sample."""
    ports = [Port("V", "input", "V"), Port("i", "state", "A"), Port("w", "state", "rad/s"), Port("q", "state", "rad")]
    equations = {"di/dt": "(V-R*i-Ke*w)/L", "dw/dt": "(Ke*i-b*w)/J", "dq/dt": "w"}
    sizes = {"R": (1.2, 0.05, "ohm"), "L": (2e-3, 0.1, "H"), "Ke": (0.05, 0.02, "V s"),
             "J": (2e-4, 0.05, "kg m^2"), "b": (1e-4, 0.3, "N m s")}  # fmt: skip
    return EquationSimulator(equations, ports, {k: ModelParameter(*v) for k, v in sizes.items()})


def log_of(seed: int, friction: float = 0.0, seconds: float = 4.0) -> pd.DataFrame:
    """Return readings of the motor under held voltages, two runs, integrated in tenths of a sample."""
    rng, runs = np.random.default_rng(seed), []
    for run in range(2):
        t = np.arange(0.0, seconds, DT)
        u = np.repeat(rng.uniform(-10.0, 10.0, len(t) // 200 + 1), 200)[: len(t)]
        u = u + sum(np.sin(2 * np.pi * f * t + p) for f, p in zip((0.7, 1.9, 4.1), rng.uniform(0, 6, 3), strict=True))
        x, rows = np.zeros(3), []

        def rate(x: np.ndarray, v: float) -> np.ndarray:
            pull = 250.0 * x[0] - 0.5 * x[1] - friction * np.tanh(x[1] / 0.05)
            return np.array([(v - 1.2 * x[0] - 0.05 * x[1]) / 2e-3, pull, x[1]])

        for v in u:
            rows.append(x)
            for _ in range(10):
                h = DT / 10.0
                a = rate(x, v)
                b = rate(x + h / 2 * a, v)
                c = rate(x + h / 2 * b, v)
                x = x + h / 6 * (a + 2 * b + 2 * c + rate(x + h * c, v))
        read = np.array(rows) + rng.standard_normal((len(t), 3)) * [0.02, 0.3, 2e-4]
        runs.append(pd.DataFrame(read, columns=["i", "w", "q"]).assign(V=u, time=t, trajectory=f"run {run}"))
    return pd.concat(runs, ignore_index=True)


def test_a_constant_addition_to_rates_moves_what_follows_them() -> None:
    """A force adds half of a step's speed to the position's mean rate, and its whole to a speed that has no drag."""
    assert carried(np.array([[0.0, 1.0], [0.0, 0.0]]), 0.01) == pytest.approx(np.array([[1.0, 0.005], [0.0, 1.0]]))
    decay = carried(np.array([[-200.0]]), 0.01)
    assert decay == pytest.approx(np.array([[(1.0 - np.exp(-2.0)) / 2.0]]))


def test_friction_shows_in_the_position_of_a_drive_that_is_run_over_each_sample() -> None:
    """The friction's own speed within a sample is a tenth of a rad/s, two thirds of that equation's noise."""
    simulator, log = motor(), log_of(1, FRICTION)
    at_ports = port_log(log, simulator)
    found = DirectEvidence(at_ports, simulator, {})
    assert found.runs_within_steps
    place = found.placements["coulomb_friction@q"]
    spec = {place.key: place.inward({"amplitude": FRICTION, "presliding": 1e-6, "exponent": 1.0, "transition": 0.0})}
    part = found.parts[found.equations.index("w")]
    before, after = (float(np.mean(np.square(found.raw(found.z(s))[part]))) for s in ({}, spec))
    assert after < 1.1 < 1.2 < before


def test_numbers_that_compensate_each_other_follow_the_noise_together() -> None:
    """No number gains a nat from it alone; the inductance and the timing of the voltage gain dozens."""
    simulator, log = motor(), log_of(2)
    alone, together = DirectEvidence(port_log(log, simulator), simulator, {}).pulled
    assert alone < LEAST_GAIN < together
    found = evidence_of(log, simulator)
    assert isinstance(found, ShootingEvidence)
    assert max(s.stop - s.first for s in found.stretches) <= SHORT + 1
    assert found.how.endswith("since noise in the logged states would bias parameters")


def test_a_speed_as_read_is_compared_with_the_position_and_not_with_its_smoothed_rate() -> None:
    """The fastest motion is at the border of what smoothing leaves of a noisy position."""
    ports = [Port("a", "input", "m/s^2"), Port("q", "state", "m"), Port("v", "state", "m/s")]
    cart = EquationSimulator({"dq/dt": "v", "dv/dt": "a"}, ports)
    rng, t = np.random.default_rng(0), np.arange(0.0, 8.0, DT)
    f, phase = rng.uniform(0.5, 12.0, 12), rng.uniform(0.0, 6.0, 12)
    wave = 2.0 * np.pi * np.outer(t, f) + phase
    q, v, a = (0.003 * np.sum(s * (2.0 * np.pi * f) ** k, axis=1)
               for k, s in ((0, np.sin(wave)), (1, np.cos(wave)), (2, -np.sin(wave))))  # fmt: skip
    log = pd.DataFrame({"q": q + 5e-6 * rng.standard_normal(len(t)), "v": v + 1e-3 * rng.standard_normal(len(t))})
    found = evidence_of(log.assign(a=a, time=t, trajectory="run"), cart)
    assert found.derived == {"q": "v"}
    part, fitted = found.parts[found.equations.index("v")], Fitter(found).base()  # clocks, and bends within a step
    assert float(np.mean(np.square(found.raw(fitted.z)[part]))) < 1.2
