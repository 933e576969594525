"""Lost samples, holes in channels, uneven times, pauses and short runs: logs with them are used, with their noise."""

from __future__ import annotations

import json

import numpy as np
import pandas as pd
import pytest
from support.bench_logs import NOMINAL, RUNS

from pamid.bench import isobaric, simulate, sine
from pamid.bench.sensors import IDEAL, SENSORS
from pamid.cli import main
from pamid.equations import channel_noise, evaluate_log
from pamid.equations.log import BenchLog
from pamid.equations.run import Model
from pamid.errors import ShortTrajectoryError
from pamid.gap import diagnose, state_table
from pamid.gap.residuals.bench import Evidence
from pamid.report import answers
from pamid.signals.noise import third_differences

EQUATIONS = ["force", "flow", "valve", "joint"]


# --- ways to damage a log -----------------------------------------------------------------------------------
def lost(log: pd.DataFrame, share: float, seed: int = 0) -> pd.DataFrame:
    keep = np.random.default_rng(seed).random(len(log)) >= share
    return log[keep].reset_index(drop=True)


def scattered(log: pd.DataFrame) -> pd.DataFrame:
    rng, out = np.random.default_rng(1), log.copy()
    for column, share in (("P1", 0.1), ("F1", 0.1), ("q", 0.05)):
        out.loc[rng.random(len(log)) < share, column] = np.nan
    return out


def short_runs(log: pd.DataFrame) -> pd.DataFrame:
    parts = [
        part.iloc[k : k + 200].assign(trajectory=f"{name}/{k}")
        for name, part in log.groupby("trajectory", sort=False)
        for k in range(0, len(part) - 199, 200)
    ]
    return pd.concat(parts, ignore_index=True)


def paused(log: pd.DataFrame) -> pd.DataFrame:
    parts = []
    for _, part in log.groupby("trajectory", sort=False):
        half = len(part) // 2
        late = part.assign(time=part["time"] + 60.0 * (np.arange(len(part)) >= half))
        parts.append(late.drop(index=late.index[half : half + 200]))
    return pd.concat(parts, ignore_index=True)


def late_stamps(log: pd.DataFrame) -> pd.DataFrame:
    return log.assign(time=log["time"] + np.random.default_rng(2).uniform(0, 6e-4, len(log)))


DAMAGE = {
    "2 % lost": lambda log: lost(log, 0.02),
    "20 % lost": lambda log: lost(log, 0.2),
    "33 % lost": lambda log: lost(log, 0.33),
    "scattered": scattered,
    "short": short_runs,
    "paused": paused,
    "late stamps": late_stamps,
}


def uneven(seed: int = 3) -> pd.DataFrame:
    """A log whose samples are really taken 1 to 3 ms apart."""
    rng, exact = np.random.default_rng(seed), simulate(NOMINAL, RUNS, sensors=IDEAL)
    parts = []
    for _, part in exact.groupby("trajectory", sort=False):
        rows = np.cumsum(rng.choice((1, 2, 3), len(part)))
        parts.append(part.iloc[rows[rows < len(part)]])
    out = pd.concat(parts, ignore_index=True)
    for column in ("q", "P1", "P2", "F1", "F2", "mdot1", "mdot2"):
        out[column] = SENSORS[column.rstrip("12")].read(out[column].to_numpy(), rng)
    return out


# --- residuals and their noise ------------------------------------------------------------------------------
@pytest.mark.parametrize("damage", DAMAGE)
def test_right_simulator_leaves_the_noise_that_is_stated(log, damage):
    found = evaluate_log(DAMAGE[damage](log), NOMINAL)
    assert list(found) == EQUATIONS
    for name, e in found.items():
        assert 0.85 < e.rmse / e.noise_floor < 1.15, (name, e.rmse / e.noise_floor)


def test_uneven_samples_leave_the_noise_that_is_stated():
    for name, e in evaluate_log(uneven(), NOMINAL).items():
        assert 0.8 < e.rmse / e.noise_floor < 1.2, (name, e.rmse / e.noise_floor)


