"""Logs of every format become one tidy frame in SI."""

from __future__ import annotations

import json
import warnings
from pathlib import Path

import h5py
import numpy as np
import pandas as pd
import pytest
import scipy.io
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from pamid.errors import MappingError, SamplingWarning, UnitError, UnitWarning
from pamid.signals import UNITS, FileConstants, LogMapping, SignalMapping, check_units, read_log, write_log
from pamid.signals.formats import all_formats
from pamid.signals.log import find_logs
from pamid.signals.unit_names import parse_quantity

MAPPINGS = Path(__file__).parents[2] / "docs" / "mappings"
of_the_docs = pytest.mark.skipif(not MAPPINGS.is_dir(), reason="needs the repository")


@pytest.fixture
def log() -> pd.DataFrame:
    rng = np.random.default_rng(0)
    t = np.arange(40) * 1e-3
    return pd.DataFrame(
        {
            "trajectory": np.repeat(["sine-1", "step-1"], 40),
            "time": np.tile(t, 2),
            "q": 0.2 * rng.standard_normal(80),
            "P1": 2e5 + 1e4 * rng.standard_normal(80),
            "F1": 100 * rng.uniform(size=80),
        }
    )


# --- formats --------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("ending", [".csv", ".parquet", ".h5"])
def test_round_trip(log, tmp_path, ending):
    """What is written is read back to the last bit, without a mapping."""
    back = read_log(write_log(log, tmp_path / f"log{ending}"))
    pd.testing.assert_frame_equal(back, log, check_dtype=False, rtol=0, atol=0)


def test_formats_are_found_by_themselves():
    assert {f.name for f in all_formats()} == {
        "text (CSV)",
        "parquet",
        "MATLAB",
        "HDF5",
        "JSON",
        "MCAP",
        "ULog",
        "rosbag",
    }


TABLE = np.column_stack([np.arange(6.0) * 10, 3 + 0.1 * np.arange(6.0), 12 + 0.5 * np.arange(6.0)])
MAPPING = {
    "time": {"column": 0, "unit": "ms"},
    "P": {"column": 1, "unit": "bar", "gauge": True},
    "x": {"column": 2, "unit": "mm"},
}


def as_text(separator: str, *, header: bool = False, comma: bool = False, tail: str = "\n") -> str:
    rows = [separator.join(f"{v:.3f}" for v in row) for row in TABLE]
    if comma:
        rows = [row.replace(".", ",") for row in rows]
    return "\n".join([*([separator.join(["t", "p", "s"])] if header else []), *rows]) + tail


@pytest.mark.parametrize("header", [False, True])
@pytest.mark.parametrize(
    ("separator", "comma"), [(",", False), (";", False), (";", True), ("\t", False), ("\t", True), ("  ", False)]
)
@pytest.mark.parametrize("tail", ["\n", "", "\r\n\r\n"])
def test_text(tmp_path, separator, comma, header, tail):
    """Separators, decimal commas, headers and ends of files are distinguished."""
    file = tmp_path / "run.csv"
    file.write_text(as_text(separator, header=header, comma=comma, tail=tail))
    log = read_log(file, MAPPING)
    np.testing.assert_allclose(log["time"], TABLE[:, 0] / 1e3)
    np.testing.assert_allclose(log["P"], TABLE[:, 1] * 1e5 + 101_325)
    np.testing.assert_allclose(log["x"], TABLE[:, 2] / 1e3)
    assert set(log["trajectory"]) == {"run"}


def test_text_with_bom_comments_and_latin_letters(tmp_path):
    file = tmp_path / "run.txt"
    file.write_bytes("﻿# bench\ntime [ms],q [°],Länge [mm]\n0,1,2\n1,2,3\n2,3,4\n".encode())
    log = read_log(file)
    np.testing.assert_allclose(log["q"], np.deg2rad([1, 2, 3]))
    np.testing.assert_allclose(log["Länge"], [0.002, 0.003, 0.004])
    file.write_bytes("time,Länge\n0,1\n0.1,2\n".encode("latin-1"))
    assert list(read_log(file).columns) == ["trajectory", "time", "Länge"]


