"""A hidden state that a simulator soon forgets is known from what came before: no stretch begins with just any."""

import numpy as np
import pandas as pd
import pytest

from pamid import diagnose
from pamid.gap.residuals.recalled import Recalled, recalled
from pamid.gap.simulated import evidence_of
from pamid.simulators import EquationSimulator, Port

MASS, THRUST, LAG, DRAG, GRAVITY = 0.9, 18.0, 0.06, 0.25, 9.81
DRONE = EquationSimulator(
    {"dz/dt": "v", "dv/dt": f"(f - d*v)/m - {GRAVITY}", "df/dt": "(k*u - f)/tau"},
    [Port("u", "input", "-"), Port("z", "state", "m"), Port("v", "state", "m/s"), Port("f", "state", "N", start=8.8)],
    {"m": MASS, "k": (THRUST, 0.05, "N"), "tau": (LAG, 0.05, "s"), "d": (DRAG, 0.05, "N s/m")},
)


def flown(gain=1.0, near_ground=0.0, rows=1000, dt=0.01):
    """A drone that is held at a moving height by what its sensor reads; its thrust is not logged."""
    rng, runs = np.random.default_rng(4), []
    for run in range(2):
        t, x, u, held, logged = dt * np.arange(rows), np.array([0.7, 0.0, MASS * GRAVITY]), [], 0.0, []
        target = 0.75 + 0.2 * np.sin(0.9 * t + run) + 0.1 * np.sin(2.3 * t + 2 * run)
        before = 0.7 * gain
        for k in range(rows):
            read = gain * x[0] + 1e-3 * rng.standard_normal()
            held += dt * (target[k] - read)
            speed, before = (read - before) / dt if k else 0.0, read
            push = 9.0 * (target[k] - read) - 0.4 * np.clip(speed, -3.0, 3.0) - 3.0 * x[1] + 3.0 * held
            u = float(np.clip(MASS * (GRAVITY + push) / THRUST, 0.05, 1.0))
            logged.append((u, read))
            for _ in range(5):
                lift = x[2] * (1.0 + near_ground / x[0] ** 2)
                slope = [x[1], (lift - DRAG * x[1]) / MASS - GRAVITY, (THRUST * u - x[2]) / LAG]
                x = x + dt / 5 * np.array(slope)
        u, z = np.array(logged).T
        runs.append(pd.DataFrame({"trajectory": str(run), "time": t, "u": u, "z": z}))
    return pd.concat(runs, ignore_index=True)


def test_a_force_by_height_is_no_start_of_many_short_stretches():
    evidence = evidence_of(flown(near_ground=0.01), DRONE, refit=True)
    assert min(s.stop - s.first for s in evidence.stretches) > 60
    assert max(evidence.without_causes().scales) > 2.0
    assert np.ptp(evidence.along[2]) < 6.0  # N; starts may explain errors by 100 N and more


def test_stretches_that_show_a_gap_are_preferred_to_shorter_ones_that_hide_it():
    assert diagnose(flown(near_ground=0.03), DRONE).verdict != "none"
    assert diagnose(flown(), DRONE).verdict == "none"


def test_a_height_that_is_read_too_large_is_found_by_long_stretches():
    found = diagnose(flown(gain=1.2), DRONE)
    assert [c.effects[0] for c in found.added] == ["sensor_gain"], str(found)
    assert found.added[0].parameters["deviation"].value == pytest.approx(0.2, abs=0.03)


def runs(x0, decay=(0.5, 0.02), n=400):
    """Two runs of two states, one that soon forgets its start and one that hardly does."""
    t = np.arange(n)
    free = np.array([[x * np.exp(-rate * t) for x in row] for row, rate in zip(x0, decay, strict=True)])
    return (free + np.sin(0.05 * t)).reshape(len(x0), -1)


def test_what_is_known_is_what_two_starts_lead_to():
    x0, spans = np.zeros((2, 2)), [(0, 400), (400, 800)]
    found = recalled(runs, x0, [0, 1], spans)
    assert found.states == [0]
    assert found.along[0, 200] == pytest.approx(np.sin(10.0), abs=1e-6)
    assert found.along[0, 400] == pytest.approx(np.mean(found.along[0, 401:]), abs=0.05)  # nothing came before
    assert recalled(runs, x0, [], spans).states == []


def test_starts_count_by_how_much_a_state_varies():
    known = Recalled([1], np.array([[1.0, 2.0, 3.0, 4.0]]), np.array([0.5]))
    firsts = np.array([0, 2])
    x0 = np.array([[7.0, 8.0], [1.0, 4.0]])
    assert known.begun(x0, firsts).tolist() == [[7.0, 8.0], [1.0, 3.0]]
    assert known.error(x0, firsts).tolist() == [[0.0, 0.0, -2.0, 0.0]]
    h = 1e-6
    moved = known.error(x0 + h * np.array([[0.0], [1.0]]), firsts)
    assert known.slopes(2, firsts)[1] == pytest.approx((known.error(x0, firsts) - moved) / h)
    assert not known.slopes(2, firsts)[0].any()
