"""A sensor at the end of its range: named where one number says it, left out where it reads farther the other way."""

import numpy as np
import pandas as pd
import pytest

from pamid.gap import diagnose_simulator
from pamid.gap.residuals.states import resting_joints
from pamid.gap.simulated import evidence_of
from pamid.signals.ends import end_of
from pamid.simulators import FunctionSimulator, Port
from pamid.simulators.port_log import port_log
from pamid.simulators.structure import JointPort

DT, ROWS = 0.02, 500


def cart() -> FunctionSimulator:
    ports = [Port("force", "input", "N"), Port("x", "state", "m"), Port("v", "state", "m/s")]
    return FunctionSimulator(
        lambda t, x, u, p: [x.v, (u.force - 3.0 * x.v - p.k * x.x) / 2.0], ports, {"k": (15.0, 0.05, "N/m")}
    )


def log_of(rest: float = 0.0) -> pd.DataFrame:
    """Return a log of the cart, pushed to one side more than to the other or on both alike."""
    rng, frames = np.random.default_rng(4), []
    for run in range(2):
        t = np.arange(ROWS) * DT
        w = rng.uniform(0.8, 6.0, 5)
        force = 8.0 * np.sin(w * t[:, None] + rng.uniform(0.0, 6.0, 5)).mean(axis=1) + rest
        x = np.array([rest / 15.0, 0.0])
        rows = []
        for f in force:
            rows.append(x)
            for _ in range(20):
                x = x + DT / 20 * np.array([x[1], (f - 3.0 * x[1] - 15.0 * x[0]) / 2.0])
        x, v = np.array(rows).T
        noisy = {"x": x + 4e-4 * rng.standard_normal(ROWS), "v": v + 3e-3 * rng.standard_normal(ROWS)}
        frames.append(pd.DataFrame({"trajectory": str(run), "time": t, "force": force, **noisy}))
    return pd.concat(frames, ignore_index=True)


def cut(log: pd.DataFrame, way: int = 1) -> pd.DataFrame:
    end = (way * log["x"]).quantile(0.9)
    return log.assign(x=way * np.minimum(way * log["x"], end))


def spans(log: pd.DataFrame) -> list[tuple[int, int]]:
    return [(k, k + ROWS) for k in range(0, len(log), ROWS)]


@pytest.mark.parametrize("way", [1, -1])
def test_readings_at_one_end_of_a_range_are_left_out_where_runs_take_too_long(way: int) -> None:
    log = log_of()
    log["x"] *= np.where(way * log["x"] < 0, 1.2, 1.0)
    log = cut(log, way)
    end = end_of(log["x"].to_numpy(), spans(log))
    assert end is not None and end.side == way and 0.05 < end.rows.mean() <= 0.11
    slow = cart()
    slow.one_by_one = True
    evidence = evidence_of(log, slow)
    gap = evidence.log.gaps["x"]
    assert np.array_equal(gap, log["x"] == way * (way * log["x"]).max())
    assert "x stays at" in evidence.notes[0] and "These readings are left out" in evidence.notes[0]


@pytest.mark.parametrize("way", [1, -1])
def test_an_end_on_one_side_is_named(way: int) -> None:
    log = cut(log_of(), way)
    found = diagnose_simulator(log, cart(), ["coulomb_friction", "sensor_gain", "sensor_saturation"], seed=0)
    [cause] = found.causes
    assert cause.effects == ("sensor_saturation",) and cause.where == ("x",)
    [(name, end)] = cause.parameters.items()
    assert name == ("upper" if way > 0 else "depth")
    assert end.value == pytest.approx((way * log["x"]).max(), rel=2e-3)


def test_the_end_of_a_range_is_named_where_all_states_are_logged() -> None:
    log = cut(log_of(rest=20.0))
    found = diagnose_simulator(log, cart(), ["coulomb_friction", "sensor_gain", "sensor_saturation"], seed=0)
    [cause] = found.causes
    assert cause.effects == ("sensor_saturation",)
    assert cause.parameters["limit"].value == pytest.approx(log["x"].max(), rel=2e-3)