@of_the_docs
def test_thousands_points_beside_decimal_points(tmp_path):
    """975.000 then 1.075.000, as some recorders write the time."""
    file = tmp_path / "chamber.csv"
    file.write_text("0.000;3.8;7.7\r\n975.000;3.8;7.7\r\n1.075.000;3.8;7.6\r\n151.203.000;3.6;7.2")
    with pytest.warns(SamplingWarning, match="gap"):
        log = read_log(file, MAPPINGS / "air_chamber.toml")
    np.testing.assert_allclose(log["time"], [0, 0.975, 1.075, 151.203])


@of_the_docs
def test_matlab_5_with_objects_beside_arrays(tmp_path):
    """Variables are chosen by pattern, the zero run is subtracted, cells stay closed."""
    zero = np.column_stack([np.full(5, -9.0), np.full(5, 8.0), np.arange(5) * 0.002, np.ones(5)])
    run = np.column_stack([np.arange(5.0), 100 + np.arange(5.0), np.arange(5) * 0.002, [1, 1, 7, 2, 2]])
    file = tmp_path / "10mm_20cm_kinked25.mat"
    note = np.array(["a", 3], object)
    runs = {"Test9Data": run, "Test10Data": run + np.array([1, 0, 0, 0])}
    scipy.io.savemat(file, {**runs, "Offset": zero, "note": note})
    log = read_log(file, MAPPINGS / "festo.toml")
    assert list(dict.fromkeys(log["trajectory"])) == [f"10mm_20cm_kinked25-Test{n}Data" for n in (9, 10)]
    assert len(log) == 8, "one corrupt row is left out of each run"
    np.testing.assert_allclose(log["F"][:4], [9, 10, 12, 13])
    np.testing.assert_allclose(log["P"][:2], [201_325, 202_325])
    np.testing.assert_allclose(log["eps"], (18.2 - 17.45) / 18.2)


@pytest.mark.parametrize("compressed", [False, True])
def test_matlab_vectors_and_structs(tmp_path, compressed):
    t = np.arange(8) * 0.1
    file = tmp_path / "v.mat"
    scipy.io.savemat(file, {"time": t, "q": 0.1 * t, "Ts": 0.1}, do_compression=compressed, oned_as="column")
    np.testing.assert_allclose(read_log(file)["q"], 0.1 * t)
    scipy.io.savemat(file, {"run": {"time": t, "q": 0.2 * t}}, do_compression=compressed)
    np.testing.assert_allclose(read_log(file)["q"], 0.2 * t)


def test_matlab_73_is_transposed_hdf5(tmp_path):
    file = tmp_path / "new.mat"
    with h5py.File(file, "w", userblock_size=512) as f:
        data = f.create_dataset("run", data=TABLE.T)
        data.attrs["MATLAB_class"] = np.bytes_("double")
    with file.open("r+b") as stream:
        stream.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM")
    log = read_log(file, MAPPING)
    np.testing.assert_allclose(log["x"], TABLE[:, 2] / 1e3)


def test_hdf5_groups_are_trajectories(tmp_path):
    file = tmp_path / "bench.h5"
    with h5py.File(file, "w") as f:
        for name in ("sine-1", "sine-10", "sine-9"):
            for signal, values in (("time", np.arange(5) * 0.01), ("q", np.zeros(5))):
                f[f"runs/{name}/{signal}"] = values
    names = list(dict.fromkeys(read_log(file)["trajectory"]))
    assert names == ["bench-runs/sine-1", "bench-runs/sine-9", "bench-runs/sine-10"]


