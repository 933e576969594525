"""Splits by trajectory, kind and muscle; resampling, thinning and windows of tidy frames."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
import sklearn
from hypothesis import given, settings
from hypothesis import strategies as st
from sklearn.base import clone
from sklearn.linear_model import Ridge
from sklearn.model_selection import GridSearchCV, cross_validate

from pamid import errors
from pamid.signals import (
    LeaveOneKindOut,
    LeaveOneMuscleOut,
    TrajectoryKFold,
    merge_rates,
    resample,
    split_trajectories,
    thin,
    thinned_rows,
    windows,
)

NAMES = ["sine-1", "sine-2", "triangle-1", "step-1", "step-2"]
GROUPS = np.repeat(NAMES, [40, 10, 30, 25, 15])
X = np.random.default_rng(0).standard_normal((120, 2))


def signals(t: np.ndarray, name: str = "a", **columns: np.ndarray) -> pd.DataFrame:
    return pd.DataFrame({"trajectory": name, "time": t, **columns})


# --- splits ---------------------------------------------------------------------------------------------------
@given(
    sizes=st.lists(st.integers(1, 60), min_size=2, max_size=25),
    n_splits=st.integers(2, 6),
    shuffle=st.booleans(),
    seed=st.integers(0, 99),
)
@settings(deadline=None)
def test_folds_hold_whole_trajectories(sizes, n_splits, shuffle, seed):
    """Each row is tested once, no trajectory is torn, and no fold is longer than it has to be."""
    groups = np.repeat(np.arange(len(sizes)), sizes)
    splitter = TrajectoryKFold(n_splits, shuffle=shuffle, random_state=seed)
    if len(sizes) < n_splits:
        with pytest.raises(errors.TooFewTrajectoriesError):
            list(splitter.split(groups, groups=groups))
        return
    folds = list(splitter.split(groups, groups=groups))
    assert len(folds) == splitter.get_n_splits() == n_splits
    np.testing.assert_array_equal(np.sort(np.concatenate([test for _, test in folds])), np.arange(len(groups)))
    for train, test in folds:
        assert not set(groups[train]) & set(groups[test])
        assert len(train) + len(test) == len(groups)
    lengths = [len(test) for _, test in folds]
    assert min(lengths) > 0
    assert max(lengths) - min(lengths) <= max(sizes)
    again = [test.tolist() for _, test in splitter.split(groups, groups=groups)]
    assert again == [test.tolist() for _, test in folds]


def test_shuffle_changes_company():
    groups = np.repeat(np.arange(12), 10)
    partners = {
        tuple(tuple(sorted(set(groups[test].tolist()))) for _, test in
              TrajectoryKFold(3, shuffle=True, random_state=seed).split(groups, groups=groups))
        for seed in range(5)
    }  # fmt: skip
    assert len(partners) == 5


def test_leave_one_kind_out():
    folds = [sorted(set(GROUPS[test])) for _, test in LeaveOneKindOut().split(X, groups=GROUPS)]
    assert folds == [["sine-1", "sine-2"], ["triangle-1"], ["step-1", "step-2"]]
    assert LeaveOneKindOut(kind=lambda n: n[-1]).get_n_splits(X, groups=GROUPS) == 2
    named = np.array([f"{g}@practice/data" for g in GROUPS])
    assert LeaveOneKindOut().get_n_splits(X, groups=named) == 3


def test_leave_one_muscle_out():
    by_mapping = LeaveOneMuscleOut(muscle={n: "A" if n.endswith("1") else "B" for n in NAMES})
    assert [len(test) for _, test in by_mapping.split(X, groups=GROUPS)] == [95, 25]
    frame = pd.DataFrame(X, columns=["a", "b"]).assign(trajectory=GROUPS, muscle=np.where(GROUPS == "sine-1", "A", "B"))
    assert [len(test) for _, test in LeaveOneMuscleOut().split(frame)] == [40, 80]
    assert LeaveOneMuscleOut().get_n_splits(frame) == 2


@pytest.mark.parametrize("routing", [False, True])
@pytest.mark.parametrize(
    "splitter",
    [TrajectoryKFold(3), LeaveOneKindOut(), LeaveOneMuscleOut(muscle=lambda n: n[-1])],
    ids=lambda s: type(s).__name__,
)
def test_in_searches(splitter, routing):
    """Splitters work in scikit-learn's searches with routing on and off, and can be cloned."""
    y = X[:, 0]
    with sklearn.config_context(enable_metadata_routing=routing):
        told = {"params": {"groups": GROUPS}} if routing else {"groups": GROUPS}
        scores = cross_validate(Ridge(), X, y, cv=splitter, error_score="raise", **told)
        assert len(scores["test_score"]) == splitter.get_n_splits(X, y, GROUPS)
        search = GridSearchCV(Ridge(), {"alpha": [0.1, 1.0]}, cv=splitter).fit(X, y, groups=GROUPS)
        assert search.n_splits_ == len(scores["test_score"])
    assert repr(clone(splitter, safe=False)) == repr(splitter)


