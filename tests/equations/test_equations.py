"""Residuals of the bench's equations: at the noise floor where the simulator is right, far above it where it is not."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pandas as pd
import pytest
from scipy.signal import lfilter
from support.bench_logs import NOMINAL, RUNS

from pamid.bench import hold, simulate, sine, triangle
from pamid.bench.sensors import IDEAL
from pamid.effects import make_effect
from pamid.equations import all_equations, channel_noise, evaluate_log, residuals
from pamid.equations.noise import noise_beside
from pamid.equations.windows import average, kernel, span, starts
from pamid.errors import (
    ColumnTypeError,
    EmptyLogError,
    InterleavedTrajectoryError,
    MissingTrajectoryError,
    NonFiniteError,
    ShortTrajectoryError,
    TimeOrderError,
    UnknownOptionError,
)


@pytest.fixture(scope="module")
def ideal() -> pd.DataFrame:
    return simulate(NOMINAL, RUNS, sensors=IDEAL)


# --- windows ------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("order", [1, 2, 3])
@pytest.mark.parametrize("n", [1, 2, 7, 20])
def test_average_equals_the_kernel(order, n):
    x = np.random.default_rng(0).normal(size=(300, 2)) + 1e6
    weights = kernel(n, order)
    assert weights.sum() == pytest.approx(1.0)
    assert len(weights) == span(n, order)
    first = starts(len(x), n, order)
    expected = [[weights @ x[a : a + len(weights), k] for k in (0, 1)] for a in first]
    np.testing.assert_allclose(average(x, n, order, first), expected, rtol=1e-13)


@pytest.mark.parametrize("order", [1, 2, 3])
def test_windows_share_one_grid(order):
    time = np.arange(300.0)
    first = starts(300, 20, order)
    centres = average(time, 20, order, first)
    assert np.all(np.diff(centres) == pytest.approx(20.0))
    assert abs((centres[0] - 9.5 + 10) % 20 - 10) <= 0.5 + 1e-9


def test_second_difference_is_the_tested_acceleration():
    """The weak form is exact: a second difference under the cubic kernel is that of window means."""
    q = np.cumsum(np.cumsum(np.random.default_rng(0).normal(size=400)))
    n = 20
    first = np.arange(0, 300, 20)
    weak = average(q[2:] - 2 * q[1:-1] + q[:-2], n, 3, first)
    means = np.convolve(q, np.full(n, 1 / n), "valid")
    np.testing.assert_allclose(
        weak, (means[first + 2 * n] - 2 * means[first + n] + means[first]) / n**2, rtol=1e-6, atol=1e-9
    )


# --- noise --------------------------------------------------------------------------------------------------
def test_noise_is_found_under_motion_and_jumps():
    rng = np.random.default_rng(0)
    t = np.arange(4000) * 1e-3
    x = 3e5 + 4e4 * np.sin(10 * t) + 1e4 * (t > 2)
    assert channel_noise(x + rng.normal(scale=60.0, size=4000), 20).white == pytest.approx(60.0, rel=0.06)
    assert channel_noise(x, 20).white < 0.05


def test_noise_of_one_sensor_is_the_deviation_of_window_means():
    rng = np.random.default_rng(1)
    for scale, quantum in ((1.0, 0.0), (1.0, 0.5), (0.05, 1.0), (1.0, 3.0)):
        trials = []
        for level in rng.uniform(0, 1, 400):
            x = level + rng.normal(scale=scale, size=20)
            trials.append(np.mean(np.round(x / quantum) * quantum if quantum else x) - level)
        x = rng.uniform(0, 1) + rng.normal(scale=scale, size=4000)
        noise = channel_noise(np.round(x / quantum) * quantum if quantum else x, 20)
        if noise.resolution or not quantum:  # a rest in the middle of a step shows neither noise nor steps
            predicted = np.sqrt(noise.variance(kernel(20, 1)))
            assert predicted == pytest.approx(np.std(trials), rel=0.5), (scale, quantum)


# --- the equations ------------------------------------------------------------------------------------------
def test_right_simulator_leaves_the_noise(log):
    result = evaluate_log(log, NOMINAL)
    assert list(result) == ["force", "flow", "valve", "joint"]
    assert result.skipped == {}
    for name, e in result.items():
        assert 0.85 < e.rmse / e.noise_floor < 1.15, name
        assert list(e.trajectories) == [run.name for run in RUNS]
        assert sum(t.n_windows for t in e.trajectories.values()) == e.n_windows
        squares = sum(t.n_windows * t.rmse**2 for t in e.trajectories.values())
        assert np.sqrt(squares / e.n_windows) == pytest.approx(e.rmse)
    assert [e.unit for e in result.values()] == ["N", "kg/s", "kg/s", "N m"]


def test_equations_hold_without_noise(ideal):
    for e in evaluate_log(ideal, NOMINAL).values():
        assert e.nrmse < 1e-3


def test_nrmse_is_relative_to_the_measured_side(log):
    result = evaluate_log(log, NOMINAL, ["force"])
    parts = [r for _, name, r in residuals(log, NOMINAL, ["force"])]
    spread = np.std(np.concatenate([r.measured.ravel() for r in parts]))
    assert result["force"].nrmse == pytest.approx(result["force"].rmse / spread, rel=1e-9)


WRONG = {
    "force": {"rest_diameter": 0.0202},
    "valve": {"sonic_conductance": 6.3e-9},
    "joint": {"inertia": 0.021},
}


@pytest.mark.parametrize("equation", WRONG)
def test_wrong_parameter_shows_in_its_equation(log, equation):
    result = evaluate_log(log, NOMINAL.replace(**WRONG[equation]))
    assert result[equation].rmse > 1.5 * result[equation].noise_floor
    others = {"valve": ["force", "flow", "joint"], "joint": ["force", "flow", "valve"], "force": ["valve", "joint"]}
    for name in others[equation]:
        assert result[name].rmse < 1.2 * result[name].noise_floor


EFFECTS = {  # effect: (the equation it enters, how close to the floor its own simulator must come)
    "viscous_friction": ("force", 1.6),
    "thread_extensibility": ("force", 1.2),
    "quadratic_drag": ("force", 1.6),
    "backlash": ("force", 1.5),
    "leakage": ("flow", 1.2),
    "dead_volume": ("flow", 1.3),
    "polytropic_exponent": ("flow", 1.3),
    "gas_temperature": ("flow", 1.2),
    "valve_lag": ("valve", 1.2),
    "transport_delay": ("valve", 1.2),
    "valve_dead_zone": ("valve", 1.2),
    "supply_droop": ("valve", 1.2),
    "gravity": ("joint", 1.2),
    "force_lag": ("force", 1.3),
    "pressure_lag": ("force", 1.3),
    "pressure_bias": ("force", 1.2),
    "angle_delay": ("joint", 1.3),
    "diameter": ("force", 1.2),
}


@pytest.mark.parametrize("effect", EFFECTS)
def test_effect_stands_out_and_its_simulator_closes_the_gap(effect):
    equation, close = EFFECTS[effect]
    actual = NOMINAL.replace(effects=[(effect, dict(make_effect(effect).values))])
    log = simulate(actual, RUNS, seed=5)
    nominal, corrected = evaluate_log(log, NOMINAL), evaluate_log(log, actual)
    ratios = {name: e.rmse / e.noise_floor for name, e in nominal.items()}
    assert ratios[equation] > 3
    assert corrected[equation].rmse < close * corrected[equation].noise_floor
    assert corrected[equation].rmse < nominal[equation].rmse / 2


@pytest.mark.parametrize("effect", ["coulomb_friction", "hysteresis", "heat_transfer"])
def test_memory_is_followed_along_a_log(effect):
    """What friction or warm gas remembers from before a log is unknown: the gap closes by most of it, not by all."""
    actual = NOMINAL.replace(effects=[(effect, dict(make_effect(effect).values))])
    log = simulate(actual, [sine(4, 20, 4000), sine(10, 15, 4000), triangle(4, 15, 4000)], seed=5)
    [equation] = make_effect(effect).equations
    assert evaluate_log(log, actual)[equation].rmse < 0.15 * evaluate_log(log, NOMINAL)[equation].rmse


# --- what a log allows --------------------------------------------------------------------------------------
def test_skipped_equations_say_why(log):
    result = evaluate_log(log.drop(columns=["mdot1", "mdot2"]), NOMINAL)
    assert list(result) == ["force", "joint", "gas_valve"]
    lacking = "flow needs q, P1, P2, mdot1, mdot2; the log lacks mdot1, mdot2"
    assert result.skipped["flow"] == f"{lacking}; it is tested together with valve instead"
    assert "valve needs" in result.skipped["valve"]
    assert evaluate_log(log[["trajectory", "time", "q"]], NOMINAL).skipped.keys() == {"force", "flow", "valve", "joint"}


def test_missing_column_full_of_nan_counts_as_missing(log):
    assert "joint" in evaluate_log(log.assign(F2=np.nan), NOMINAL).skipped


def test_gap_costs_only_the_windows_around_it_and_only_who_reads_it(log):
    broken = log.copy()
    broken.loc[500:600, "F1"] = np.nan
    whole, holed = evaluate_log(log, NOMINAL), evaluate_log(broken, NOMINAL)
    assert holed["flow"].n_windows == whole["flow"].n_windows
    lost = whole["force"].n_windows - holed["force"].n_windows
    assert 10 <= lost <= 16
    assert holed["force"].rmse == pytest.approx(whole["force"].rmse, rel=0.05)


def test_jump_of_time_is_a_border(log):
    run = log[log["trajectory"] == RUNS[0].name].reset_index(drop=True)
    cut = run[(run.index < 800) | (run.index >= 1200)]
    for e in evaluate_log(cut, NOMINAL).values():
        assert e.rmse < 1.2 * e.noise_floor


def test_slower_sampling_keeps_the_windows(log):
    thinned = log.groupby("trajectory", sort=False).nth(slice(None, None, 4))
    result = evaluate_log(thinned, NOMINAL)
    assert result["force"].n_windows == evaluate_log(log, NOMINAL)["force"].n_windows
    assert result["force"].rmse < 1.2 * result["force"].noise_floor


def test_flow_that_changes_right_after_a_sample_is_no_gap(log):
    """A command that comes late by a part of a period switches the valve between two samples."""
    late = log.copy()
    flows = ["mdot1", "mdot2"]
    late[flows] = log.groupby("trajectory", sort=False)[flows].transform(lambda x: x.shift(fill_value=x.iloc[0]))
    plain, shifted = evaluate_log(log, NOMINAL)["flow"], evaluate_log(late, NOMINAL)["flow"]
    assert shifted.rmse < 1.15 * plain.rmse  # 3.5 times with the flow of the sample or a line to the next one


def test_a_lagging_meter_of_a_held_flow_is_undone(ideal):
    """A quick valve's flow stands from sample to sample, and the meter follows that, not a line between the samples."""
    decay = np.exp(-1e-3 / 4e-3)
    lagging = ideal.astype({"mdot1": float, "mdot2": float})
    for side in (1, 2):
        for rows in ideal.groupby("trajectory", sort=False).groups.values():
            flow = ideal.loc[rows, f"mdot{side}"].to_numpy()
            held = lfilter([1.0 - decay], [1.0, -decay], flow[:-1], zi=[decay * flow[0]])[0]
            lagging.loc[rows, f"mdot{side}"] = np.concatenate([flow[:1], held])
    lag = NOMINAL.replace(effects=[("flow_lag", {"time_constant": 4e-3})])
    gap, undone = (evaluate_log(lagging, sim)["valve"].rmse for sim in (NOMINAL, lag))
    assert undone < 0.02 * gap