def test_a_model_that_takes_too_long_to_be_run_says_that_a_reading_ends() -> None:
    slow = cart()
    slow.one_by_one = True
    notes = evidence_of(cut(log_of(rest=20.0)), slow).notes
    assert any("stands at the end of its sensor's range" in note for note in notes)
    assert not any("stands at the end" in note for note in evidence_of(log_of(rest=20.0), slow).notes)


def test_what_is_left_out_is_bridged_within_its_run() -> None:
    log = cut(log_of())
    log.loc[log["trajectory"] == "1", "x"] = log["x"].max()  # one run stands there all along, the other one begins
    log.loc[:5, "x"] = log["x"].max()
    slow = cart()
    slow.one_by_one = True
    x = evidence_of(log, slow).log.channels["x"]
    assert np.all(x[:6] == log["x"][6]) and np.all(x[ROWS:] == log["x"].max())


def test_a_run_that_begins_or_ends_at_rest_reaches_no_end() -> None:
    t = np.arange(200) * DT
    x = np.minimum(np.exp(-0.3 * t) * np.cos(3.0 * t), np.cos(0.4))
    for rows in (x, x[::-1]):
        assert end_of(rows, [(0, 200)]) is None
    x = np.sin(3.0 * t) + 0.3
    assert end_of(np.minimum(x, 1.2), [(0, 200)]) is not None


def test_a_reading_with_coarse_steps_is_not_at_its_end_where_it_turns() -> None:
    t = np.arange(4000) * 1e-3
    x = np.round((1.0 + 0.1 * t) * np.sin(40.0 * t) / 5e-3) * 5e-3  # each turn lasts for several rows
    largest = np.flatnonzero(np.abs(x) == np.max(np.abs(x)))
    assert len(largest) >= 4
    assert end_of(x, [(0, 4000)]) is None
    assert end_of(np.clip(x, -1.2, 1.2), [(0, 4000)]) is not None


def test_readings_that_repeat_now_and_then_show_their_end_by_standing_there_longer_than_anywhere_else() -> None:
    t, rng = np.arange(2000) * 5e-3, np.random.default_rng(0)
    x = np.round((np.sin(9.0 * t) - 0.5 + 0.012 * rng.standard_normal(2000)) / 8e-3) * 8e-3
    alike = np.mean(np.diff(x) == 0.0)
    assert 0.05 < alike < 0.2
    assert end_of(x, [(0, 2000)]) is None
    end = end_of(np.minimum(x, 0.32), [(0, 2000)])
    assert end is not None and end.limit == 0.32 and end.side == 1
    rests = np.repeat(np.round(rng.standard_normal(200), 3), rng.integers(1, 3, 200))  # a motion that often waits
    rests = np.insert(rests, [50, 120, 200], rests[[50, 120, 200]])
    assert end_of(np.append(rests, rests[:-1]), [(0, 2 * len(rests) - 1)]) is None


def test_a_sensor_at_its_end_is_no_joint_at_rest() -> None:
    """Rows at rest are left out: with them the only ones that show the end would be, and there would be no gap."""
    log = log_of()
    end = float(log["x"].quantile(0.97))
    clipped = log.assign(x=np.where(log["trajectory"] == "1", np.minimum(log["x"], end), log["x"])).drop(columns="v")
    at_end = (clipped["x"] == end).to_numpy()
    assert at_end.sum() > 10
    joint = JointPort("x", "x", "v", "", "m/s2")
    told = port_log(clipped, cart())
    resting = resting_joints(told, [joint], {"x"}, 1)
    assert not any(rows[at_end].any() for rows in resting.values())
    held = clipped.assign(x=clipped["x"] + np.where(at_end, 1e-6 * np.random.default_rng(0).normal(size=len(log)), 0.0))
    assert resting_joints(port_log(held, cart()), [joint], {"x"}, 1)["x"][at_end].any()
