"""Steps of an integrator beside all causes: they are searched again only if these promise to close what is left."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from pamid.gap.inference import stepped
from pamid.gap.inference.student_t import loglik

PART = slice(0, 200)


def promised(left: float, closed: float, monkeypatch: pytest.MonkeyPatch) -> bool:
    """Return whether steps are promising that take a share of what a cause leaves, in units of the noise."""
    z = left * np.random.default_rng(0).standard_normal(200)

    def fitter(z: np.ndarray) -> SimpleNamespace:
        return SimpleNamespace(n=0, promise=lambda *_: SimpleNamespace(z=z, loglik=loglik(z, [PART])[0]))

    fit = SimpleNamespace(x=np.zeros(0), spec={})
    best, base = (SimpleNamespace(names=frozenset(n), fit=fit, left=np.array([left])) for n in ("a", ""))
    competition = SimpleNamespace(
        comparable=lambda h: 0.0 if h is best else -1e6, enough=lambda h: bool(np.all(h.left <= 1.2)),
        least=np.array([1.2]), fitter=fitter(z),
    )  # fmt: skip
    monkeypatch.setattr(stepped, "Fitter", lambda _: fitter((1.0 - closed) * z))
    outcome = SimpleNamespace(base=base, best=best, refitted=[base, best])
    return stepped._promise(competition, SimpleNamespace(parts=[PART]), outcome)


def test_who_interrupts_the_search_with_steps_interrupts_the_search(monkeypatch: pytest.MonkeyPatch) -> None:
    class Again(SimpleNamespace):
        def __init__(self, *_: object) -> None:
            super().__init__(interrupted=True, comparable=lambda _: 0.0, enough=lambda _: False)

    best = SimpleNamespace(names=frozenset("a"))
    competition = SimpleNamespace(
        evidence=SimpleNamespace(stepped=lambda: best), library=["a"], say=print, templates=[], interrupted=False,
        comparable=lambda _: 0.0, enough=lambda _: False,
    )  # fmt: skip
    monkeypatch.setattr(stepped, "_promise", lambda *_: True)
    monkeypatch.setattr(stepped, "Competition", Again)
    outcome = SimpleNamespace(best=best)
    assert stepped.with_steps(competition, outcome, lambda _: outcome) is None and competition.interrupted


def test_steps_that_close_most_of_what_is_left_are_promising(monkeypatch: pytest.MonkeyPatch) -> None:
    assert promised(3.0, 0.5, monkeypatch)
    assert not promised(3.0, 0.01, monkeypatch)
    assert not promised(1.1, 0.5, monkeypatch)  # nothing is left to close