def test_trajectories_do_not_meet(log):
    """Each run alone gives what it gives within the log."""
    whole = evaluate_log(log, NOMINAL)
    for run in RUNS:
        alone = evaluate_log(log[log["trajectory"] == run.name], NOMINAL)
        for name, e in alone.items():
            assert e.rmse == pytest.approx(whole[name].trajectories[run.name].rmse)


def test_memory_does_not_grow_with_the_number_of_runs():
    log = simulate(NOMINAL, [hold(a, 1000) for a in range(5)])
    peaks = []
    for copies in (4, 40):
        big = pd.concat([log.assign(trajectory=log["trajectory"] + f"-{k}") for k in range(copies)], ignore_index=True)
        codes = big["trajectory"].astype("category")
        big["trajectory"] = codes
        tracemalloc.start()
        for _ in residuals(big, NOMINAL):
            pass
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    rows = 36 * len(log)
    assert (peaks[1] - peaks[0]) / rows < 40  # bytes a row: names of trajectories and masks, no copies of channels


# --- broken logs --------------------------------------------------------------------------------------------
def broken_logs(log: pd.DataFrame) -> dict:
    run = log[log["trajectory"] == RUNS[0].name].reset_index(drop=True)
    shuffled = pd.concat([run[:500], run[:500].assign(trajectory="other"), run[500:]], ignore_index=True)
    back = run.copy()
    back.loc[700, "time"] = 0.1
    infinite = run.copy()
    infinite.loc[5, "P1"] = np.inf
    holed = run.copy()
    holed.loc[5, "time"] = np.nan
    return {
        "no trajectory": (run.drop(columns="trajectory"), MissingTrajectoryError, "no column 'trajectory'"),
        "interleaved": (shuffled, InterleavedTrajectoryError, "2 runs in 3"),
        "time goes back": (back, TimeOrderError, "goes from"),
        "infinite": (infinite, NonFiniteError, "'P1'"),
        "time is NaN": (holed, NonFiniteError, "holds NaN"),
        "no rows": (run[:0], EmptyLogError, "no rows"),
        "too short": (run[:12], ShortTrajectoryError, "long enough"),
        "text": (run.assign(F1="a lot"), ColumnTypeError, "'a lot'"),
    }


