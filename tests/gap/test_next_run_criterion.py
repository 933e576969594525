"""What a run is expected to tell before it is recorded, compared with what it tells then."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pandas as pd
import pytest

from pamid.bench import BenchParameters, Controller, simulate, sine, triangle
from pamid.gap.design.expected_cost import CURVATURE, expected_cost
from pamid.gap.design.family import DesignedRun
from pamid.gap.design.followed import controller_of
from pamid.gap.design.known import known_of
from pamid.gap.design.score import Discrimination, gained
from pamid.gap.inference.competition import Competition
from pamid.gap.inference.gauss_newton import Fit, Fitter
from pamid.gap.inference.student_t import loglik
from pamid.gap.residuals.bench import Evidence
from pamid.gap.several.stacked import Log, StackedEvidence

NOMINAL = BenchParameters.for_muscle("B")
TRUE = [("viscous_friction", {"coefficient": 0.25})]
RUNS = [
    DesignedRun("sine", 2.0, frequency=6.0, amplitude=15.0),
    DesignedRun("triangle", 2.0, frequency=5.0, amplitude=12.0),
    DesignedRun("multisine", 2.0, frequency=2.5, amplitude=15.0),
    DesignedRun("steps", 2.0, frequency=6.0, amplitude=12.0),
    DesignedRun("isobaric", 2.0, frequency=6.0, amplitude=12.0),
]


@pytest.fixture(scope="module")
def slow() -> pd.DataFrame:
    return simulate(NOMINAL, [sine(1, 10, 1200), triangle(1.5, 8, 1200)], effects=TRUE, seed=0)


def test_the_expected_cost_is_the_mean_of_the_likelihood_of_a_diagnosis() -> None:
    rng = np.random.default_rng(0)
    left = np.concatenate([np.full(60, 0.4), np.full(30, 2.0), np.full(10, 15.0)])
    parts = [slice(0, 100)]
    lost = [loglik(n, parts)[0] - loglik(left + n, parts)[0] for n in rng.standard_normal((300, 100))]
    cost, scale = expected_cost(left[:, None], 0.0)
    assert cost[0] == pytest.approx(np.mean(lost), rel=0.05) and scale[0] > 1.0
    earlier, _ = expected_cost(left[:, None], 400.0)  # noise elsewhere keeps the scale small
    assert earlier[0] > 1.1 * cost[0]
    assert pytest.approx(1.0, abs=0.02) == CURVATURE


def test_runs_tell_nothing_all_or_the_wrong_thing() -> None:
    even = np.full(2, 0.5)
    for size, told in ((0.0, 0.0), (200.0, np.log(2.0))):
        D = np.full((2, 2, 3), size) * (1.0 - np.eye(2))[:, :, None]
        assert gained(D, even) == pytest.approx(told, abs=1e-3)
    each = [gained(np.array([[[0.0], [s]], [[s], [0.0]]]), even) for s in (1.0, 3.0, 9.0)]
    assert all(a < b for a, b in pairwise(each))
    # One pair that is told for certain is worth less than two that are told fairly.
    third = np.full(3, 1 / 3)
    easy = np.array([[0.0, 900.0, 0.0], [900.0, 0.0, 900.0], [0.0, 900.0, 0.0]])[:, :, None]
    fair = 8.0 * (1.0 - np.eye(3))[:, :, None]
    assert gained(easy, third) < gained(fair, third)


@pytest.mark.parametrize("controller", [Controller(), Controller(forward=0.7), Controller(damping=1.2, pressure=2.3e5)])
def test_a_design_moves_as_the_bench_does(controller: Controller) -> None:
    log = simulate(NOMINAL, [sine(2, 10, 1500), sine(4, 12, 1500)], controller=controller, seed=1)
    found = controller_of([log], NOMINAL)
    run = [DesignedRun("sine", 2.0, frequency=8.0, amplitude=12.0).trajectory("x")]
    there, own, meant = (
        np.std(np.gradient(simulate(NOMINAL, run, controller=c, seed=0)["q"])) for c in (controller, None, found)
    )
    assert meant == pytest.approx(there, rel=0.1)
    assert abs(meant - there) <= abs(own - there) + 0.03 * there
    assert found.pressure == pytest.approx(controller.pressure, rel=0.01)
    assert controller_of([log.drop(columns="q_ref")], NOMINAL) == Controller()


def test_what_is_drawn_stays_within_the_bounds_and_what_the_log_allows(slow: pd.DataFrame) -> None:
    log = Evidence(slow, NOMINAL)
    fit = Fitter(log).refine({"viscous_friction": {"coefficient": 0.2}})
    known = known_of([log], fit, 1.0, np.random.default_rng(0), 8)
    assert len(known.draws) == 8
    values = [d.fit.spec["viscous_friction"]["coefficient"] for d in known.draws]
    assert len(set(values)) > 4 and min(values) >= 0.0
    assert min(values) < fit.spec["viscous_friction"]["coefficient"] < max(values)
    assert all(0.0 <= d.lost < 40.0 for d in known.draws)


def test_predicted_discrimination_is_realised_within_a_factor_of_two(slow: pd.DataFrame) -> None:
    log = Evidence(slow, NOMINAL)
    fits = [Fitter(log).refine({"viscous_friction": {"coefficient": 0.2}}), Fitter(log).base()]
    rng = np.random.default_rng(0)
    known = [known_of([log], f, 0.5, rng, 2) for f in fits]
    there = simulate(NOMINAL, [r.trajectory(str(k)) for k, r in enumerate(RUNS)], effects=[*TRUE], seed=3)
    trial = simulate(
        log.corrected(fits[0].spec, dict(zip(log.free, map(float, fits[0].x), strict=True))),
        [r.trajectory(str(k)) for k, r in enumerate(RUNS)],
        seed=9,
    )
    told = Discrimination(Evidence(trial, NOMINAL), known)
    before = _scores(fits, {"slow": slow})
    for k in range(len(RUNS)):
        after = _scores(fits, {"slow": slow, "more": there[there["trajectory"] == str(k)]})
        realised = (after[0] - after[1]) - (before[0] - before[1])
        assert 0.5 < realised / told.between([k])[0, 1] < 2.0


def _scores(fits: list[Fit], tables: dict[str, pd.DataFrame]) -> list[float]:
    stack = StackedEvidence([Log(n, Evidence(t, NOMINAL), "one") for n, t in tables.items()])
    competition = Competition(stack, [])
    found = [competition.fitter.refine(f.spec, near=f.x) if f.spec else competition.fitter.base() for f in fits]
    return [competition.hypothesis(f).score for f in found]
