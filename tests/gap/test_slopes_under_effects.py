"""Sensitivities hold where a fit stands: those of the parameters as given end a fit where tolerances still balance."""

import numpy as np
import pandas as pd
import pytest

from pamid.gap.inference.gauss_newton import Fitter
from pamid.gap.residuals.shooting import ShootingEvidence
from pamid.gap.simulated import evidence_of
from pamid.simulators import FunctionSimulator, Port

LEAK = "leakage@h"
TANK = FunctionSimulator(
    lambda t, x, u, p: [(p.k * u.pump - p.a * np.sqrt(19.62 * np.maximum(x.h, 0.0))) / p.A],
    [Port("pump", "input", "V"), Port("h", "state", "m")],
    {"A": (0.0154, 0.02, "m^2"), "a": (5e-5, 0.1, "m^2"), "k": (2e-5, 0.05, "m^3/s/V")},
)


@pytest.fixture(scope="module")
def evidence() -> ShootingEvidence:
    """A tank with a leak, of which the level is read to a millimetre."""
    rng, t, h = np.random.default_rng(5), np.arange(0.0, 400.0), [0.15]
    pump = np.repeat(rng.uniform(4.0, 8.0, 20), 20)
    for u in pump[:-1]:
        for _ in range(10):
            out = (5.3e-5 * np.sqrt(19.62 * h[-1]) + 4e-5 * np.sqrt(h[-1])) / 0.0154
            h = [*h[:-1], h[-1] + 0.1 * (2e-5 * u / 0.0154 - out)]
        h.append(h[-1])
    found = evidence_of(pd.DataFrame({"time": t, "pump": pump, "h": h + 1e-3 * rng.standard_normal(len(t))}), TANK)
    assert isinstance(found, ShootingEvidence)
    return found


def test_slopes_are_those_of_the_residuals_under_an_effect(evidence: ShootingEvidence) -> None:
    to = evidence.placements[LEAK].outward({"conductance": 1.0, "exponent": 1.0})["conductance"]
    spec, x = {LEAK: {"conductance": 2.6e-3 / to, "exponent": 0.5}}, np.zeros(len(evidence.free))
    for name in ("a", "k"):
        step = 0.1 * (np.array(evidence.free) == name)
        there, before = (evidence.z(spec, dict(zip(evidence.free, x + s, strict=True))) for s in (step, -step))
        slope = evidence.slopes(spec, x)[:, evidence.free.index(name)]
        assert np.linalg.norm(slope - (there - before) / 0.2) < 0.03 * np.linalg.norm(slope)


def test_a_fit_ends_where_exact_residuals_are_likeliest(evidence: ShootingEvidence) -> None:
    """Wherever it begins, and along the way on which the leak, an area and the pump balance."""
    fitter, place = Fitter(evidence), evidence.placements[LEAK]
    to = place.outward({"conductance": 1.0, "exponent": 1.0})["conductance"]
    found = [fitter.refine({LEAK: {"conductance": k / to, "exponent": 0.5}}) for k in (1e-3, 5e-3)]
    assert abs(found[0].loglik - found[1].loglik) < 0.1
