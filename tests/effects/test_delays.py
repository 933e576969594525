"""A delayed reading of a smooth signal is right between samples, along a log and step by step alike."""

import numpy as np
import pytest

from pamid.effects._memory import delayed_rows, memory, shift

t = np.arange(200) * 0.01
WAVES = 2 * np.pi * np.array([3.0, 8.0])


def signal(t):
    return np.sin(WAVES[0] * t) + 0.3 * np.sin(WAVES[1] * t)


@pytest.mark.parametrize("samples", [0.3, 0.5, 1.5, 3.0, 4.7])
@pytest.mark.parametrize("way", [1, -1], ids=["delayed", "advanced"])
def test_a_smooth_signal_is_right_between_samples(samples, way):
    found = delayed_rows(signal(t), way * samples, [0], smooth=True)
    inside = slice(8, -8)
    assert np.max(np.abs(found - signal(t - way * samples * 0.01))[inside]) < 1e-3
    if samples % 1.0:
        straight = delayed_rows(signal(t), way * samples, [0])
        assert np.max(np.abs(straight - signal(t - way * samples * 0.01))[inside]) > 8e-3


@pytest.mark.parametrize("samples", [0.0, 0.3, 0.5, 1.5, 3.0, 4.7])
def test_step_by_step_is_the_same(samples):
    x = np.full(1 + memory(samples), signal(0.0))
    found = []
    for value in signal(t):
        x = shift(x, value, samples, smooth=True)
        found.append(x[0])
    along = delayed_rows(signal(t), samples, [0], smooth=True)
    # Less than a sample late, nothing newer is known step by step.
    assert np.allclose(found[8:-8], along[8:-8], atol=1e-12 if samples >= 1.0 or samples == 0.0 else 5e-3)
