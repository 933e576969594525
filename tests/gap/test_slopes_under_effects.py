"""Sensitivities hold where a fit stands: those of the parameters as given end a fit where tolerances still balance."""

import numpy as np
import pandas as pd
import pytest

from pamid.gap.inference.gauss_newton import Fitter
from pamid.gap.simulated import evidence_of
from pamid.simulators import FunctionSimulator, Port

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
    assert abs(found[0].loglik - found[1].loglik) < 0.1
