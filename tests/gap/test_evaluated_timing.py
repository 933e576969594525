"""`evaluate` allows for what nobody knows within a sample, as a diagnosis does: it is no error of the simulator."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from pamid.gap import evaluate_simulator

from ..support.rail import log_of, rail


def worst(log: pd.DataFrame) -> float:
    """Return the largest error of an equation, in units of its noise."""
    return max(e.rmse / e.noise_floor for e in evaluate_simulator(log, rail()).values())


@pytest.mark.parametrize("early", [0.0, 0.5, -0.5])
def test_a_command_half_a_sample_aside_is_no_error(early: float) -> None:
    log = log_of(0.0)
    moved = log.groupby("trajectory")["F"].transform(
        lambda F: np.interp(np.arange(len(F)) + early, np.arange(len(F)), F)
    )
    assert worst(log.assign(F=moved)) < 1.2


def test_a_friction_is_still_an_error() -> None:
    assert worst(log_of(0.8)) > 10.0 * worst(log_of(0.0))
