"""What an effect remembers when a run begins: unknown in a log, taken off, and paid for."""

import numpy as np
import pytest

from pamid.bench import BenchParameters, simulate, sine, triangle
from pamid.gap import diagnose
from pamid.gap.diagnosis.answer import Evidence
from pamid.gap.residuals.beginnings import without_beginnings

NOMINAL = BenchParameters.for_muscle("B")
RUNS = [sine(2, 15, 1000), triangle(3, 12, 1000), sine(5, 10, 800)]
"""Runs that are cut out of a motion: springs that creep are on their way when they begin."""
CREEP = {"stiffness": 60.0, "time_constant": 1.0, "slow_stiffness": 60.0, "slow_time_constant": 5.0}


@pytest.fixture(scope="module")
def creeping():
    return simulate(NOMINAL.replace(effects=[("creep", CREEP)]), RUNS, seed=0)


def test_the_marginal_likelihood_is_that_of_the_normal_distribution():
    rng = np.random.default_rng(0)
    B, z = rng.standard_normal((40, 2)), rng.standard_normal(40)
    left, cost = without_beginnings(z, [B[:, 0], B[:, 1]], np.zeros(40, dtype=int))
    C = np.eye(40) + B @ B.T
    assert z @ left == pytest.approx(z @ np.linalg.solve(C, z))
    assert cost == pytest.approx(0.5 * np.linalg.slogdet(C)[1])


def test_each_run_and_muscle_has_its_own_amount():
    rng = np.random.default_rng(1)
    block = rng.integers(0, 5, 400)
    column = 30.0 * rng.random(400)
    amounts = rng.standard_normal(5)
    left, _ = without_beginnings(amounts[block] * column, [column], block)
    assert np.max(np.abs(left)) < 0.05


def test_creep_is_named_on_runs_that_begin_in_the_middle_of_a_motion(creeping):
    found = diagnose(creeping, NOMINAL)
    assert found.verdict == "cause"
    assert found.causes[0].effects == ("creep",)
    assert found.causes[0].parameters["unknown"].value > 0.0
    assert found.closure[0].closed_share > 0.99
    assert any("at the beginning of a run" in note for note in found.notes)


def test_runs_that_begin_settled_pay_for_no_freedom(creeping):
    evidence = Evidence(creeping, NOMINAL)
    spec = {"creep": {**CREEP, "settled": 1.0, "unknown": 0.0}}
    free = {"creep": {**spec["creep"], "unknown": 0.5}}
    assert evidence.freedom(spec) == evidence.freedom({}) == 0.0
    assert evidence.freedom(free) > 10.0
    x = np.zeros(len(evidence.free))
    error = [float(np.mean(np.square(evidence.tangent(s, x)[evidence.parts[0]]))) for s in (spec, free)]
    assert error[1] < 0.01 * error[0]
