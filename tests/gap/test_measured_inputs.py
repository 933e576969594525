"""Inputs that are measured have noise that never acts on the system; commands act with all that they hold."""

import numpy as np
import pandas as pd
import pytest

from pamid.gap import diagnose_simulator
from pamid.gap.residuals.measured_inputs import quieter, rough_inputs, shown
from pamid.gap.simulated import evidence_of
from pamid.signals.noise import common_step
from pamid.simulators import EquationSimulator, Port

ROTOR = EquationSimulator(
    {"dq/dt": "w", "dw/dt": "40*i - 60*sin(q) - 0.8*w"},
    [Port("i", "input", "A"), Port("q", "state", "rad"), Port("w", "state", "rad/s")],
    {},
)
NOISE = 0.02


def spun(acts, friction=0.0, seed=0, dt=5e-3, rows=1600):
    """A pendulum on a motor whose current is logged with noise, which acts on it or is that of its sensor."""
    rng, runs = np.random.default_rng(seed), []
    for run in range(2):
        t = dt * np.arange(rows)
        w, phase = 2 * np.pi * rng.uniform(0.2, 1.5, 4), rng.uniform(0, 6, 4)
        clean = 0.5 * np.sin(w * t[:, None] + phase).sum(axis=1)
        noisy = clean + NOISE * rng.standard_normal(rows)
        q, speed, read = 0.0, 0.0, []
        for now in noisy if acts else clean:
            read.append(q)
            for _ in range(10):
                speed += dt / 10 * (40 * now - 60 * np.sin(q) - 0.8 * speed - friction * np.tanh(speed / 1e-2))
                q += dt / 10 * speed
        q = np.array(read) + 2e-4 * rng.standard_normal(rows)
        runs.append(pd.DataFrame({"trajectory": str(run), "time": t, "i": noisy, "q": q}))
    return pd.concat(runs, ignore_index=True)


@pytest.mark.parametrize("seed", [0, 1])
def test_noise_of_a_measured_input_is_no_gap(seed):
    found = diagnose_simulator(spun(acts=False, seed=seed), ROTOR)
    assert found.verdict == "none"
    assert any("The noise of i is allowed for" in note for note in found.notes)


def test_a_command_acts_with_all_that_it_holds():
    found = diagnose_simulator(spun(acts=True), ROTOR)
    assert found.verdict == "none"
    assert not any("counts" in note for note in found.notes)


def test_friction_is_named_beside_the_noise_of_an_input():
    found = diagnose_simulator(spun(acts=False, friction=4.0), ROTOR)
    assert found.causes[0].effects[0] == "coulomb_friction"
    assert found.causes[0].parameters["amplitude"].value == pytest.approx(0.1, rel=0.1)  # A
    assert any("The noise of i is allowed for" in note for note in found.notes)


def test_undoing_a_fault_of_a_reading_leaves_the_noise_of_inputs():
    evidence = evidence_of(spun(acts=False), ROTOR)
    assert any("The noise of i is allowed for" in note for note in evidence.notes)
    least = {"sensor_lag@q": {"time_constant": 1e-4, "second": 1e-4}}
    assert evidence.spread(least, np.zeros(len(evidence.free))) == pytest.approx(1.0, abs=1e-2)


def test_noise_that_residuals_show_less_of_is_not_that_of_their_inputs():
    """A gap in one equation, and a small one in another, are no noise of inputs, which would show more in both."""
    parts, rng = [slice(0, 500), slice(500, 1000)], np.random.default_rng(0)
    white, mine = rng.standard_normal((6, 1000)), np.repeat(np.eye(2), 500, axis=1)
    inputs = [noise * mine[k] * rng.standard_normal((6, 1000)) for k, noise in enumerate((28.0, 23.0))]
    for sizes, expected in {(1.6, 9.3): [], (1.0, 23.0): [1], (28.0, 23.0): [0, 1]}.items():
        left = np.repeat(sizes, 500) * rng.standard_normal(1000)
        assert shown(left, white, inputs, parts) == expected


def test_residuals_too_small_for_the_noise_of_inputs_show_that_they_are_exact():
    parts, rng = [slice(0, 500)], np.random.default_rng(0)
    white = rng.standard_normal((6, 500))
    both = white + 20.0 * rng.standard_normal((6, 500))
    for size, expected in {1.0: True, 5.0: True, 20.0: False, 80.0: False}.items():
        assert quieter(size * rng.standard_normal(500), white, both, parts) is expected
    assert not quieter(0.5 * rng.standard_normal(500), white, white, parts)  # where inputs add nothing


def test_steps_of_a_held_command_are_no_noise():
    """Pulses of 1 to 3 V with three decimals: their smallest difference says nothing of a sensor."""
    rng = np.random.default_rng(0)
    held = np.repeat(np.round(rng.uniform(-1.0, 1.0, 12), 3), 50)
    assert common_step(held) == pytest.approx(1e-3)
    smooth = np.sin(0.01 * np.arange(1800))
    u = np.array([np.concatenate([smooth, held]), np.concatenate([smooth + 0.01 * rng.standard_normal(1800), held])])
    spans = [(0, 1800), (1800, 2400)]
    quiet, loud = rough_inputs(u, spans)
    assert quiet < 1e-4 and loud == pytest.approx(0.01 * 0.75**0.5, rel=0.1)
