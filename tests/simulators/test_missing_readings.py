"""Readings that are missing here and there: straight lines stand for short gaps, and what they may miss is noise."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from pamid.errors import ShortTrajectoryError
from pamid.gap.simulated import evidence_of
from pamid.simulators import EquationSimulator, Port
from pamid.simulators.port_log import port_log
from pamid.systems.joint import Joint

MASS, FRICTION = 95.0, 0.58  # kg, V

AXIS = EquationSimulator(
    {"dq/dt": "v", "dv/dt": "35.0*u/M"},
    [Port("q", "state", "m"), Port("v", "state", "m/s"), Port("u", "input", "V")],
    {"M": (MASS, 0.0, "kg")},
)


def axis(lost: float = 0.0, rows: bool = False) -> pd.DataFrame:
    """A linear axis at 1 kHz that moves to and fro against Coulomb friction, some cells or rows missing."""
    rng, t, runs = np.random.default_rng(3), np.arange(0, 6, 1e-3), []
    for k, w in enumerate((2.0, 2.6)):
        q, v, a = 0.1 * np.sin(w * t), 0.1 * w * np.cos(w * t), -0.1 * w * w * np.sin(w * t)
        u = (MASS * a) / 35.0 + FRICTION * np.sign(v)
        q = 1e-6 * np.rint((q + 1e-6 * rng.standard_normal(len(t))) / 1e-6)
        run = pd.DataFrame({"trajectory": f"run {k}", "time": t, "q": q, "u": u})
        for name in ("q", "u"):
            run.loc[rng.random(len(t)) < lost, name] = np.nan
        runs.append(run.dropna() if rows else run)
    return pd.concat(runs, ignore_index=True)


@pytest.mark.parametrize("rows", [False, True], ids=["cells", "rows"])
def test_a_fifth_of_the_readings_missing_leaves_the_windows_and_what_they_say(rows):
    whole, part = evidence_of(axis(), AXIS), evidence_of(axis(0.2, rows), AXIS)
    assert len(part.value) > 0.9 * len(whole.value)
    assert np.std(part.value) == pytest.approx(np.std(whole.value), rel=0.03)
    # What lines between readings may miss is noise, not a gap.
    assert np.median(whole.noise) < np.median(part.noise) < 30.0 * np.median(whole.noise)


def test_what_lines_may_miss_is_told_by_what_was_read():
    log = port_log(axis(0.2), AXIS)
    away = log.missed("u")
    assert not np.any(away[~log.gaps["u"]])
    truth = np.concatenate([run["u"].to_numpy() for _, run in axis().groupby("trajectory")])
    errors = (log.channels["u"] - truth)[log.gaps["u"]]
    assert np.max(away) == pytest.approx(np.sqrt(np.mean(np.square(errors))), rel=0.5)


def test_a_long_gap_is_left_out_however_it_is_written():
    log = axis()
    hole = (log["time"] > 2.0) & (log["time"] < 2.5)
    cells = log.assign(q=log["q"].mask(hole))
    for damaged in (cells, log[~hole]):
        found = evidence_of(damaged, AXIS)
        assert not np.any((found.time > 2.03) & (found.time < 2.47))
        assert np.any(found.time > 2.6) and np.any(found.time < 1.9)


def test_a_log_with_too_many_gaps_is_refused_for_them():
    log = axis()
    some = np.arange(len(log)) % 100 < 60
    with pytest.raises(ShortTrajectoryError, match=r"Readings are missing in 60\.0 % of the rows.*Fill in"):
        evidence_of(log.assign(q=log["q"].mask(some)), AXIS)


def test_rates_of_a_joint_take_the_times_as_they_are():
    joint, whole, part = Joint(), axis(), axis(0.2, rows=True)
    whole = whole.set_index(["trajectory", "time"])
    kept = pd.MultiIndex.from_frame(part[["trajectory", "time"]])
    for order in (1, 2):
        expected = pd.Series(joint._rate(whole.reset_index(), order, 1.5), whole.index).loc[kept].to_numpy()
        assert np.std(joint._rate(part, order, 1.5) - expected) < 0.02 * np.std(expected)
