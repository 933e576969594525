"""A short log knows its noise less well, and is accused later."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from pamid.gap.inference.significance import excess


def _p_value(rows: int, times: float) -> float:
    """Return how probable white residuals of this many times the noise are, with as many windows as rows."""
    z = times * np.random.default_rng(3).standard_normal(rows)
    zero = np.zeros(rows, int)
    evidence = SimpleNamespace(time=0.01 * np.arange(rows), run=zero, side=zero, stretch=0.3, rows=rows)
    return excess(evidence, z, slice(0, rows), times).p_value


def test_a_tenth_above_the_noise_is_a_gap_in_a_long_log_only():
    assert _p_value(40_000, 1.13) < 0.01
    assert _p_value(800, 1.13) > 0.01


def test_a_third_above_the_noise_is_a_gap_in_a_short_log():
    assert _p_value(800, 1.33) < 0.01
