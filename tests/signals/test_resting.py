"""Rows in which a position rests."""

from __future__ import annotations

import numpy as np
import pytest

from pamid.signals.resting import resting_rows

DT = 0.002
TIME = np.arange(0.0, 20.0, DT)


@pytest.mark.parametrize("frequency", [0.05, 0.5, 3.0])
@pytest.mark.parametrize("noise", [0.0, 1e-5, 1e-3])
def test_turning_is_no_rest(frequency: float, noise: float) -> None:
    x = np.sin(2 * np.pi * frequency * TIME) + noise * np.random.default_rng(0).standard_normal(len(TIME))
    assert not resting_rows(x, DT, np.zeros(len(x), dtype=int)).any()


@pytest.mark.parametrize("step", [0.0, 1e-3])
@pytest.mark.parametrize("noise", [1e-6, 1e-4, 1e-3, 1e-2])
def test_stops_are_found_whatever_noise_and_steps(noise: float, step: float) -> None:
    x = np.sin(np.pi * np.minimum(TIME % 5.0, 2.0)) + noise * np.random.default_rng(1).standard_normal(len(TIME))
    x = np.round(x / step) * step if step else x
    rows, phase = resting_rows(x, DT, np.zeros(len(x), dtype=int)), TIME % 5.0
    assert rows[(phase > 2.1) & (phase < 4.9)].all()
    assert not rows[(phase > 0.1) & (phase < 1.9)].any()


def test_what_never_moves_and_what_moves_slowly_in_one_run_does_not_rest() -> None:
    still = np.random.default_rng(2).standard_normal(len(TIME))
    assert not resting_rows(still, DT, np.zeros(len(TIME), dtype=int)).any()
    slow_and_fast = np.concatenate([0.01 * TIME, np.sin(10 * TIME)])
    codes = np.repeat([0, 1], len(TIME))
    assert not resting_rows(slow_and_fast, DT, codes).any()
