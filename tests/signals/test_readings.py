"""Readings that cannot be, or hardly: told by every command with row and value, and without effect on the answer."""

from __future__ import annotations

import json
import warnings
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from pamid.bench import BenchParameters, simulate, sine, step
from pamid.cli import main
from pamid.equations import evaluate_log
from pamid.errors import IncompatibleError, ReadingError, ReadingWarning, UnitError
from pamid.gap.several import diagnose_logs
from pamid.signals import read_log, read_log_pieces, write_log
from pamid.signals.readings import _far_ends, _of_command, glitches, impossible

ROW = 700


@pytest.fixture(scope="module")
def bench() -> BenchParameters:
    return BenchParameters.for_muscle("B")


@pytest.fixture(scope="module")
def healthy(bench) -> pd.DataFrame:
    log = simulate(bench, [sine(8, 10, 500), sine(12, 8, 500), step(0, 10, 500)], effects=["leakage"], seed=0)
    return log.astype({name: float for name in log.columns if name != "trajectory"})


def files(folder: Path, log: pd.DataFrame, bench: BenchParameters) -> list[str]:
    write_log(log, folder / "log.csv")
    bench.to_toml(folder / "bench.toml")
    return [str(folder / "log.csv"), "--sim", str(folder / "bench.toml")]


def evaluated(argv: list[str], capsys) -> tuple[dict, str]:
    assert main(["evaluate", *argv, "--json"]) == 0
    out, err = capsys.readouterr()
    assert "Traceback" not in err
    return json.loads(out)["equations"], err


@pytest.mark.parametrize(
    ("column", "value", "words"),
    [
        ("P1", 0.0, "P1 cannot be 0 Pa (row 701, 0.2 s of 'sine-12-8')"),
        ("P2", -3e5, "P2 cannot be -300000 Pa (row 701"),
        ("P1", 1e300, "P1 cannot be 1e+300 Pa"),
        ("F1", -1e250, "F1 cannot be -1e+250 N"),
        ("F2", 9e3, "F2 jumps to 9000 N and back at once"),
        ("q", 3.0, "q jumps to 3 rad and back"),
        ("mdot1", 0.4, "mdot1 jumps to 0.4 kg/s"),
        ("P2", 9e6, "P2 jumps to 9e+06 Pa"),
    ],
)
def test_one_bad_reading_changes_no_answer(column, value, words, healthy, bench, tmp_path, capsys):
    whole, err = evaluated(files(tmp_path, healthy, bench), capsys)
    assert "warning" not in err
    log = healthy.copy()
    log.loc[ROW, column] = value
    argv = files(tmp_path, log, bench)
    found, err = evaluated(argv, capsys)
    assert words in err
    assert "taken as missing" in err
    assert list(found) == list(whole)
    for equation, figures in found.items():
        assert figures["rmse"] == pytest.approx(whole[equation]["rmse"], rel=0.05), equation
    assert main(["check", argv[0], "--json", "--quiet"]) == 0
    assert any(words in text for text in json.loads(capsys.readouterr().out)["warnings"])


def test_a_diagnosis_survives_it(healthy, bench, tmp_path, capsys):
    log = healthy.copy()
    log.loc[[ROW, ROW + 300, ROW + 600], "P1"] = [0.0, -3e5, 1e300]
    argv = [*files(tmp_path, log, bench), "--out", str(tmp_path / "out"), "--effects", "leakage,flow_bias"]
    assert main(["diagnose", *argv, "--json"]) == 0
    out, err = capsys.readouterr()
    assert "P1 cannot be" in err
    assert json.loads(out)["verdict"] == "cause"


@pytest.mark.parametrize(
    ("column", "value", "words"),
    [
        ("F1", 0.0, "F1 reads 0 N in all 1,500 rows while others move: used as it is"),
        ("P1", 3e5, "P1 reads 300000 Pa in all 1,500 rows"),
        ("mdot1", 0.0, "mdot1 reads 0 kg/s in all"),
        ("q", 0.1, "q reads 0.1 rad in all"),
        ("u1", 0.0, "u1 reads 0 in all"),
    ],
)
def test_a_dead_channel_is_told(column, value, words, healthy, bench, tmp_path):
    with pytest.warns(ReadingWarning, match=words.replace("(", "\\(")):
        read_log(write_log(healthy.assign(**{column: value}), tmp_path / "log.parquet"))
    one = healthy["trajectory"] == "sine-12-8"
    if column in ("F1", "P1", "mdot1"):
        log = healthy.assign(**{column: healthy[column].where(~one, value)})
        with pytest.warns(ReadingWarning, match=f"{column} reads one value throughout in 1 of 3 runs"):
            pd.concat(read_log_pieces(write_log(log, tmp_path / "log.parquet"), rows=500))


