"""Motion that is fast beside the rows of a log, and inputs that are held over a step or go on to the next row."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from scipy.signal import butter, lfilter, resample

from pamid.gap import diagnose_simulator
from pamid.gap.residuals.direct import DirectEvidence
from pamid.gap.residuals.shooting import ShootingEvidence
from pamid.gap.simulated import evidence_of
from pamid.simulators import FunctionSimulator, Port

STEP, OMEGA, DAMPING, CUBIC, NOISE = 1.0 / 610.0, 2 * np.pi * 68.0, 40.0, 7e5, 3e-4
FINE = 8


def driven(n: int, smooth: bool, cubic: float = CUBIC, omega: float = OMEGA, noise: float = NOISE) -> pd.DataFrame:
    """A spring that stiffens, driven at its resonance by noise that a low pass lets through."""
    rng = np.random.default_rng(3)
    u = lfilter(*butter(4, 0.65), rng.standard_normal(n))
    u *= np.linspace(0.2, 1.0, n) * 0.055 / np.std(u)
    fine = resample(u, n * FINE) if smooth else np.repeat(u, FINE)
    x = v = 0.0
    y = np.empty(n)
    h = STEP / FINE
    for k in range(n):
        y[k] = x
        for j in range(k * FINE, (k + 1) * FINE):
            push = 8e4 * (0.5 * (fine[j] + fine[min(j + 1, len(fine) - 1)]) if smooth else fine[j])
            a = push - DAMPING * v - omega**2 * x - cubic * x**3
            middle, speed = x + 0.5 * h * v, v + 0.5 * h * a
            x, v = x + h * speed, v + h * (push - DAMPING * speed - omega**2 * middle - cubic * middle**3)
    return pd.DataFrame({"time": np.arange(n) * STEP, "u": u, "y": y + noise * rng.standard_normal(n)})


def spring(omega: float = OMEGA) -> FunctionSimulator:
    """The same spring without its stiffening."""
    return FunctionSimulator(
        lambda t, x, u, p: [x[1], p[0] * u[0] - p[1] * x[1] - p[2] * x[0]],
        [Port("u", "input", "V"), Port("y", "state", "V"), Port("v", "state", "V/s")],
        {"push": (8e4, 0.1, "1/s^2"), "d": (DAMPING, 0.2, "1/s"), "k": (1.01 * omega**2, 0.1, "1/s^2")},
    )


@pytest.fixture(scope="module", params=[False, True], ids=["held", "smooth"])
def fast(request) -> tuple[bool, pd.DataFrame]:
    return request.param, driven(4000, request.param)


def test_a_spring_at_nine_rows_a_period_is_named_with_its_size():  # 12 s: stretches are cut from 4,000 rows on
    found = diagnose_simulator(driven(4000, True), spring(), ["nonlinear_stiffness", "actuator_lag"])
    [cause] = found.causes
    assert (found.verdict, cause.effects) == ("cause", ("nonlinear_stiffness",))
    assert cause.parameters["cubic"].value * 8e4 == pytest.approx(CUBIC, rel=0.1)
    assert found.closure[0].rmse_after < 1.15 * NOISE
    assert any("interpolated between rows" in note for note in found.notes)


def test_fast_motion_is_predicted_in_stretches_that_forget_where_they_began(fast):
    evidence = evidence_of(fast[1], spring())
    assert isinstance(evidence, ShootingEvidence)
    assert len(evidence.stretches) == 8
    assert evidence.n == 1  # a window of more rows would hold much of a period
    assert evidence.sigma["y"] == pytest.approx(NOISE, rel=0.35)  # six times as much by neighbouring rows alone
    assert evidence.lines == fast[0]


@pytest.mark.parametrize("smooth", [False, True])
def test_slow_motion_is_held_against_its_equations_with_inputs_as_they_went(smooth):
    omega = 0.3 * OMEGA
    evidence = evidence_of(driven(3000, smooth, 0.0, omega, noise=1e-5), spring(omega))
    assert isinstance(evidence, DirectEvidence)
    assert evidence.lines == smooth


def test_a_noisy_reading_of_slow_motion_keeps_long_windows():
    rng, t = np.random.default_rng(0), np.arange(4000) * 0.01
    u = np.sin(0.3 * t)
    log = pd.DataFrame({"time": t, "u": u, "y": 0.95 * u + 0.7 * rng.standard_normal(len(t))})
    ports = [Port("u", "input", "V"), Port("x", "state", "V"), Port("y", "output", "V")]
    follower = FunctionSimulator(lambda t, x, u, p: [2.0 * (u[0] - x[0])], ports, output=lambda t, x, u, p: [x[0]])
    assert evidence_of(log, follower).n == 10
