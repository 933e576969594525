"""Readings in coarse steps, and unstable motion: noise that lasts, and initial states that soon act alike."""

import numpy as np
import pandas as pd
import pytest

from pamid.equations.noise import channel_noise
from pamid.gap.residuals.coarse import between_steps, error_in_steps
from pamid.gap.residuals.influence import Influence
from pamid.gap.simulated import evidence_of
from pamid.simulators import EquationSimulator, Port

STEP = 2e-3
ROD = EquationSimulator(
    {"dq/dt": "w", "dw/dt": "30*sin(q) - 0.3*w + u"},
    [Port("u", "input", "rad/s^2"), Port("q", "state", "rad"), Port("w", "state", "rad/s")],
    {},
)


def balanced(seed=0, step=STEP):
    """A rod that a controller balances with little motion; its encoder is coarse."""
    runs, dt = [], 5e-3
    for k in range(3):
        aim = 4 * STEP * np.sin(2 * np.pi * (0.2 + 0.1 * k) * dt * np.arange(1600) + k + 2 * seed)
        q, w, rows = 0.01, 0.0, []
        for wanted in aim:
            read = step * np.round(q / step) if step else q
            u = -70 * (q - wanted) - 12 * w - 30 * wanted
            rows.append((u, read))
            for _ in range(20):
                w += dt / 20 * (30 * np.sin(q) - 0.3 * w + u)
                q += dt / 20 * w
        u, q = np.array(rows).T
        runs.append(pd.DataFrame({"trajectory": str(k), "time": dt * np.arange(len(u)), "u": u, "q": q}))
    return pd.concat(runs, ignore_index=True)


@pytest.mark.parametrize("seed", [0, 1])
def test_a_right_simulator_misses_a_coarse_encoder_by_no_more_than_its_steps(seed):
    evidence = evidence_of(balanced(seed), ROD, simulated=True)
    z = evidence.raw(evidence.z0)
    assert 0.5 < np.std(z) < 1.2
    assert np.mean(np.abs(z) > 4.0) < 0.01


def test_errors_of_steps_last_as_long_as_a_step():
    x = balanced()["q"].to_numpy()[:1600]
    noise = channel_noise(x, 20)
    assert noise.resolution == pytest.approx(STEP) and noise.fixed > 0.0
    rng = np.random.RandomState(0)
    drawn = np.array([error_in_steps(x, noise, rng) for _ in range(40)])
    assert np.sqrt(np.mean(drawn**2)) == pytest.approx(STEP / np.sqrt(12), rel=0.15)
    means = drawn[:, :1600].reshape(40, 80, 20).mean(axis=2)
    white = STEP / np.sqrt(12 * 20)
    assert np.std(means) > 1.5 * white


def test_the_signal_behind_steps_is_within_half_of_one():
    t = np.linspace(0, 1, 400)
    smooth = 5 * np.sin(5 * t)
    assert np.max(np.abs(between_steps(np.round(smooth)) - smooth)) < 0.75
    assert np.array_equal(between_steps(np.full(5, 3.0)), np.full(5, 3.0))


def test_initial_states_of_an_unstable_motion_are_distinguished():
    evidence = evidence_of(balanced(), ROD, simulated=True)
    true = np.outer([1e-4, -2e-3], 1.0 + np.arange(len(evidence.stretches)))
    influence = Influence(evidence._slopes(evidence._x0), evidence._of, len(evidence.stretches))
    assert np.allclose(influence.explained(influence.moved(true)), true, rtol=1e-6)
