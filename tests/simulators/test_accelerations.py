"""Accelerometers read what effects add to rates; load cells do not."""

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from pamid.gap.inference.gauss_newton import Fitter
from pamid.gap.simulated import evidence_of
from pamid.simulators import FunctionSimulator, Port
from pamid.simulators.accelerations import rates_read

FRICTION = "coulomb_friction@x"


def acceleration(x: SimpleNamespace, u: SimpleNamespace, p: SimpleNamespace) -> np.ndarray:
    """Of a cart, as its user knows it."""
    return (u.F - p.d * x.v) / p.m


CART = FunctionSimulator(
    lambda t, x, u, p: [x.v, acceleration(x, u, p)],
    [Port("F", "input", "N"), Port("x", "state", "m"), Port("v", "state", "m/s"), Port("acc", "output", "m/s^2"),
     Port("cell", "output", "N")],
    {"m": (2.0, 0.02, "kg"), "d": (1.5, 0.2, "N s/m")},
    output=lambda t, x, u, p: [acceleration(x, u, p), u.F - p.d * x.v],
)  # fmt: skip


def test_an_output_that_is_a_rate_is_found_whatever_its_parameters() -> None:
    """The load cell goes with the acceleration too, but for a parameter, and has another unit."""
    rng, t = np.random.default_rng(1), np.linspace(0.0, 1.0, 50)
    found = rates_read(CART, {"v"}, t, rng.standard_normal((2, 50)), rng.standard_normal((1, 50)))
    np.testing.assert_allclose(found, [[0.0, 1.0], [0.0, 0.0]], atol=1e-9)


@pytest.fixture(scope="module")
def log() -> pd.DataFrame:
    """The cart with dry friction, 1.2 N, its acceleration read beside its position."""
    rng, n, dt, fine = np.random.default_rng(2), 400, 0.01, 20
    F, x, v, rows = 4.0 * np.sin(1.3 * dt * np.arange(n)) + 3.0 * np.sin(4.1 * dt * np.arange(n)), 0.0, 0.0, []
    for k in range(n):
        rows.append((k * dt, F[k], x, (F[k] - 1.5 * v - 1.2 * np.tanh(v / 0.005)) / 2.0))
        for _ in range(fine):
            v += dt / fine * (F[k] - 1.5 * v - 1.2 * np.tanh(v / 0.005)) / 2.0
            x += dt / fine * v
    log = pd.DataFrame(rows, columns=["time", "F", "x", "acc"])
    log["x"] += 2e-4 * rng.standard_normal(n)
    log["acc"] += 0.02 * rng.standard_normal(n)
    return log


def test_friction_alone_explains_motion_and_accelerometer(log: pd.DataFrame) -> None:
    """An accelerometer that were deaf to it would leave 0.97 of its gap."""
    evidence = evidence_of(log, CART, simulated=True)
    place = evidence.placements[FRICTION]
    fit = Fitter(evidence).at({FRICTION: place.inward({"amplitude": 1.2, "transition": 0.005})})
    assert np.all(fit.scales < 0.1 * evidence.without_causes().scales)  # rows leave open when a motion turns