def test_uneven_samples_are_told_from_late_stamps():
    """Times within a quarter of a step of even ones: the angle tells whether the samples or the stamps are off."""
    exact, even = simulate(NOMINAL, [sine(10, 15, 4000)], sensors=IDEAL), np.arange(5, 3990, 5)
    rows = even + np.random.default_rng(0).integers(-1, 2, len(even))
    moved = exact.iloc[rows].reset_index(drop=True)
    run = next(BenchLog.of(moved).runs(Model(NOMINAL), []))
    truth = np.interp(run.time, exact["time"], exact["q"])
    assert np.max(np.abs(run.q - truth)) < 1e-4 < np.max(np.abs(moved["q"] - truth))
    stamped = exact.iloc[even].reset_index(drop=True).assign(time=moved["time"])
    run = next(BenchLog.of(stamped).runs(Model(NOMINAL), []))
    np.testing.assert_array_equal(run.q, stamped["q"])


@pytest.mark.parametrize("damage", ["20 % lost", "33 % lost", "scattered"])
def test_noise_is_white_where_samples_are_missing(log, damage):
    evidence = Evidence(DAMAGE[damage](log), NOMINAL.replace(tolerance={}))
    for name, part in zip(evidence.equations, evidence.parts, strict=True):
        z, key = evidence.z0[part], evidence.run[part] * 2 + evidence.side[part]
        series = [z[key == k] for k in np.unique(key)]
        assert 0.85 < np.std(z) < 1.15, name
        assert np.max(np.abs(z)) < 6.0, name
        assert abs(sum(float(x[1:] @ x[:-1]) for x in series) / float(z @ z)) < 0.15, name


def test_damage_costs_only_what_it_hides(log):
    whole = evaluate_log(log, NOMINAL)
    for damage in ("20 % lost", "scattered", "late stamps"):
        for name, e in evaluate_log(DAMAGE[damage](log), NOMINAL).items():
            assert e.n_windows > 0.95 * whole[name].n_windows, (damage, name)


def test_hole_of_one_channel_costs_only_who_reads_it(log):
    holed = log.copy()
    holed.loc[500:900, "mdot1"] = np.nan
    whole, found = evaluate_log(log, NOMINAL), evaluate_log(holed, NOMINAL)
    assert found["force"].n_windows == whole["force"].n_windows
    assert found["joint"].n_windows == whole["joint"].n_windows
    assert 40 <= whole["flow"].n_windows - found["flow"].n_windows <= 46


def test_channel_missing_in_one_run_is_used_in_the_others(log):
    partial = log.copy()
    partial.loc[partial["trajectory"] == RUNS[0].name, "F2"] = np.nan
    found = evaluate_log(partial, NOMINAL)
    assert RUNS[0].name not in found["force"].trajectories
    assert list(found["flow"].trajectories) == [run.name for run in RUNS]


def test_noise_of_lost_samples_is_that_of_the_channel():
    rng = np.random.default_rng(0)
    t = np.arange(4000) * 1e-3
    x = 3e5 + 4e4 * np.sin(10 * t) + rng.normal(scale=60.0, size=4000)
    at = np.flatnonzero(rng.random(4000) > 0.33)
    assert channel_noise(x[at], 20, at.astype(float)).white == pytest.approx(60.0, rel=0.1)
    np.testing.assert_allclose(third_differences(x, np.arange(4000.0)), np.diff(x, 3), rtol=1e-6, atol=1e-4)


def test_resolution_is_found_in_fast_motion():
    x = np.round((0.3 * np.arange(200.0) ** 1.1 + np.random.default_rng(0).normal(scale=0.4, size=200)) / 0.05) * 0.05
    assert channel_noise(100 * x[100:], 20).resolution <= 5.0 + 1e-9


# --- the diagnosis ------------------------------------------------------------------------------------------
FEW = ["coulomb_friction", "viscous_friction", "leakage", "dead_volume", "valve_dead_zone", "force_bias"]
SINES = [sine(4, 15, 1500), sine(7, 10, 1500), isobaric(4, 10, 1500)]