@of_the_docs
def test_json_entries_and_values_beside_them(tmp_path):
    rows = [{"timestamp": 0.01 * k, "position": 0.1, "speed": 0.0, "goal_position": 0.0, "load": 1, "input_volts": 7}
            for k in range(4)]  # fmt: skip
    for kp in (100, 200):
        (tmp_path / f"{kp}.json").write_text(json.dumps({"kp": kp, "trajectory": "sin", "entries": rows}))
    log = read_log(tmp_path / "*.json", MAPPINGS / "servo.toml")
    assert list(dict.fromkeys(log["trajectory"])) == ["sin-kp100", "sin-kp200"]
    (tmp_path / "columns.json").write_text(json.dumps({"time": [0, 0.1], "q": [1, 2]}))
    assert read_log(tmp_path / "columns.json")["q"].tolist() == [1, 2]


def test_clock_times_become_times_of_the_run(tmp_path):
    file = tmp_path / "stamped.csv"
    file.write_text("time,q\n2026-01-15T10:00:00.000,0\n2026-01-15T10:00:00.250,0.1\n2026-01-15T10:00:00.500,0.2\n")
    np.testing.assert_allclose(read_log(file)["time"], [0, 0.25, 0.5])
    file.write_text("time,q\n1768471200.00,0\n1768471200.25,0.1\n1768471200.50,0.2\n")
    np.testing.assert_allclose(read_log(file)["time"], [0, 0.25, 0.5], atol=1e-6)


# --- several files --------------------------------------------------------------------------------------------
def test_names_of_several_files_stay_unique(log, tmp_path):
    for folder in ("one", "two"):
        (tmp_path / folder).mkdir()
        write_log(log, tmp_path / folder / "data.parquet")
    (tmp_path / "one" / "truth.json").write_text("{}")
    names = list(dict.fromkeys(read_log([tmp_path / "one", tmp_path / "two"])["trajectory"]))
    assert names == [f"{n}@{f}/data" for f in ("one", "two") for n in ("sine-1", "step-1")]


def test_files_without_trajectories_are_one_each(tmp_path):
    for number in (10, 9):
        (tmp_path / f"run{number}.csv").write_text("time,q\n0,0\n0.1,0\n")
    assert list(dict.fromkeys(read_log(tmp_path / "run*.csv")["trajectory"])) == ["run9", "run10"]
    assert [p.name for p in find_logs([tmp_path / "run9.csv", tmp_path])] == ["run9.csv", "run10.csv"]


# --- mappings -------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("file", sorted(MAPPINGS.glob("*.toml")), ids=lambda p: p.stem)
def test_documented_mappings_load(file):
    mapping = LogMapping.load(file)
    assert "time" in mapping.signals
    assert all(m.si_unit(name) is None or m.si_unit(name).factor > 0 for name, m in mapping.signals.items())


def test_calibration_line_sign_and_range(tmp_path):
    (tmp_path / "adc.csv").write_text("t,adc,f\n0,100,5\n0.1,200,6\n0.2,4095,7\n0.3,300,8\n")
    log = read_log(
        tmp_path / "adc.csv",
        {
            "time": "t",
            "P": {
                "column": "adc",
                "scale": 0.75,
                "offset_after": -10,
                "unit": "kPa",
                "gauge": True,
                "range": [0, 4000],
            },
            "F": {"column": "f", "sign": -1, "offset": -1},
        },
    )
    np.testing.assert_allclose(log["P"], 101_325 + 1e3 * (0.75 * np.array([100, 200, 300]) - 10))
    np.testing.assert_allclose(log["F"], [-4, -5, -7])


@pytest.mark.parametrize(("source", "expected"), [("length", 0.1), ("shortening", 0.9)])
def test_eps_from_a_length(tmp_path, source, expected):
    (tmp_path / "l.csv").write_text("time,L\n0,180\n0.1,180\n")
    signals = {"time": "time", "eps": {"column": "L", "unit": "mm", "source": source}}
    log = read_log(tmp_path / "l.csv", {"signals": signals, "constants": {"rest_length": "20 cm"}})
    np.testing.assert_allclose(log["eps"], expected)


