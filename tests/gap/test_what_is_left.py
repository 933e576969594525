"""What a diagnosis leaves open, and what a cause explains that the tolerances do not."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pamid.gap.diagnosis.rivals import rivals_of
from pamid.gap.inference.student_t import bounded


def _explanation(score: float, **effects: float) -> Any:
    spec = {name: {"size": size} for name, size in effects.items()}
    return SimpleNamespace(names=frozenset(spec), score=score, fit=SimpleNamespace(spec=spec, x=np.zeros(0)))


@pytest.mark.parametrize(("kind", "left"), [("cause", 2), ("unknown", 3)])
def test_more_than_the_named_causes_is_no_alternative_to_them(kind: str, left: int) -> None:
    base, best = _explanation(-900.0), _explanation(-100.0, friction=1.0)
    more, other = _explanation(-60.0, friction=1.0, delay=1.0), _explanation(-101.0, damping=1.0)
    outcome = SimpleNamespace(base=base, best=best, refitted=[best, more, other])
    verdict = SimpleNamespace(kind=kind, named=kind == "cause", outcome=outcome)
    competition = SimpleNamespace(
        comparable=lambda h: h.score, degenerate=lambda fit, name: False, evidence=SimpleNamespace(free=[])
    )
    found = rivals_of(competition, verdict)  # type: ignore[arg-type]
    assert [set(r.effects) for r in found][:1] == [{"friction"}]
    assert len([r for r in found if r.effects]) == left


def test_a_cause_far_beyond_the_tolerances_is_not_explained_by_them() -> None:
    """A gain of -29 % acts as mass, damping and stiffness would together, all of them far beyond 2 %."""
    rng = np.random.default_rng(0)
    J = rng.standard_normal((500, 3))
    whole = J @ [14.0, -6.0, 0.5]
    at = np.array([0.0, 0.2, 0.0])
    taken = bounded(J.T @ J, J.T @ whole, -1.005 - at, 1.005 - at)
    assert np.all(np.abs(at + taken) < 1.01) and taken[0] > 1.0
    assert np.linalg.norm(whole - J @ taken) > 0.8 * np.linalg.norm(whole)
    assert np.allclose(bounded(J.T @ J, 0.01 * J.T @ whole, -np.ones(3), np.ones(3)), [0.14, -0.06, 0.005])
