"""No two statements about one cause contradict each other."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
import pytest

from pamid.gap import Diagnosis, diagnose_simulator
from pamid.gap.diagnosis import answer
from pamid.simulators import FunctionSimulator, Port

CALLS: list[tuple[Any, Any]] = []


@pytest.fixture(scope="module")
def rubbing() -> Diagnosis:
    """Return the diagnosis of a cart whose Coulomb friction its simulator lacks; what was competed is in `CALLS`."""
    rng, parts = np.random.default_rng(0), []
    for run in range(3):
        t, rows, x, v = np.arange(0.0, 4.0, 0.01), [], 0.0, 0.0
        force = 10.0 * np.sin((1.0 + 0.6 * run) * t) + 4.0 * np.sin(2.7 * t + run)
        for f in force:
            rows.append((x, v))
            for _ in range(10):
                v += 1e-3 * (f - 2.0 * v - 5.0 * x - 1.5 * np.tanh(v / 2e-3)) / 1.5
                x += 1e-3 * v
        x, v = np.array(rows).T + np.array([[1e-4], [1e-3]]) * rng.standard_normal((2, len(t)))
        parts.append(pd.DataFrame({"trajectory": f"run {run}", "time": t, "F": force, "x": x, "v": v}))
    ports = [
        Port("F", "input", "N"), Port("x", "state", "m"), Port("v", "state", "m/s"),
        Port("rail", "joint", "N", position="x", velocity="v", through="F"),
    ]  # fmt: skip
    cart = FunctionSimulator(lambda t, x, u, p: [x.v, (u.F - 2.0 * x.v - 5.0 * x.x) / 1.5], ports)
    competed = answer.candidates

    def kept(competition: Any, verdict: Any) -> Any:
        CALLS.append((competition, verdict))
        return competed(competition, verdict)

    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(answer, "candidates", kept)
        return diagnose_simulator(pd.concat(parts, ignore_index=True), cart)


def test_what_explains_no_more_than_noise_closes_nothing(rubbing: Diagnosis) -> None:
    faint = {c.effect: c for c in rubbing.candidates if "no more than noise" in c.ruled_out}
    assert faint and {c.closed_share for c in faint.values()} == {0.0}
    [(_, verdict), *_] = CALLS
    alone = [single.closed for name, single in verdict.outcome.singles.items() if name.partition("@")[0] in faint]
    assert max(alone) > 0.005  # of the same log by itself: 0 % is said since noise closes nothing


def test_what_was_named_was_not_ruled_out(rubbing: Diagnosis) -> None:
    named = {(name, where) for cause in rubbing.causes for name, where in zip(cause.effects, cause.where, strict=True)}
    assert named == {("coulomb_friction", "rail")}
    for c in rubbing.candidates:
        assert bool(c.ruled_out) != ((c.effect, c.where) in named or c.effect in ("none", "unknown"))