@pytest.mark.parametrize(
    "kind", sorted(broken_logs(pd.DataFrame({"trajectory": ["x"] * 9, "time": range(9), "P1": 1.0})))
)
def test_broken_log(log, kind):
    broken, error, words = broken_logs(log)[kind]
    with pytest.raises(error, match=words) as caught:
        evaluate_log(broken, NOMINAL)
    assert caught.value.expected
    assert caught.value.remedy


def test_unknown_equation(log):
    with pytest.raises(UnknownOptionError, match="no equation 'torque'"):
        evaluate_log(log, NOMINAL, ["torque"])


def test_equations_are_discovered():
    assert list(all_equations()) == ["force", "flow", "valve", "joint", "gas_valve", "joint_modelled"]


def test_jitter_that_a_command_really_causes_is_no_noise():
    rng = np.random.default_rng(0)
    drive, noise = rng.normal(size=4000), 0.1 * rng.normal(size=4000)
    alone = channel_noise(1.02 * drive + noise, 20)
    beside = noise_beside(1.02 * drive + noise, drive, alone)
    assert alone.white > 0.9 and beside.white == pytest.approx(0.1, rel=0.1)
    assert noise_beside(noise, drive, channel_noise(noise, 20)).white == pytest.approx(0.1, rel=0.1)
