"""How well a log shows its own noise."""

from __future__ import annotations

import numpy as np
import pytest

from pamid.signals.noise import SPREAD, third_differences, white_noise


@pytest.mark.parametrize("rows", [200, 1600])
def test_the_spread_of_the_estimate_is_the_stated_one(rows):
    rng = np.random.default_rng(7)
    found = [white_noise(third_differences(rng.standard_normal(rows))) for _ in range(2000)]
    assert np.mean(found) == pytest.approx(1.0, abs=0.02)
    assert np.std(found) * np.sqrt(rows) == pytest.approx(SPREAD, rel=0.08)
