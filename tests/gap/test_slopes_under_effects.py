"""Sensitivities hold where a fit stands: those of the parameters as given end a fit where tolerances still balance."""

import numpy as np
import pandas as pd
import pytest

from pamid.gap.inference.gauss_newton import FINAL, Fitter
from pamid.gap.residuals.shooting import ShootingEvidence
from pamid.gap.simulated import evidence_of
from pamid.simulators import FunctionSimulator, Port
from pamid.simulators.port_log import port_log

LEAK = "leakage@h"
TANK = FunctionSimulator(
    lambda t, x, u, p: [(p.k * u.pump - p.a * np.sqrt(19.62 * np.maximum(x.h, 0.0))) / p.A],
    [Port("pump", "input", "V"), Port("h", "state", "m")],
    {"A": (0.0154, 0.02, "m^2"), "a": (5e-5, 0.1, "m^2"), "k": (2e-5, 0.05, "m^3/s/V")},
)


@pytest.fixture(scope="module")
def fitter() -> Fitter:
    """A tank with a leak, of which the level is read to a millimetre."""
    rng, t, h = np.random.default_rng(5), np.arange(0.0, 400.0), [0.15]
    pump = np.repeat(rng.uniform(4.0, 8.0, 20), 20)
    for u in pump[:-1]:
        level = h[-1]
        for _ in range(10):
            level += 0.1 * (2e-5 * u - 5.3e-5 * np.sqrt(19.62 * level) - 4e-5 * np.sqrt(level)) / 0.0154
        h.append(level)
    log = pd.DataFrame({"time": t, "pump": pump, "h": h + 1e-3 * rng.standard_normal(len(t))})
    return Fitter(evidence_of(log, TANK))


def test_a_fit_ends_at_the_same_likelihood_wherever_it_begins(fitter: Fitter) -> None:
    """Along a way on which the leak, an outlet and the pump balance."""
    to = fitter.evidence.placements[LEAK].outward({"conductance": 1.0, "exponent": 1.0})["conductance"]
    found = [fitter.refine({LEAK: {"conductance": k / to, "exponent": 0.5}}) for k in (1e-3, 5e-3)]
    assert abs(found[0].loglik - found[1].loglik) < FINAL


def test_a_response_follows_how_far_a_joint_without_an_angle_moves() -> None:
    """A spring acts on that: with a speed that is off for long, it pulls more and more."""
    rng, t = np.random.default_rng(3), np.arange(0.0, 20.0, 0.02)
    F, w, path = np.sin(1.3 * t) + np.sin(3.1 * t), [0.0], 0.0
    for f in F[:-1]:
        speed = w[-1]
        for _ in range(10):
            path += 0.002 * speed
            speed += 0.002 * (f - 0.4 * speed - 4.0 * path)
        w.append(speed)
    wheel = FunctionSimulator(
        lambda t, x, u, p: [(u.F - p.d * x.w) / p.J],
        [Port("F", "input", "N m"), Port("w", "state", "rad/s")],
        {"J": (1.0, 0.1, "kg m^2"), "d": (0.4, 0.1, "N m s/rad")},
    )
    log = pd.DataFrame({"time": t, "F": F, "w": w + 1e-3 * rng.standard_normal(len(t))})
    evidence = ShootingEvidence(port_log(log, wheel), wheel)
    active = evidence.active({"spring@w": {"stiffness": 4.0 / evidence.placements["spring@w"].factor("stiffness")}})
    before, x0 = evidence.simulator.numbers, evidence._x0
    there = before * np.array([1.001, 1.0])
    exact = evidence._predict(x0, active, there) - evidence._predict(x0, active, before)
    known, near = evidence._near(x0, evidence._drive(active, before), evidence._drive(active, there))
    assert np.linalg.norm(near - known - exact) < 0.01 * np.linalg.norm(exact)
