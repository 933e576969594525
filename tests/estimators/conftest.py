"""Models of one muscle, from which the tests of adaptation start."""

from __future__ import annotations

import pytest
from pamid.estimators import (
    JointPIHM,
    StaticPIHM,
    ThermodynamicPIHM,
)
from support.sources import fitted


@pytest.fixture(scope="session")
def force():
    return fitted(StaticPIHM)


@pytest.fixture(scope="session")
def flow():
    return fitted(ThermodynamicPIHM)


@pytest.fixture(scope="session")
def published():
    return fitted(ThermodynamicPIHM, "neural")


@pytest.fixture(scope="session")
def both():
    return fitted(JointPIHM)
