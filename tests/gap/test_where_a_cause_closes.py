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


def closed(before: float, after: float) -> Closure:
    return Closure("any", before, after, noise_floor=0.3, closed_share=0.5, ci90=(0.4, 0.6))
