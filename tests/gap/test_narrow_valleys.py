"""Fits where a parameter undoes nearly all that a cause changes: all but one part in a thousand, say."""

import numpy as np
import pandas as pd
import pytest

from pamid.gap.inference.descent import Bounds, Prior, descend
from pamid.gap.inference.first_order import FirstOrder
from pamid.gap.inference.gauss_newton import FINAL, Fitter
from pamid.gap.simulated import evidence_of
from pamid.simulators import FunctionSimulator, Port

BIAS = "actuator_bias@thrust"
LIFT = FunctionSimulator(
    lambda t, x, u, p: [x.vz, (p.kf * u.thrust - p.d * x.vz) / p.m - 9.81],
    [Port("thrust", "input", "-"), Port("z", "state", "m"), Port("vz", "state", "m/s")],
    {"m": (0.9, 0.03, "kg"), "kf": (18.0, 0.05, "N"), "d": (0.25, 0.2, "N s/m")},
)


def test_steps_are_hardly_damped_in_a_narrow_valley() -> None:
    """Two columns that differ by 1e-3 of their length need each other at any size."""
    rng = np.random.default_rng(0)
    a, b = (np.linalg.qr(rng.standard_normal((200, 2)))[0].T * 1e5).tolist()
    A = np.column_stack([a, a + 1e-3 * np.array(b)])
    z0 = rng.standard_normal(200) - A @ np.array([5.0, -5.0])
    z0 += 60.0 * np.array(b) / 1e5  # what is seen along the valley
    wide, none = Bounds.of(np.full(2, -1e3), np.full(2, 1e3)), Prior(np.zeros(2), np.zeros(2))
    s = descend(lambda x: z0 + A @ x, lambda _: A, np.zeros(2), lambda _: wide, [slice(0, 200)], np.ones(1), 24, none)
    best = np.linalg.lstsq(A, -z0, rcond=None)[0]
    np.testing.assert_allclose(s.z, z0 + A @ best, atol=0.5)


@pytest.fixture(scope="module")
def fitter() -> Fitter:
    """A vehicle held aloft, its thrust biased: open-loop predictions drift by metres where z is read to 0.1 mm."""
    rng, dt, n = np.random.default_rng(4), 0.01, 800
    rows = []
    for run in range(2):
        z, v = 1.5, 0.0
        goal = np.repeat(rng.uniform(1.3, 1.7, 8), n // 8)
        for k in range(n):
            thrust = float(np.clip(0.49 + 0.12 * (goal[k] - z) - 0.12 * v, 0.0, 1.0))
            rows.append((f"run {run}", k * dt, thrust, z))
            for _ in range(10):
                v += 0.1 * dt * ((18.1 * (thrust - 0.0043) - 0.26 * v) / 0.901 - 9.81)
                z += 0.1 * dt * v
    log = pd.DataFrame(rows, columns=["trajectory", "time", "thrust", "z"])
    log["z"] += 1e-4 * rng.standard_normal(len(log))
    return Fitter(evidence_of(log, LIFT, refit=True, simulated=True))


def test_a_bias_is_fitted_beside_the_gain_that_undoes_it_wherever_it_begins(fitter: Fitter) -> None:
    """In the mean, kf undoes it; what is left are hundredths of the noise in each row, over whole runs."""
    place = fitter.evidence.placements[BIAS]
    found = [fitter.refine({BIAS: place.inward({"offset": b})}) for b in (0.0, -0.002, -0.0043, -0.008)]
    assert max(f.loglik for f in found) - min(f.loglik for f in found) < FINAL
    assert all(np.all(f.scales < 1.05) for f in found)


def test_a_library_and_tolerances_are_linearised_about_one_point(fitter: Fitter) -> None:
    """Else what they do not undo of each other seems larger than the noise."""
    alone = FirstOrder(fitter.evidence, [BIAS]).alone()[BIAS]
    assert alone.closed > 0.99  # and 0.94 about two points