@pytest.mark.parametrize(
    ("signal", "unit", "gauge", "expected"),
    [
        ("P", "bar", None, 3e5),
        ("P", "barg", None, 401_325),
        ("P", "bara", None, 3e5),
        ("P", "bar", True, 401_325),
        ("p_gauge", "bar", None, 3e5),
        ("p_gauge", "bara", None, 198_675),
        ("p1", "bar", False, 198_675),
    ],
)
def test_pressure_references(tmp_path, signal, unit, gauge, expected):
    (tmp_path / "p.csv").write_text("time,s\n0,3\n0.1,3\n")
    log = read_log(tmp_path / "p.csv", {"time": "time", signal: {"column": "s", "unit": unit, "gauge": gauge}})
    np.testing.assert_allclose(log[signal], expected)


def test_skip_rows_keep_others_and_period(tmp_path):
    (tmp_path / "a.csv").write_text("q,extra,note\n" + "\n".join(f"{k / 10},{k},x" for k in range(6)))
    log = read_log(tmp_path / "a.csv", {"signals": {"q": "q"}, "sampling_period": "5 ms", "skip_rows": 2,
                                        "keep_others": True})  # fmt: skip
    assert log["extra"].tolist() == [2, 3, 4, 5]
    np.testing.assert_allclose(log["time"], [0.01, 0.015, 0.02, 0.025])


def test_clock_that_restarts_splits(tmp_path):
    (tmp_path / "leak.csv").write_text("time,q\n0,0\n0.1,0\n0.2,0\n0.05,1\n0.15,1\n")
    log = read_log(tmp_path / "leak.csv", time_order="split")
    assert log["trajectory"].tolist() == ["leak.1"] * 3 + ["leak.2"] * 2


def test_sort_brings_interleaved_rows_together(log, tmp_path):
    write_log(log.sample(frac=1, random_state=0), tmp_path / "mixed.csv")
    back = read_log(tmp_path / "mixed.csv", time_order="sort")
    for name, rows in log.groupby("trajectory"):
        pd.testing.assert_frame_equal(
            back[back["trajectory"] == name].reset_index(drop=True), rows.reset_index(drop=True), check_dtype=False
        )


def test_doubled_time_stamps(tmp_path):
    times = [0.1 * k for k in range(40)]
    times.insert(20, times[19])
    (tmp_path / "d.csv").write_text("time,q\n" + "\n".join(f"{t},{k / 100}" for k, t in enumerate(times)))
    with pytest.warns(SamplingWarning, match="1 rows with the same time as the row before"):
        dropped = read_log(tmp_path / "d.csv")
    assert len(dropped) == 40
    assert dropped["q"].iloc[19] == pytest.approx(0.19)
    with pytest.warns(SamplingWarning):
        mean = read_log(tmp_path / "d.csv", duplicates="mean")
    assert mean["q"].iloc[19] == pytest.approx(0.195)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert len(read_log(tmp_path / "d.csv", duplicates="keep")) == 41


def test_mixed_sampling_is_told(tmp_path):
    for name, step in (("a", 0.01), ("b", 0.05)):
        (tmp_path / f"{name}.csv").write_text("time,q\n" + "\n".join(f"{step * k},0" for k in range(5)))
    with pytest.warns(SamplingWarning, match=r"mixed: 0.01 s in 'a', 0.05 s in 'b'"):
        read_log(tmp_path)


@pytest.mark.parametrize("policy", ["drop", "keep"])
def test_nan_policies(tmp_path, policy):
    (tmp_path / "n.csv").write_text("time,q,x\n0,0,0\n0.1,,0\n0.2,0.3,0\n")
    log = read_log(tmp_path / "n.csv", nan=policy)
    assert len(log) == (2 if policy == "drop" else 3)
    assert log["q"].isna().sum() == (0 if policy == "drop" else 1)


@pytest.mark.parametrize("column", ["run", {"column": "run"}, {"column": 0}])
@pytest.mark.parametrize("names", [("a", "b"), ("1", "2")])
def test_the_column_of_runs_may_stand_among_the_signals(tmp_path, column, names):
    """It is what a newcomer writes, and no signal: text is read as text, and numbers name runs."""
    rows = [f"{name},{k / 10},{k}" for name in names for k in range(3)]
    (tmp_path / "runs.csv").write_text("run,t,speed\n" + "\n".join(rows) + "\n")
    log = read_log(tmp_path / "runs.csv", {"signals": {"trajectory": column, "time": "t", "v": "speed"}})
    assert log["trajectory"].drop_duplicates().tolist() == list(names)
    assert list(log.columns) == ["trajectory", "time", "v"]