def test_a_healthy_log_gives_no_warning(healthy, tmp_path):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        read_log(write_log(healthy, tmp_path / "log.h5"))


def test_row_numbers_are_those_of_the_file(healthy, tmp_path):
    log = healthy.copy()
    log.loc[ROW, "P1"] = 0.0
    shuffled = log.iloc[::-1]
    log = pd.concat([log.iloc[:3], log.iloc[2:3], log.iloc[3:]])
    with pytest.warns(ReadingWarning, match=rf"\(row {ROW + 2}, 0.2 s"):
        read_log(write_log(log, tmp_path / "log.parquet"), nan="keep", sampling="ignore")
    with pytest.warns(ReadingWarning, match=rf"\(row {len(healthy) - ROW}, 0.2 s"):
        read_log(write_log(shuffled, tmp_path / "log.parquet"), nan="keep", time_order="sort")


def test_policies(healthy, tmp_path):
    log = healthy.copy()
    log.loc[ROW, "P1"] = 0.0
    log.loc[ROW + 9, "F1"] = 9e3
    file = write_log(log, tmp_path / "log.parquet")
    with pytest.raises(ReadingError, match="P1 cannot be 0 Pa"):
        read_log(file)
    with pytest.warns(ReadingWarning):
        kept, dropped = read_log(file, nan="keep"), read_log(file, nan="drop")
    assert int(kept.isna().sum().sum()) == 2
    assert len(dropped) == len(log) - 2
    log.loc[ROW, "P1"] = 2e5
    with pytest.warns(ReadingWarning, match="F1 jumps to 9000 N .* used as it is"):
        assert read_log(write_log(log, file))["F1"].max() == 9e3


def test_a_mapping_takes_a_signal_from_the_checks(healthy, tmp_path):
    log = healthy[["trajectory", "time", "P1", "F1"]].copy()
    log.loc[ROW, "F1"] = 9e3
    mapping = {"time": "time", "P1": "P1", "F1": {"column": "F1", "check": False}}
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        read_log(write_log(log, tmp_path / "log.csv"), {"signals": mapping, "trajectory": "trajectory"}, nan="keep")


def test_an_unknown_unit_is_told(healthy, bench, tmp_path, capsys):
    log = healthy.rename(columns={"F1": "F1 [furlong]"})
    found, err = evaluated(files(tmp_path, log, bench), capsys)
    assert "force" not in found
    assert "'F1 [furlong]' is not read as F1, since 'furlong' is not a known unit" in err


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda P: P / 6894.757, "psi"),
        (lambda P: P - 3e5, "gauge"),
        (lambda P: (P - 1.013e5) / 1e3, "kPa or psi"),
        (lambda P: 1.013e5 + 0 * P - 0.9e5 * (P > 2.9e5), "gauge"),
        (lambda P: 0 * P, "unplugged"),
        (lambda P: (P - P.min() + 101_325) / 6894.757, "looks like psi"),
        (lambda P: (P - P.min() + 101_325) / 1e3, "looks like kPa\\."),
    ],
)
def test_units_of_pressure(change, words, healthy, tmp_path):
    log = healthy.assign(P1=change(healthy["P1"]))
    with pytest.raises(UnitError, match=words):
        read_log(write_log(log, tmp_path / "log.parquet"))


def test_glitches_and_what_only_looks_like_them():
    t = np.arange(2000) / 100
    rows = [np.arange(2000)]
    noise = np.random.default_rng(0).normal(0, 0.01, 2000)
    assert not glitches(np.sin(t) + noise, rows).any()
    assert not glitches(np.abs((t % 2) - 1), rows).any(), "the tips of a triangle"
    assert not glitches(np.sign(np.sin(t)), rows).any(), "steps"
    assert not glitches((np.arange(2000) % 100 == 0).astype(float) + noise, rows).any(), "pulses that come again"
    y = np.sin(t) + noise
    y[[500, 900, 901]] += [3.0, -4.0, -4.0]
    assert np.flatnonzero(glitches(y, rows)).tolist() == [500, 900, 901]
    y[501:520] = np.nan
    assert np.flatnonzero(glitches(y, rows)).tolist() == [500, 900, 901]


