"""The memory of a stream beyond its bound: each part of the stream keeps its share, however many batches follow."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from pamid.estimators import NonlinearElastic

from pamid.fitting.stream_memory import Rows, bounded, merged
from pamid.volume.braided import chou_hannaford


def remembered(batch: int, run: int | None = None, number: int = 20_000, most: int = 1_000) -> Rows:
    """What is left of a stream, whose rows are numbered, after batches of so many rows: single ones or whole runs."""
    held = None
    for k, start in enumerate(range(0, number, batch)):
        row = np.arange(start, start + batch)
        new = Rows(row[:, None], row[:, None], np.ones(batch), row // run if run else np.full(batch, k))
        rows = merged(new if held is None else held.followed_by(new), whole=run is not None)
        held = bounded(rows, most, whole=run is not None, random=np.random.default_rng(k))
    assert held is not None
    return held


@pytest.mark.parametrize(("batch", "run"), [(100, None), (1_000, None), (100, 5)])
def test_early_rows_keep_their_share(batch, run):
    held = remembered(batch, run)
    assert len(held) == 1_000
    assert held.weight.sum() == pytest.approx(20_000)
    early = held.weight[held.y[:, 0] < 10_000].sum() / 20_000
    assert early == pytest.approx(0.5, abs=0.2 if run else 0.08)  # 200 runs or 1,000 rows: five standard deviations


def test_what_stays_stands_for_what_went():
    """The weight left is that of each row, in the mean over draws; a row that came often stays as it is."""
    weight = np.r_[np.full(50, 3.0), np.full(30, 1.0), 200.0]
    row = np.arange(len(weight))
    rows, sums = Rows(row[:, None], row[:, None], weight, np.zeros(len(row), dtype=int)), np.zeros(len(row))
    for seed in range(1_000):
        left = bounded(rows, 40, whole=False, random=np.random.default_rng(seed))
        assert len(left) == 40 and left.weight.sum() == pytest.approx(weight.sum())
        sums[left.y[:, 0]] += left.weight / 1_000
    assert sums[80] == pytest.approx(200.0)
    assert sums[:50].mean() == pytest.approx(3.0, rel=0.03) and sums[50:80].mean() == pytest.approx(1.0, rel=0.1)


def test_of_a_run_longer_than_the_memory_the_end_stays():
    row, unit = np.arange(900), np.repeat([0, 1, 2], 300)
    rows = Rows(row[:, None], row[:, None], np.ones(900), unit)
    for seed in range(20):
        left = bounded(rows, 100, whole=True, random=np.random.default_rng(seed))
        assert left.y[-1, 0] % 300 == 299 and np.ptp(left.y[:, 0]) == 99
        assert left.weight.sum() == pytest.approx(900.0)


def test_rows_without_weight_keep_none():
    row = np.arange(9)
    left = bounded(Rows(row[:, None], row[:, None], np.zeros(9), row), 4, whole=False, random=np.random.default_rng(0))
    np.testing.assert_array_equal(left.weight, np.zeros(4))


def test_a_long_drift_leaves_the_fit_of_all_rows():
    """Fifteen times the memory in small batches, of a muscle that gains half of its force meanwhile."""
    rng, n = np.random.default_rng(0), 3_000
    X = pd.DataFrame({"eps": rng.uniform(0.0, 0.2, n), "P": rng.uniform(1.5e5, 6e5, n)})
    F = chou_hannaford(X["P"], X["eps"], rest_diameter=0.02, braid_angle=0.45) * np.linspace(1.0, 1.5, n)
    model = NonlinearElastic()
    model._memory_rows = 200
    for start in range(0, n, 100):
        model.partial_fit(X[start : start + 100], F[start : start + 100])
    whole = NonlinearElastic().fit(X, F)
    assert np.mean(model.predict(X) / whole.predict(X)) == pytest.approx(1.0, abs=0.03)
    assert np.std(model.predict(X) - F) <= 1.1 * np.std(whole.predict(X) - F)
