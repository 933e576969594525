"""What noise alone does: its best effect is as likely as said, however often it is read and however many were tried."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from pamid.gap.inference.sensitivity import Template
from pamid.gap.inference.significance import best_of, library_test

N, LOGS = 240, 24


def p_values(noise: np.ndarray, directions: np.ndarray, kept: int) -> list[float]:
    """Return the probability of each log's noise, of the best templates kept of many directions."""
    n, parts = noise.shape[1], [slice(0, N), slice(N, noise.shape[1])]
    evidence = SimpleNamespace(
        parts=parts, z0=noise[0], J=np.zeros((n, 0)), run=np.zeros(n, int), side=np.zeros(n, int), stretch=1.0,
        time=0.5 * (np.arange(n) % N),
    )  # fmt: skip
    evidence.side[parts[1]] = 1
    found, of = [], len(directions) / kept
    for seed, z in enumerate(noise):
        fit = SimpleNamespace(z=z, scales=np.ones(2), inside=np.zeros(0, bool))
        best = directions[np.argsort(-np.abs(directions @ z))[:kept]]
        ends = np.array([-np.inf]), np.array([np.inf])
        library = [Template(f"{k}", {}, ("a",), d[:, None], *ends, of=of) for k, d in enumerate(best)]
        found.append(library_test(evidence, fit, library, np.random.RandomState(seed)).p_value)
    return found


def test_noise_that_two_equations_share_is_no_evidence_twice() -> None:
    rng = np.random.default_rng(0)
    shared = rng.standard_normal((LOGS, N))
    directions = np.tile(rng.standard_normal((1, N)), 2)
    found = p_values(np.hstack([shared, shared]), directions, 1)
    assert 0.25 < np.mean(found) < 0.75 and np.mean(np.array(found) < 0.1) < 0.25


def test_the_best_of_many_points_of_a_fine_grid_is_no_evidence() -> None:
    rng = np.random.default_rng(1)
    directions = rng.standard_normal((100, 2 * N))
    found = p_values(rng.standard_normal((LOGS, 2 * N)), directions, 4)
    assert 0.25 < np.mean(found) < 0.9 and np.mean(np.array(found) < 0.1) < 0.25


def test_draws_of_one_are_draws_of_the_best_of_many() -> None:
    one = 0.5 * np.random.default_rng(2).chisquare(2, (20_000, 19))
    points = [0.05, 0.5, 0.95, 0.99]
    best = np.quantile(best_of(19.0, one[:, 0], 2), points)
    np.testing.assert_allclose(best, np.quantile(one.max(axis=1), points), rtol=0.03)
    assert best_of(19.0, np.array([40.0]), 2)[0] == pytest.approx(40.0 + np.log(19.0), rel=1e-6)