def test_what_cannot_be():
    assert impossible("p_gauge", np.array([-1.1e5, -1e4]), 101_325.0).tolist() == [True, False]
    assert impossible("T", np.array([0.0, 293.0])).tolist() == [True, False]
    assert impossible("eps", np.array([1.0, np.nan])).tolist() == [True, False]
    assert impossible("branch", np.array([-1.0, 1e31])).tolist() == [False, True]


def test_a_reading_that_leaves_at_the_end_of_a_run_is_told(healthy, tmp_path):
    log = healthy.copy()
    log.loc[[0, 999], "F1"] = [9e3, -8e3]
    with pytest.warns(ReadingWarning, match=r"F1 begins or ends a run with 9000 N.*2 readings.*used as it is"):
        read_log(write_log(log, tmp_path / "log.parquet"), nan="keep")


def test_a_reading_that_leaps_at_the_end_of_a_run_is_told_though_others_come_as_far(healthy, tmp_path):
    log = healthy.copy()
    log.loc[500, "q"] = log["q"].max()
    with pytest.warns(ReadingWarning, match=r"q begins or ends a run with .* \(row 501"):
        read_log(write_log(log, tmp_path / "log.parquet"), nan="keep")


@pytest.mark.parametrize("share", [-0.9, -0.2, 0.2, 0.9])
@pytest.mark.parametrize("column", ["mdot1", "u1"])
def test_a_wrong_first_or_last_reading_is_told(column, share, healthy, bench, tmp_path):
    for row in (0, len(healthy) - 1):
        log = healthy.copy()
        log.loc[row, column] = log[column].mean() + share * np.ptp(log[column])
        with pytest.warns(ReadingWarning, match=rf"{column} begins or ends a run with|look at the readings there"):
            evaluate_log(read_log(write_log(log, tmp_path / "log.parquet"), nan="keep"), bench, ["valve"])


def test_what_a_valve_may_do_as_a_run_begins_or_ends_is_no_wrong_reading():
    rng = np.random.default_rng(0)
    rest = np.abs(rng.normal(0, 1e-6, 200))  # kg/s
    opens, ends = rest.copy(), rest.copy()
    opens[1:] += 1e-3 * np.exp(-np.arange(199) / 50)
    ends[100:-1] += 1e-3
    log = pd.DataFrame({"mdot1": opens, "u1": np.where(np.arange(200) > 0, 0.5, 0.0)})
    rows = [np.arange(200)]
    for flow in (opens, ends):
        assert not _far_ends(flow, rows, outward=True).any()
    spike = rest.copy()
    spike[0] = 1e-3
    assert np.flatnonzero(_far_ends(spike, rows, outward=True)).tolist() == [0]
    log = log.assign(mdot1=spike, u1=np.where(np.arange(200) > 0, rest, 0.5))
    assert np.flatnonzero(_of_command(log, "mdot1", rows)).tolist() == [0], "a valve that shuts at once"


def test_a_run_that_comes_twice_is_told(healthy, tmp_path, bench):
    again = healthy[healthy["trajectory"] == "sine-12-8"].assign(trajectory="copy")
    file = write_log(pd.concat([healthy, again]), tmp_path / "log.parquet")
    with pytest.warns(ReadingWarning, match="the run 'copy' repeats 'sine-12-8' sample by sample: used as it is"):
        read_log(file)
    write_log(healthy, tmp_path / "a.csv")
    write_log(healthy, tmp_path / "b.csv")
    with pytest.warns(ReadingWarning, match="sample by sample, and 2 more runs repeat others"):
        read_log([tmp_path / "a.csv", tmp_path / "b.csv"])
    with pytest.raises(IncompatibleError, match="sine-8-10 of tuesday repeats sine-8-10 of monday"):
        diagnose_logs({"monday": healthy, "tuesday": healthy}, bench, ["leakage"])