def test_two_columns_of_runs_are_refused(tmp_path):
    with pytest.raises(MappingError, match="'day'"):
        LogMapping.load({"trajectory": "run", "signals": {"trajectory": {"column": "day"}, "time": "t"}})
    with pytest.raises(MappingError, match="unit"):
        LogMapping.load({"signals": {"trajectory": {"column": "day", "unit": "s"}}})


# --- units ----------------------------------------------------------------------------------------------------
@given(st.sampled_from(sorted(UNITS)), st.floats(-1e6, 1e6))
def test_quantities_are_linear_in_their_unit(unit, value):
    """A text of number and unit is the number times the unit's factor, wherever the unit stands."""
    got = parse_quantity(f"{value!r} {unit}")
    assert got == pytest.approx(value * UNITS[unit].factor + UNITS[unit].offset, rel=1e-12, abs=1e-12)


@pytest.mark.parametrize(
    ("text", "si"),
    [("90 km/h", 25.0), ("1.2 km", 1200.0), ("250 cm³/s", 2.5e-4), ("3 mNm", 3e-3), ("2 kW", 2000.0),
     ("28 cm^2", 28e-4), ("180 deg/s2", np.pi), ("50 mph", 22.352)],
)  # fmt: skip
def test_units_of_vehicles_tanks_and_drives(text, si):
    assert parse_quantity(text) == pytest.approx(si)


@settings(deadline=None, max_examples=40, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    unit=st.sampled_from(["Pa", "kPa", "bar", "mbar", "MPa", "psi"]),
    time_unit=st.sampled_from(["s", "ms", "us", "min"]),
    gauge=st.booleans(),
    rows=st.integers(2, 30),
    seed=st.integers(0, 99),
)
def test_units_round_trip(tmp_path, unit, time_unit, gauge, rows, seed):
    """Whatever unit a log is written in, the same SI values are read."""
    rng = np.random.default_rng(seed)
    P, t = rng.uniform(1.2e5, 7e5, rows), np.cumsum(rng.uniform(0.5e-3, 1e-3, rows))
    raw = (P - 101_325 * gauge) / UNITS[unit].factor
    pd.DataFrame({"a": t / UNITS[time_unit].factor, "b": raw}).to_csv(tmp_path / "u.csv", index=False)
    mapping = {"time": {"column": "a", "unit": time_unit}, "P": {"column": "b", "unit": unit, "gauge": gauge}}
    log = read_log(tmp_path / "u.csv", mapping, sampling="ignore")
    np.testing.assert_allclose(log["P"], P, rtol=1e-9)
    np.testing.assert_allclose(log["time"], t, rtol=1e-9)


@pytest.mark.parametrize(
    ("signal", "values", "words"),
    [
        ("length", [120.0, 110.0], "length 120 looks like mm; expected m"),
        ("P", [2.0, 6.2], "looks like bar; expected Pa, absolute"),
        ("P1", [200.0, 620.0], "looks like kPa"),
        ("P", [0.2, 0.62], "looks like MPa"),
        ("P", [2e4, 5e5], "looks like gauge pressure; expected absolute pressure"),
        ("p_gauge", [2.0, 6.2], "looks like bar; expected Pa, gauge"),
        ("eps", [0.0, 20.0], "looks like percent"),
        ("q", [-25.0, 25.0], "looks like degrees; expected rad"),
        ("time", [0.0, 1.0, 2.0, 3.0], "looks like ms; expected s"),
        ("mdot1", [0.0, 2.0], "looks like g/s"),
        ("u1", [-100.0, 100.0], "looks like percent"),
        ("T", [20.0, 21.0], "looks like °C"),
        ("dP", [0.1, 2.0], "looks like bar/s"),
    ],
)
def test_plainly_wrong_units_are_named(signal, values, words):
    with pytest.warns(UnitWarning, match=words):
        found = check_units({signal: values})
    assert len(found) == 1


