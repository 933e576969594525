"""Initial states that explain a gap are no states of the simulator: stretches begin where the log shows them to."""

import numpy as np
import pandas as pd
import pytest

from pamid.gap.residuals.influence import Influence
from pamid.gap.residuals.shooting import ShootingEvidence
from pamid.simulators import EquationSimulator, Port
from pamid.simulators.port_log import port_log

SHAFT = EquationSimulator(
    {
        "dmotor/dt": "speed",
        "dspeed/dt": "(0.12*i - K*(motor - load) - 0.02*(speed - turning))/4e-4",
        "dload/dt": "turning",
        "dturning/dt": "(K*(motor - load) + 0.02*(speed - turning))/1.5e-3",
    },
    [Port("i", "input", "A"), *(Port(n, "state", "rad", start=0.0) for n in ("motor", "load")),
     *(Port(n, "state", "rad/s", start=0.0) for n in ("speed", "turning"))],
    {"K": 6.0},
)  # fmt: skip


def shaft_log(friction, rows=1000, dt=0.004, parts=10):
    """One encoder at the motor of a soft shaft, whose load has dry friction."""
    runs = []
    for k, seed in enumerate((1, 2)):
        rng = np.random.default_rng(seed)
        t, x, motor = dt * np.arange(rows), np.zeros(4), []
        i = np.sin(5.0 * t + rng.uniform(0, 6)) + 0.6 * np.sin(13.0 * t + rng.uniform(0, 6))
        for amps in i:
            motor.append(x[0])
            for _ in range(parts):
                twist = 6.0 * (x[0] - x[2]) + 0.02 * (x[1] - x[3])
                turning = x[3] + dt / parts * (twist - friction * np.tanh(x[3] / 0.1)) / 1.5e-3
                speed = x[1] + dt / parts * (0.12 * amps - twist) / 4e-4
                x = np.array([x[0] + dt / parts * speed, speed, x[2] + dt / parts * turning, turning])
        read = np.array(motor) + 2e-4 * rng.standard_normal(rows)
        runs.append(pd.DataFrame({"trajectory": str(k), "time": t, "i": i, "motor": read}))
    return pd.concat(runs, ignore_index=True)


def begun(friction):
    found = ShootingEvidence(port_log(shaft_log(friction), SHAFT), SHAFT)
    apart = found.along[0] - found.log.channels["motor"]
    return found, apart[[s.first for s in found.stretches]] / np.std(found.log.channels["motor"])


def test_a_right_simulator_is_followed_over_whole_runs():
    found, apart = begun(0.0)
    assert len(found.stretches) == 2
    assert np.max(np.abs(apart)) < 0.01


def test_with_a_gap_no_stretch_is_so_long_that_where_it_begins_explains_it():
    found, apart = begun(0.05)
    assert np.max(np.abs(apart)) < 0.1
    states = found.along
    jumps = np.diff(states, axis=1)[:, [s.first - 1 for s in found.stretches if s.first not in (0, 1000)]]
    assert np.all(np.sqrt(np.mean(np.square(jumps), axis=1)) < 0.5 * np.std(states, axis=1))


def test_initial_states_are_apart_by_what_readings_show_beyond_their_noise():
    slopes = np.zeros((2, 1, 4))
    slopes[0] = 1.0  # the other state acts on nothing
    influence = Influence(slopes, np.array([0, 0, 1, 1]), 2)
    change = np.array([[10.0, 1.0], [100.0, 100.0]])
    found = influence.apart(change, 3.0)
    assert found == pytest.approx(np.array([[10.0 - 3.0 / np.sqrt(2.0), 0.0], [0.0, 0.0]]))
