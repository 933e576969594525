"""Noise under sets of effects: what one of them does to it does not hide what another does."""

from __future__ import annotations

import numpy as np
import pytest

from pamid.gap.residuals.direct import DirectEvidence
from pamid.gap.simulated import evidence_of

from ..support.rail import log_of, rail

LAG = {"sensor_lag@x": {"time_constant": 0.03}}
DRAG = {"viscous_friction@x": {"coefficient": 0.5}}


@pytest.fixture(scope="module")
def evidence() -> DirectEvidence:
    found = evidence_of(log_of(0.0), rail())
    assert isinstance(found, DirectEvidence)
    return found


def test_a_lag_that_is_undone_lets_noise_grow_beside_a_friction_as_alone(evidence: DirectEvidence) -> None:
    alone, friction, both = (evidence.widening(s) for s in (LAG, DRAG, {**LAG, **DRAG}))
    assert alone is not None and friction is not None and both is not None
    assert np.max(alone) > 1.5  # it is undone by differences of what is read
    np.testing.assert_allclose(both, alone * friction)