def test_plausible_values_pass():
    good = {"time": [0.0, 0.001], "P": [1.0e5, 7e5], "p": [0.0, 5e5], "eps": [-0.02, 0.3], "q": [-1.5, 1.5],
            "F": [0, 2000], "mdot": [-1e-2, 1e-2], "u": [-1, 1], "L": [0.1, 0.45],
            "dP": [-1e6, 1e6], "deps": [-2, 2]}  # fmt: skip
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert check_units(good) == []
        assert check_units(pd.DataFrame({"other": [1e9]})) == []


def test_checks_can_be_overruled(tmp_path):
    (tmp_path / "slow.csv").write_text("time,q\n0,10\n1,20\n2,30\n")
    with pytest.raises(UnitError, match="looks like degrees"):
        read_log(tmp_path / "slow.csv")
    assert len(read_log(tmp_path / "slow.csv", check_units=False)) == 3
    overruled = {"time": {"check": False}, "q": {"check": False}}
    assert len(read_log(tmp_path / "slow.csv", overruled)) == 3
    stated = {"time": {"unit": "s"}, "q": {"unit": "deg"}}  # a clock whose unit is stated may be as slow as it says
    assert read_log(tmp_path / "slow.csv", stated)["time"].tolist() == [0.0, 1.0, 2.0]


# --- the objects ----------------------------------------------------------------------------------------------
def test_a_mapping_is_the_same_from_dict_toml_and_objects(tmp_path):
    (tmp_path / "m.toml").write_text(
        '[signals]\nP = { column = 1, unit = "kPa" }\n[[files]]\nmatch = "*25*"\nconstants = { eps = 0.1 }\n'
    )
    by_dict = {"signals": {"P": {"column": 1, "unit": "kPa"}}, "files": [{"match": "*25*", "constants": {"eps": 0.1}}]}
    built = LogMapping({"P": SignalMapping(1, "kPa")}, files=(FileConstants("*25*", {"eps": 0.1}),))
    assert LogMapping.load(tmp_path / "m.toml") == LogMapping.load(by_dict) == LogMapping.load(built) == built
    assert built.constants_of("folder/run25.mat") == {"eps": 0.1}
    assert built.constants_of("folder/run50.mat") == {}


@pytest.mark.parametrize(
    ("setting", "value"),
    [
        ("decimal", 3), ("decimal", "ab"), ("thousands", ""), ("delimiter", 3), ("header", -5), ("header", "no"),
        ("keep_others", "no"), ("entries", 3), ("trajectory", True), ("skip_rows", -1), ("constants", [1]),
        ("files", 3), ("sampling_period", float("nan")), ("P.gauge", "no"), ("P.gauge", 1), ("P.check", "no"),
        ("P.own", 3),
        ("P.scale", float("nan")), ("P.offset", float("inf")), ("P.offset_after", "2"), ("P.range", ["a", 1]),
        ("P.range", [float("nan"), 1]), ("P.column", []), ("P.column", 1.5), ("P.unit", 5), ("P.sign", True),
    ],
)  # fmt: skip
def test_a_setting_of_another_kind_is_named(setting, value):
    name, _, of_signal = setting.partition(".")
    source = {"signals": {name: {of_signal: value}}} if of_signal else {setting: value}
    with pytest.raises(MappingError) as caught:
        LogMapping.load(source)
    assert caught.value.found.startswith(f"{setting} is")
    assert caught.value.expected
    assert caught.value.remedy


def test_a_mapping_in_objects_is_checked_too(tmp_path):
    (tmp_path / "a.csv").write_text("time,q\n0,0\n0.1,0\n")
    with pytest.raises(MappingError, match="time_order"):
        read_log(tmp_path / "a.csv", LogMapping(time_order="backwards"))
