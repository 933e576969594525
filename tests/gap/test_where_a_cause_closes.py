"""The equation that a cause is told with: where it closes most of a gap, not where tolerances make up for it."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from pamid.gap import Closure
from pamid.gap.diagnosis.closure import main_equation

EVIDENCE = SimpleNamespace(
    equations=["first", "second"], parts=[slice(0, 4), slice(4, 8)], touched=lambda names: ["first", "second"]
)
CONTRIBUTION = np.repeat([2.0, 5.0], 4)
"""A cause that is stronger in the second equation."""


@pytest.mark.parametrize(("left", "where"), [(0.3, "second"), (2.99, "first")])
def test_a_cause_is_told_where_it_closes_most(left: float, where: str) -> None:
    closure = {"first": closed(2.2, 1.0), "second": closed(3.0, left)}
    assert main_equation(EVIDENCE, "leak", CONTRIBUTION, closure) == where


def test_a_cause_that_tolerances_made_up_for_is_told_where_the_gap_is() -> None:
    """A pump's gain changes the first tank's equation; the outflow was fitted to it, and left a gap in the second."""
    pump = SimpleNamespace(**{**vars(EVIDENCE), "touched": lambda names: ["first"]})
    closure = {"first": closed(0.3, 0.29, 0.0), "second": closed(3.0, 0.3)}
    assert main_equation(pump, "gain", CONTRIBUTION, closure) == "second"


def closed(before: float, after: float, share: float = 0.5) -> Closure:
    return Closure("any", before, after, noise_floor=0.3, closed_share=share, ci90=(0.4, 0.6))
