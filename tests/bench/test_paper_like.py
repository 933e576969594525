"""The data sets that are like the authors': their runs, their flow by the map, spread, mean and kurtosis as stated."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from scipy.stats import kurtosis

from pamid.bench import dataset, paper_like, paper_like_bench, simulate, sine
from pamid.bench.paper_like import NOISE, NORMAL_LITRE, RISE, SETTINGS, flow_by_map, sines, steps, triangles
from pamid.errors import UnknownOptionError
from pamid.laws.valve import valve_flow

SECONDS = {"A": 386.9, "B": 393.3, "C": 386.9}
"""How long the runs of each last together."""
LEFT_OUT = 2
"""Periods of each run that are not simulated."""
STATED = {"A": (7.73, None, 0.211), "B": (16.23, 27.0, 0.318), "C": (17.72, 20.0, None)}
"""Spread and mean of the authors' flow (NL/min) and its kurtosis, where their files give them."""


@pytest.fixture(scope="module")
def short():
    """A second of a run on the bench of B, with the flow that its map gives."""
    bench = paper_like_bench("B")
    log = simulate(bench, [sine(10, 25, 1000)], seed=3, controller=SETTINGS["B"].controller)
    metered = log["mdot1"].to_numpy(float)
    flow_by_map(log, bench, 3)
    return bench, log, metered


@pytest.fixture(scope="module", params="ABC")
def sized(request):
    """The data set with the last two periods of each run left out: they are like the second one."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(paper_like, "PERIODS", paper_like.PERIODS - LEFT_OUT)
        return request.param, dataset("paper_like", seed=5, muscle=request.param)


def counted(log: pd.DataFrame) -> np.ndarray:
    """How many rows of the whole data set each row stands for: later periods for those that are left out, too."""
    found = []
    for name, run in log.groupby("trajectory", sort=False):
        period = 2e3 * np.pi / float(str(name).split("-")[1])
        later = round(len(run) / period) - 1
        found.append(np.where(np.arange(len(run)) < period, 1.0, (later + LEFT_OUT) / later))
    return np.concatenate(found)


def test_the_runs_last_as_long_as_theirs_and_are_as_heavy_tailed():
    seconds = {m: sum(run.n_samples for run in sines(m)) / 1e3 for m in "ABC"}
    assert seconds == {m: pytest.approx(s, abs=0.2) for m, s in SECONDS.items()}
    assert all(len(sines(m)) == 20 and len({run.name for run in sines(m)}) == 20 for m in "ABC")
    speed = np.concatenate([np.diff(run.q_ref[run.lead :]) for run in sines("C")])
    assert kurtosis(speed, fisher=False) == pytest.approx(27.2, abs=0.5)
    assert len(triangles("B")) == 25 and len(steps("B")) == 10


def test_steps_take_their_time_to_both_sides():
    for run in steps("B"):
        moving = np.flatnonzero(np.diff(run.q_ref))
        assert len(moving) == pytest.approx(1e3 * RISE, abs=1) and moving[0] == pytest.approx(run.lead + 1000, abs=1)
    ends = sorted(round(np.degrees(run.q_ref[-1])) for run in steps("B"))
    assert ends == [*range(-25, 0, 5), *range(5, 30, 5)]


def test_runs_start_from_rest():
    for run in (*sines("B"), *triangles("B"), *steps("B")):
        assert not run.q_ref[: run.lead + 1].any()


def test_the_flow_is_that_of_the_nominal_map(short):
    bench, log, metered = short
    wanted = valve_flow(
        log["u1"].to_numpy(float),
        log["P1"].to_numpy(float),
        bench.gas.supply_pressure,
        sonic_conductance=bench.valve.sonic_conductance,
        critical_pressure_ratio=bench.valve.critical_pressure_ratio,
    )
    error = (log["mdot1"] - wanted) / NORMAL_LITRE
    assert np.std(error) == pytest.approx(NOISE, rel=0.1)
    assert np.mean(error) == pytest.approx(SETTINGS["B"].offset, abs=0.1)
    # Twice 3 ms of the spool: the map leads the gas by more than the noise hides.
    assert np.std(wanted - metered) / NORMAL_LITRE > 3 * NOISE


def test_a_seed_gives_one_flow_and_another_seed_another(short):
    bench, log, _ = short
    again, other = log.copy(), log.copy()
    flow_by_map(again, bench, 3)
    flow_by_map(other, bench, 4)
    pd.testing.assert_frame_equal(log, again)
    assert not np.array_equal(log["mdot1"], other["mdot1"])
    assert not np.array_equal(log["mdot1"], log["mdot2"])


def test_an_unknown_muscle_is_named():
    with pytest.raises(UnknownOptionError, match="no muscle 'D'"):
        paper_like_bench("D")


def test_spread_mean_and_kurtosis_are_the_authors(sized):
    muscle, log = sized
    spread, tails, mean = STATED[muscle]
    flow, rows = log["mdot1"].to_numpy(float) / NORMAL_LITRE, counted(log)
    assert rows.sum() == pytest.approx(1e3 * SECONDS[muscle], rel=1e-3)
    middle = np.average(flow, weights=rows)
    second, fourth = (np.average((flow - middle) ** k, weights=rows) for k in (2, 4))
    assert np.sqrt(second) == pytest.approx(spread, rel=0.02)
    assert tails is None or fourth / second**2 == pytest.approx(tails, rel=0.12)
    assert mean is None or middle == pytest.approx(mean, abs=0.02)


def test_valve_and_pressures_stay_physical(sized):
    _, log = sized
    signals = [f"{name}{m}" for m in "12" for name in ("u", "P", "F", "mdot")]
    assert list(log.columns) == ["trajectory", "time", "q_ref", "q", *signals]
    for m in "12":
        assert log[f"u{m}"].abs().max() < 1 and log[f"P{m}"].between(1.1e5, 7.0e5).all() and log[f"F{m}"].min() > 0
        assert log[f"mdot{m}"].abs().max() / NORMAL_LITRE < 300