def test_the_column_serves_where_groups_do_not():
    frame = pd.DataFrame(X, columns=["a", "b"]).assign(trajectory=GROUPS)
    by_column = [test.tolist() for _, test in TrajectoryKFold(3).split(frame)]
    assert by_column == [test.tolist() for _, test in TrajectoryKFold(3).split(X, groups=GROUPS)]


@given(seed=st.integers(0, 99), share=st.floats(0.05, 0.95))
def test_training_and_test_trajectories(seed, share):
    train, test = split_trajectories(X, GROUPS, test_size=share, random_state=seed)
    assert not set(GROUPS[train]) & set(GROUPS[test])
    assert len(train) > 0
    assert len(test) > 0
    assert len(train) + len(test) == len(X)
    assert abs(len(test) - share * len(X)) <= 40


@pytest.mark.parametrize(
    ("splitter", "groups", "expected", "words"),
    [
        (TrajectoryKFold(3), None, errors.MissingTrajectoryError, "TrajectoryKFold needs"),
        (TrajectoryKFold(1), GROUPS, errors.ParameterError, "n_splits is 1"),
        (TrajectoryKFold(6), GROUPS, errors.TooFewTrajectoriesError, "5 runs for 6 folds"),
        (TrajectoryKFold(2), GROUPS[:7], errors.ShapeError, "7 entries for 120 rows"),
        (LeaveOneKindOut(), np.arange(120), errors.TrajectoryError, "gives no kind"),
        (LeaveOneKindOut(), np.repeat(["sine-1", "sine-2"], 60), errors.TooFewTrajectoriesError, r"one kind \(sine\)"),
        (LeaveOneMuscleOut(), GROUPS, errors.TrajectoryError, "which muscle"),
        (LeaveOneMuscleOut(muscle={"sine-1": "A"}), GROUPS, errors.TrajectoryError, "sine-2"),
    ],
)
def test_bad_splits(splitter, groups, expected, words):
    with pytest.raises(expected, match=words):
        list(splitter.split(X, groups=groups))


# --- resampling -----------------------------------------------------------------------------------------------
def test_resampling_keeps_what_fits_and_removes_what_would_alias():
    """A slow sine passes, one above the new Nyquist frequency does not fold into the band."""
    t = np.arange(0, 4, 1e-3)
    log = signals(t, slow=3 + np.sin(2 * np.pi * 2 * t), fast=np.sin(2 * np.pi * 47 * t))
    new = resample(log, 0.02)
    assert new["time"].diff().dropna().to_numpy() == pytest.approx(0.02)
    np.testing.assert_allclose(new["slow"], 3 + np.sin(2 * np.pi * 2 * new["time"]), atol=3e-3)
    assert new["fast"][10:-10].abs().max() < 5e-3


def test_resampling_evens_out_unequal_steps_and_refines():
    rng = np.random.default_rng(0)
    t = np.cumsum(rng.uniform(0.5e-3, 1.5e-3, 3000))
    log = signals(t, q=np.sin(5 * t), branch=(t > 1).astype(int))
    for period in (1e-3, 2.5e-4, 1e-2):
        new = resample(log, period, hold=["branch"])
        np.testing.assert_allclose(new["q"], np.sin(5 * new["time"]), atol=2e-3)
        assert set(new["branch"]) == {0, 1}
        assert new["time"].iloc[-1] <= t[-1]
        np.testing.assert_array_equal(new["branch"], (new["time"] > t[t > 1][0] - 1e-9).astype(int))


@given(value=st.floats(-1e6, 1e6), n=st.integers(3, 300), factor=st.floats(0.2, 20))
@settings(deadline=None, max_examples=40)
def test_resampling_keeps_constants(value, n, factor):
    log = signals(np.arange(n) * 1e-3, y=np.full(n, value))
    if factor >= n - 1:
        return
    assert resample(log, 1e-3 * factor)["y"].to_numpy() == pytest.approx(value, rel=1e-9, abs=1e-9)


def test_resampling_stays_within_trajectories():
    t = np.arange(0, 1, 1e-3)
    log = pd.concat([signals(t, "a", y=0 * t), signals(t, "b", y=0 * t + 1)], ignore_index=True)
    new = resample(log, 0.01)
    assert new.groupby("trajectory")["y"].agg(["min", "max"]).to_numpy() == pytest.approx(
        np.array([[0, 0], [1, 1]]), abs=1e-12
    )


