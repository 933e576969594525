"""Over whole runs a simulator adds up what its inputs do between rows, and their noise."""

import numpy as np
import pandas as pd
import pytest

from pamid.gap.residuals.shooting import ShootingEvidence
from pamid.simulators import EquationSimulator, Port
from pamid.simulators.port_log import port_log

SERVO = EquationSimulator(
    {"dx/dt": "v", "dv/dt": "40*p - 10*v", "dp/dt": "400*(i*sqrt(max(1 - sign(i)*p, 0)) - v)"},
    [Port("i", "input", "A"), Port("x", "state", "m"), Port("v", "state", "m/s"), Port("p", "state", "-")],
    {},
)


def driven(noise=1e-3, rows=600, dt=4e-3):
    """A servo cylinder under a smooth current that is logged with noise."""
    rng, runs = np.random.default_rng(0), []
    t, h = dt * np.arange(rows), dt / 8
    for run, w in enumerate((2.2, 5.1)):

        def current(t, w=w):
            return 0.9 * np.sin(w * t) + 0.4 * np.sin(2.7 * w * t + 1)

        def rates(t, x, current=current):
            i = current(t)
            flow = i * np.sqrt(max(1 - np.sign(i) * x[2], 0))
            return np.array([x[1], 40 * x[2] - 10 * x[1], 400 * (flow - x[1])])

        x, read = np.zeros(3), []
        for now in t:
            read.append(x)
            for s in now + h * np.arange(8):
                a = rates(s, x)
                b = rates(s + h / 2, x + h / 2 * a)
                x = x + h * rates(s + h / 2, x + h / 2 * b)
        q, _, p = np.array(read).T
        q, p = q + 1e-5 * rng.standard_normal(rows), p + 2e-3 * rng.standard_normal(rows)
        i = current(t) + noise * rng.standard_normal(rows)
        runs.append(pd.DataFrame({"trajectory": str(run), "time": t, "i": i, "x": q, "p": p}))
    return pd.concat(runs, ignore_index=True)


@pytest.fixture(scope="module")
def held():
    return ShootingEvidence(port_log(driven(), SERVO), SERVO, refit=True)


def test_inputs_in_lines_are_run_before_they_are_compared_with_held_ones(held):
    assert held.lines_explain_more()
    assert not held.lines  # what was asked is not what is


def test_noise_of_an_input_counts_as_the_simulator_adds_it_up_and_as_a_fit_smooths_it(held):
    evidence = ShootingEvidence(held.log, SERVO, refit=True, lines=True, like=held)
    assert any("The noise of i is allowed for" in note for note in evidence.notes)
    assert max(evidence.without_causes().scales) < 1.1


def test_half_as_long_predictions_begin_where_the_longer_ones_pass(held):
    halves = ShootingEvidence(held.log, SERVO, refit=True, like=held, halves=True)
    lengths = [s.stop - s.first for s in halves.stretches]
    assert sum(lengths) == held.log.n and len(lengths) == 2 * len(held.stretches)
    begins = [s.first for s in halves.stretches]
    v = SERVO.states.index("v")  # which the log lacks
    assert np.allclose(halves.laid[v], held.along[v, begins], atol=0.03 * np.ptp(held.along[v]))


def test_a_simulator_with_a_late_sensor_of_its_own_is_halved_too():
    late = SERVO.with_({}, [("sensor_delay", "x", {"delay": 0.01})])
    log = port_log(driven(rows=150), late)
    whole = ShootingEvidence(log, late)
    halves = ShootingEvidence(log, late, like=whole, halves=True)
    assert whole.along.shape == (3, log.n)
    assert len(halves.stretches) == 2 * len(whole.stretches)
