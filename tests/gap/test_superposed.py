"""Known responses that add up to another: no run is needed for it, and none is left out where one is."""

from __future__ import annotations

import numpy as np
import pytest

from pamid.gap.residuals.superposed import Superposed


@pytest.fixture
def known() -> tuple[Superposed, np.ndarray]:
    changes = np.random.default_rng(0).normal(size=(20, 60))
    superposed = Superposed()
    for number, change in enumerate(changes):
        superposed.add(change, number)
    return superposed, changes


def test_a_sum_of_known_changes_has_their_shares(known: tuple[Superposed, np.ndarray]) -> None:
    superposed, changes = known
    wanted = np.zeros(20)
    wanted[[2, 7, 19]] = 0.5, -1.0, 0.25
    found = superposed.shares(wanted @ changes, 10.0)
    assert found is not None and list(found[1]) == list(range(20))
    assert found[0] == pytest.approx(wanted, abs=1e-9)


def test_a_new_direction_needs_a_run(known: tuple[Superposed, np.ndarray]) -> None:
    superposed, changes = known
    other = np.random.default_rng(1).normal(size=60)
    assert superposed.shares(other, float(np.linalg.norm(other))) is None
    assert superposed.shares(changes[0] + 1e-3 * other, float(np.linalg.norm(changes[0]))) is not None
    assert Superposed().shares(other, 1.0) is None


def test_the_same_change_twice_is_one_direction(known: tuple[Superposed, np.ndarray]) -> None:
    superposed, changes = known
    superposed.add(2.0 * changes[3], 20)
    found = superposed.shares(changes[3], 10.0)
    assert found is not None and len(found[0]) == 20 and found[0][3] == pytest.approx(1.0)


def test_changes_that_nearly_cancel_leave_too_much_of_their_errors() -> None:
    superposed, one = Superposed(), np.eye(2)[0]
    superposed.add(one, 0)
    superposed.add(one + np.array([0.0, 1e-3]), 1)
    assert superposed.shares(np.array([0.0, 1.0]), 1.0) is None
    assert superposed.shares(one, 1.0) is not None