@pytest.mark.parametrize(
    ("damage", "effect"),
    [
        ("20 % lost", None),
        ("short", None),
        ("scattered", "viscous_friction"),
        ("short", "viscous_friction"),
        ("20 % lost", "leakage"),
        ("paused", "leakage"),
    ],
)
def test_damaged_log_gets_the_answer_of_the_whole_one(damage, effect):
    log = DAMAGE[damage](simulate(NOMINAL, SINES, effects=[effect] if effect else [], seed=1))
    found = diagnose(log, NOMINAL, FEW)
    assert found.verdict == ("cause" if effect else "none")
    assert [c.effects for c in found.causes] == ([(effect,)] if effect else [])
    assert {e.equation for e in found.equations} == set(EQUATIONS)
    assert found.not_tested == {}


def test_state_of_a_damaged_log_is_that_of_the_whole_one(log):
    whole = state_table(log, NOMINAL).set_index(["trajectory", "time"])
    damaged = state_table(lost(log, 0.2), NOMINAL).set_index(["trajectory", "time"])
    for name in ("dq", "eps1", "deps2", "dP1"):
        apart = damaged[name] - whole[name].reindex(damaged.index)
        assert float(apart.abs().median()) < 0.05 * float(whole[name].std()), name


# --- what was not tested is not called right ----------------------------------------------------------------
@pytest.fixture(scope="module")
def scraps() -> pd.DataFrame:
    """Runs of 15 ms each, in which not even one window fits, of a bench whose force is far off."""
    log = simulate(NOMINAL, SINES, effects=["viscous_friction"], seed=1)
    rows = np.arange(len(log))
    return log[rows % 100 < 15].assign(trajectory=[f"r{k:03d}" for k in rows[rows % 100 < 15] // 100])


def test_nothing_tested_is_no_answer(scraps):
    found = diagnose(scraps, NOMINAL, FEW)
    assert (found.verdict, found.tested, found.gap) == ("untested", False, False)
    assert set(found.not_tested) == set(EQUATIONS)
    assert found.cannot_show == FEW
    plain = json.loads(found.to_json())
    assert plain["gap"] is None
    assert plain["p_value"] is None
    assert plain["candidates"] == []
    told = answers(found)
    assert told.verdict == "Nothing could be tested"
    assert all(f"Not tested: {name} needs" in told.where for name in EQUATIONS)
    assert "agree" not in str(told)
    with pytest.raises(ShortTrajectoryError):
        evaluate_log(scraps, NOMINAL)


def test_nothing_tested_has_an_exit_code_of_its_own(scraps, tmp_path, capsys):
    scraps.to_parquet(tmp_path / "log.parquet")
    NOMINAL.to_toml(tmp_path / "sim.toml")
    out = tmp_path / "out"
    assert main(["diagnose", str(tmp_path / "log.parquet"), "--out", str(out), "--quiet"]) == 3
    assert "Nothing could be tested" in capsys.readouterr().out
    assert json.loads((out / "diagnosis.json").read_text())["verdict"] == "untested"
    assert "could be tested" in (out / "report.html").read_text()
    scraps.drop(columns=["F1", "F2", "mdot1", "mdot2"]).to_parquet(tmp_path / "bare.parquet")
    sim = str(tmp_path / "sim.toml")
    assert main(["evaluate", str(tmp_path / "bare.parquet"), "--sim", sim, "--quiet"]) in (2, 3)


def test_left_out_equation_is_named_in_every_answer():
    for effects in ([], ["leakage"]):
        log = simulate(NOMINAL, SINES, effects=effects, seed=1).drop(columns=["u1", "u2"])
        found = diagnose(log, NOMINAL, FEW)
        assert list(found.not_tested) == ["valve"]
        assert "Not tested: valve needs" in answers(found).where
        assert found.cannot_show == ["valve_dead_zone"]
        if not effects:
            assert "It cannot show valve dead zone" in answers(found).which
