"""A short log knows its noise less well, and is accused later."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from pamid.gap.diagnosis.signs import _Told
from pamid.gap.inference.significance import excess, noise_error
from pamid.gap.residuals.choice import sign_may_be_lost


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


@pytest.mark.parametrize(("exact", "times", "left"), [(False, 1.03, False), (False, 1.3, True), (True, 1.03, True)])
def test_what_is_less_than_the_noises_own_error_is_not_left_by_a_cause(exact, times, left):
    """Of a bench the weights of the signs are fitted to all that exceeds the noise as estimated."""
    told = object.__new__(_Told)
    told.unsure = 0.0 if exact else noise_error(SimpleNamespace(rows=2000))
    z = np.random.default_rng(1).standard_normal(2000)
    assert (told._excess(times * z / np.sqrt(np.mean(np.square(z)))) > 0.0) == left


@pytest.mark.parametrize("rows", [1, 5, 12, 40])
def test_a_sign_is_looked_for_no_farther_than_a_log_reaches(rows: int) -> None:
    log = SimpleNamespace(n=rows, channels={"x": np.linspace(1.0, 0.5, rows)}, dt=0.01, run=np.zeros(rows, int))
    simulator, rates = SimpleNamespace(states=("x",)), np.zeros((1, 2 * rows))
    found = SimpleNamespace(log=log, simulator=simulator, modelled=rates, channel_noise=lambda _: 0.01)
    assert not sign_may_be_lost(found)  # type: ignore[arg-type]
    found.modelled[:] = -200.0
    assert sign_may_be_lost(found)  # type: ignore[arg-type]
