"""The monitor of changes: it keeps its rate of false alarms whatever the model lacks, and tells another muscle."""

import numpy as np
import pandas as pd
import pytest

from pamid.errors import ParameterError, StreamChangeWarning
from pamid.online import ChangeMonitor
from pamid.online.change import autocorrelation_time, evidence, limit, rank_autocorrelation

EVERY = 0.02  # s
pytestmark = pytest.mark.filterwarnings("ignore::pamid.errors.StreamChangeWarning")


class Line:
    """A model that knows the pressure's share alone."""

    def predict(self, X: pd.DataFrame) -> np.ndarray:
        return 5e-4 * X["P"].to_numpy()


def stream(seed: int, seconds: float = 500.0, play: float = 0.0) -> tuple[pd.DataFrame, np.ndarray]:
    """A muscle of which the model lacks a share in the contraction and, with play, bristles that slip."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, seconds, EVERY)
    a, b, c, d = rng.uniform(0.0, 2.0 * np.pi, 4)
    eps = 0.1 + 0.05 * np.sin(1.3 * t + a) + 0.03 * np.sin(3.7 * t + b)
    P = 3.5e5 + 1e5 * np.sin(0.9 * t + c) + 5e4 * np.sin(2.9 * t + d)
    F, z = 5e-4 * P - 20.0 * eps + rng.normal(0.0, 0.5, len(t)), 0.0
    for k in range(1, len(t) if play else 0):
        z = min(max(z + (eps[k] - eps[k - 1]) / play, -1.0), 1.0)
        F[k] += 5.0 * z
    return pd.DataFrame({"time": t, "eps": eps, "deps": np.gradient(eps, t), "P": P}), F


def watched(table: pd.DataFrame, F: np.ndarray, healthy: int = 10_000) -> ChangeMonitor:
    """A monitor that has learnt 200 s and then seen the rest."""
    monitor = ChangeMonitor(Line(), sampling_interval=EVERY).calibrate(table[:healthy], F[:healthy])
    for start in range(healthy, len(F), 333):
        monitor.update(table[start : start + 333], F[start : start + 333])
    return monitor


@pytest.mark.parametrize("play", [0.0, 0.002, 0.03], ids=["nothing", "friction", "hysteresis"])
def test_what_the_model_lacks_is_no_change(play):
    for seed in range(2):
        assert watched(*stream(seed, play=play)).changed_at is None


@pytest.mark.parametrize("play", [0.0, 0.03], ids=["nothing", "hysteresis"])
@pytest.mark.parametrize("factor", [0.9, 1.1])
def test_another_muscle_is_told(play, factor):
    table, F = stream(0, play=play)
    F[15_000:] *= factor  # 100 s into what is watched
    with pytest.warns(StreamChangeWarning, match="has changed at about"):
        monitor = watched(table, F)
    assert monitor.changed_at == pytest.approx(100.0, abs=5.0)
    assert monitor.update(table[-10:], F[-10:]), "an alarm stands until the monitor is restarted"
    assert monitor.restart().changed_at is None


def test_the_share_of_false_alarms_is_what_was_asked_for():
    """Blocks of any distribution, 200 streams: the share allowed, not more than chance has of it."""
    n, blocks, share = 60, 300, 0.05
    threshold, alarms = limit(n, blocks, 0.0, share, seed=0), 0
    for seed in range(200):
        x = np.random.default_rng([1, seed]).standard_cauchy(n + blocks)
        healthy, level = np.sort(x[:n]), 0.0
        for value in x[n:]:
            level = max(0.0, level + evidence((1.0 + n - np.searchsorted(healthy, value)) / (n + 1.0)))
            if level > threshold:
                alarms += 1
                break
    assert 2 <= alarms <= 19  # 10 expected; each side beyond by chance in less than 1 of 200


def test_evidence_is_fair():
    """Its exponential is 1 in the mean over ranks as they come without a change, at most."""
    for n in (40, 400):
        assert 0.5 < np.exp(evidence(np.arange(1, n + 2) / (n + 1.0))).mean() <= 1.0


def test_signals_never_seen_are_no_evidence():
    """Where the muscle moves as it did not on the healthy stretch, the monitor does not judge."""
    table, F = stream(0)
    table.loc[15_000:, "P"] += 4e5
    monitor = watched(table, F + 100.0 * (table["P"].to_numpy() > 6e5))
    assert monitor.changed_at is None
    assert monitor.n_left_out > 0.3 * len(F[10_000:]) / monitor.block


def test_what_is_missing_is_left_out():
    table, F = stream(0)
    F[12_000:13_000] = np.nan
    table.loc[14_000:14_500, "eps"] = np.nan
    monitor = watched(table.assign(P=table["P"]), F)
    assert monitor.changed_at is None
    assert monitor.n_left_out > 0


def test_autocorrelation():
    rng, x = np.random.default_rng(0), np.zeros(100_000)
    for k in range(1, len(x)):
        x[k] = 0.9 * x[k - 1] + rng.standard_normal()
    assert autocorrelation_time(x) == pytest.approx(1.9 / 0.1, rel=0.15)
    assert autocorrelation_time(np.ones(50)) == 1.0
    assert rank_autocorrelation(x) == pytest.approx(0.89, abs=0.03)
    assert limit(60, 300, 0.4, 0.01, 0) > 1.3 * limit(60, 300, 0.0, 0.01, 0), "neighbours that agree count for less"


def test_a_monitor_of_changes_says_what_it_needs():
    table, F = stream(0, 20.0)
    with pytest.raises(ParameterError, match="not calibrated"):
        ChangeMonitor(Line()).update(table, F)
    with pytest.raises(ParameterError, match="false_alarms=2"):
        ChangeMonitor(Line(), false_alarms=2)
    with pytest.raises(ParameterError, match="20 s long, and the model's errors are correlated over"):
        ChangeMonitor(Line(), sampling_interval=EVERY).calibrate(table, np.sign(table["eps"] - 0.1))
    with pytest.raises(ParameterError, match="at least 120"):
        ChangeMonitor(Line(), sampling_interval=EVERY).calibrate(table[:50], F[:50])
