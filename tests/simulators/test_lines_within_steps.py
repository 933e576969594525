"""Inputs in lines act as lines within a step, not as their mean."""

import numpy as np

from pamid.simulators import FunctionSimulator, Port
from pamid.simulators.integrate import Runner

LAG = FunctionSimulator(
    lambda t, x, u, p: [(u.u - x.x) / p.tau],
    [Port("u", "input", "V"), Port("x", "state", "V")],
    {"tau": (0.006, 0.1, "s")},
)


def test_a_lag_follows_a_ramp_exactly_as_the_method_allows() -> None:
    """Of a ramp r t it shows r (t - tau (1 - exp(-t / tau))); steps of two thirds of its time constant."""
    dt, n, tau, slope = 0.004, 40, 0.006, 500.0
    t = dt * np.arange(n)
    drive, numbers = (slope * t)[:, None, None], np.full((1, 1), tau)
    exact = slope * (t - tau * (1.0 - np.exp(-t / tau)))
    for near in (None, np.zeros((n, 1, 1))):
        x = Runner(LAG, dt, (), 1, True).states(t[:, None], np.zeros((1, 1)), drive, numbers, near=near)
        # The mean of each line, held, would be wrong by slope dt^2 / (12 tau), or 0.11 V.
        np.testing.assert_allclose(x[:, 0, 0], exact, atol=5e-3)