def test_merging_rates():
    fast, slow = np.arange(0, 2, 1e-3), np.arange(0.05, 1.9, 1e-2)
    both = merge_rates([signals(fast, P=2e5 + 1e4 * np.sin(4 * fast)), signals(slow, q=np.cos(4 * slow))])
    assert list(both.columns) == ["trajectory", "time", "P", "q"]
    np.testing.assert_allclose(both["P"], 2e5 + 1e4 * np.sin(4 * both["time"]), atol=20)
    np.testing.assert_allclose(both["q"], np.cos(4 * both["time"]), atol=1e-3)
    fine = merge_rates([signals(fast, P=fast), signals(slow, q=slow)], period=1e-3)
    np.testing.assert_allclose(fine["q"], fine["time"])


T = np.arange(10) * 0.1


@pytest.mark.parametrize(
    ("call", "expected", "words"),
    [
        (lambda: resample(signals(T), -1.0), errors.ParameterError, "period is -1"),
        (lambda: resample(signals(T), 5.0), errors.ShortTrajectoryError, "lasts 0.9 s"),
        (lambda: resample(signals(T).drop(columns="time"), 0.1), errors.MissingColumnError, "no column time"),
        (lambda: resample(signals(T, s=T.astype(str)), 0.1), errors.ColumnTypeError, "holds text"),
        (lambda: resample(signals(T[::-1]), 0.1), errors.TimeOrderError, "does not increase"),
        (lambda: merge_rates([]), errors.ParameterError, "No log"),
        (lambda: merge_rates([signals(T, q=T), signals(T, q=T)]), errors.DuplicateColumnError, "hold q"),
        (lambda: merge_rates([signals(T, q=T), signals(T, "b", P=T)]), errors.TrajectoryError, "not in all logs"),
        (lambda: merge_rates([signals(T, q=T), signals(T + 5, P=T)]), errors.TimeError, "share 0 s"),
        (lambda: thin(signals(T)), errors.ParameterError, "exactly one"),
        (lambda: thin(signals(T), 0), errors.ParameterError, "every is 0"),
        (lambda: thinned_rows(["a", "b"], n_rows=1), errors.ParameterError, "2 runs"),
        (lambda: windows(signals(T), 0.0), errors.ParameterError, "length is 0"),
        (lambda: windows(signals(T), 5.0), errors.ShortTrajectoryError, "lasts 0.9 s"),
    ],
)
def test_bad_tables(call, expected, words):
    with pytest.raises(expected, match=words):
        call()


# --- thinning and windows -------------------------------------------------------------------------------------
@given(sizes=st.lists(st.integers(1, 50), min_size=1, max_size=10), every=st.integers(1, 20), n_rows=st.integers(1, 80))
def test_thinning(sizes, every, n_rows):
    """Every k-th row from the first of each trajectory; never more rows than allowed, and not far fewer."""
    groups = np.repeat(np.arange(len(sizes)), sizes)
    rows = thinned_rows(groups, every)
    starts = np.concatenate([[0], np.cumsum(sizes)[:-1]])
    assert set(starts) <= set(rows)
    assert all((row - starts[groups[row]]) % every == 0 for row in rows)
    across = thinned_rows(groups, n_rows=n_rows, across=True)
    assert min(n_rows, len(groups)) / 2 <= len(across) <= n_rows
    if n_rows >= len(sizes):
        assert len(thinned_rows(groups, n_rows=n_rows)) <= n_rows


def test_every_hundredth_row_as_published():
    """31,464 rows give 315 and 30,952 give 310 when rows are counted through."""
    counts = [len(thinned_rows(np.repeat(range(20), -(-n // 20))[:n], 100, across=True)) for n in (31_464, 30_952)]
    assert counts == [315, 310]


@given(n=st.integers(20, 400), length=st.floats(0.02, 0.3), seed=st.integers(0, 99))
@settings(deadline=None, max_examples=50)
def test_windows_balance(n, length, seed):
    """Mean times duration is the integral; differences and durations add up to the whole."""
    rng = np.random.default_rng(seed)
    t = np.cumsum(rng.uniform(0.5e-2, 1.5e-2, n))
    if t[-1] - t[0] < length:
        return
    y = rng.standard_normal(n)
    w = windows(signals(t, y=y), length)
    end = np.searchsorted(t, t[0] + w["duration"].sum() * (1 - 1e-12))
    assert (w["y"] * w["duration"]).sum() == pytest.approx(np.trapezoid(y[: end + 1], t[: end + 1]), abs=1e-9)
    assert w["delta_y"].sum() == pytest.approx(y[end] - y[0])
    assert t[-1] - t[end] <= 0.5 * length + 1.5e-2
