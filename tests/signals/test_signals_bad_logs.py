# ruff: noqa: E501 - one case a line
"""Broken logs and mappings: each gives its own error, with what was found, what was expected, what to do."""

from __future__ import annotations

import json
import struct
import zlib
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pandas as pd
import pytest
import scipy.io

from pamid import errors
from pamid.signals import read_log

CSV = "time,q,P\n0,0.0,2e5\n0.001,0.1,2e5\n0.002,0.2,2e5\n0.003,0.3,2e5\n"


def text(content: str | bytes, name: str = "log.csv") -> Callable[[Path], Path]:
    def make(folder: Path) -> Path:
        file = folder / name
        file.write_bytes(content.encode() if isinstance(content, str) else content)
        return file

    return make


def table(name: str = "log.parquet", **columns) -> Callable[[Path], Path]:
    def make(folder: Path) -> Path:
        pd.DataFrame(columns).to_parquet(folder / name)
        return folder / name

    return make


def cut(name: str, share: float = 0.6) -> Callable[[Path], Path]:
    """Write a whole file of the format and cut it off."""

    def make(folder: Path) -> Path:
        whole, data = folder / f"whole{Path(name).suffix}", np.random.default_rng(0).standard_normal((4000, 3))
        if name.endswith(".mat"):
            scipy.io.savemat(whole, {"data": data}, do_compression="packed" in name)
        elif name.endswith(".h5"):
            with h5py.File(whole, "w") as f:
                f["data"] = data
        else:
            pd.DataFrame(data, columns=list("abc")).to_parquet(whole)
        content = whole.read_bytes()
        (folder / name).write_bytes(content[: int(share * len(content))])
        return folder / name

    return make


def mat(name: str = "log.mat", **variables) -> Callable[[Path], Path]:
    def make(folder: Path) -> Path:
        scipy.io.savemat(folder / name, variables)
        return folder / name

    return make


def h5(fill: Callable[[h5py.File], object], name: str = "log.h5") -> Callable[[Path], Path]:
    def make(folder: Path) -> Path:
        with h5py.File(folder / name, "w") as f:
            fill(f)
        return folder / name

    return make


def hidden_elsewhere(f: h5py.File) -> None:
    f["time"] = h5py.ExternalLink("/etc/hostname", "/")


def huge(f: h5py.File) -> None:
    f.create_dataset("time", shape=(10**9,), dtype="f8", chunks=(1000,))


def mat5_bomb(name: bytes = b"x") -> bytes:
    """A MATLAB 5 file of 300 bytes that declares 8 million million numbers."""

    def element(kind: int, data: bytes) -> bytes:
        return struct.pack("<II", kind, len(data)) + data + b"\0" * (-len(data) % 8)

    body = element(6, struct.pack("<II", 6, 0)) + element(5, struct.pack("<ii", 2_000_000, 4_000_000))
    body += element(1, name) + element(9, b"\0" * 64)
    packed = zlib.compress(struct.pack("<II", 14, len(body)) + body)
    return b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM" + struct.pack("<II", 15, len(packed)) + packed


T = np.arange(6) * 1e-3
RUN = np.column_stack([T, T])
Q = {"time": "time", "q": "q"}
CASES = {
    # the file
    "missing": (lambda d: d / "none.csv", None, errors.LogNotFoundError, "none.csv"),
    "missing, with a near name": (lambda d: text(CSV, "bench.csv")(d).parent / "bnch.csv", None, errors.LogNotFoundError, "bench.csv"),
    "pattern that matches nothing": (lambda d: d / "*.mat", None, errors.LogNotFoundError, r"\*.mat"),
    "folder without logs": (lambda d: text("x", "notes.md")(d).parent, None, errors.LogNotFoundError, "holds no log"),
    "no path at all": (lambda d: [], None, errors.LogNotFoundError, "No log is given"),
    "path of another type": (lambda d: [3], None, errors.ParameterError, "3"),
    "empty": (text(""), None, errors.EmptyLogError, "empty"),
    "blank lines only": (text("\n\n  \n"), None, errors.EmptyLogError, "empty"),
    "header only": (text("time,q\n"), None, errors.EmptyLogError, "no rows"),
    "parquet without rows": (table(time=np.zeros(0), q=np.zeros(0)), None, errors.EmptyLogError, "no rows"),
    "binary garbage": (text(bytes(range(256)) * 40), None, errors.LogFormatError, "binary"),
    "parquet named CSV": (lambda d: _renamed(d), None, errors.LogFormatError, "content is parquet"),
    "text named parquet": (text(CSV, "log.parquet"), None, errors.LogFormatError, "content is text"),
    "text named MATLAB": (text(CSV, "log.mat"), None, errors.LogFormatError, "content is text"),
    "numpy pickle": (lambda d: _npz(d), None, errors.LogFormatError, "Python objects"),
    "truncated parquet": (cut("log.parquet"), None, errors.TruncatedLogError, "cut off"),
    "truncated MATLAB": (cut("log.mat"), None, errors.TruncatedLogError, "cut off"),
    "truncated packed MATLAB": (cut("packed.mat"), None, errors.TruncatedLogError, "cut off"),
    "MATLAB header only": (cut("log.mat", 0.0005), None, errors.TruncatedLogError, "cut off"),
    "truncated HDF5": (cut("log.h5"), None, errors.TruncatedLogError, "cut off"),
    "truncated CSV": (text(CSV + "0.004,0."), None, errors.TruncatedLogError, "2 of 3 fields"),
    "truncated JSON": (text('{"entries": [{"time": 0', "log.json"), None, errors.TruncatedLogError, "complete JSON"),
    "JSON without entries": (text('{"a": 1}', "log.json"), None, errors.LogFormatError, "lists of objects"),
    "JSON of numbers": (text("[1, 2, 3]", "log.json"), None, errors.LogFormatError, "not all objects"),
    "surplus field": (text(CSV + "0.004,1,2,3\n"), None, errors.LogFormatError, "line 6 has 4 fields"),
    # hostile
    "MATLAB cells only": (mat(c=np.array([1, "a"], object)), None, errors.HostileLogError, "cell"),
    "MATLAB complex": (mat(z=np.array([1j, 2])), None, errors.HostileLogError, "complex"),
    "MATLAB declares terabytes": (text(mat5_bomb(), "log.mat"), None, errors.HostileLogError, "declares"),
    "HDF5 strings only": (h5(lambda f: f.create_dataset("s", data="abc")), None, errors.HostileLogError, "no numeric"),
    "HDF5 link to another file": (h5(hidden_elsewhere), None, errors.HostileLogError, "no numeric"),
    "HDF5 declares gigabytes": (h5(huge), None, errors.HostileLogError, "declares"),
    # columns
    "no header, no mapping": (text("0 1 2\n1 2 3\n"), None, errors.MissingColumnError, "3 columns without names"),
    "no time": (text("q,P\n0,2e5\n0,2e5\n"), None, errors.MissingColumnError, "no time"),
    "mapped column missing": (text(CSV), {"time": "time", "q": "angle"}, errors.MissingColumnError, "no column 'angle'"),
    "mapped position missing": (text(CSV), {"time": 0, "q": 7}, errors.MissingColumnError, "position 7"),
    "doubled header": (text("time,q,q\n0,1,1\n0.1,1,1\n"), None, errors.DuplicateColumnError, "'q'"),
    "signal and constant": (text(CSV), {"signals": Q, "constants": {"q": 0.1}}, errors.DuplicateColumnError, "both"),
    "text in numbers": (text("time,q\n0,0\n0.1,oops\n0.2,0\n"), None, errors.ColumnTypeError, "'oops' in row 2"),
    "text in a mapped column": (text("time,q,n\n0,0,a\n0.1,0,b\n"), {"time": "time", "x": "n"}, errors.ColumnTypeError, "'a'"),
    "thousands points unsaid": (text("1.075.000;2\n1.175.000;3\n"), {"time": 0, "q": 1}, errors.ColumnTypeError, "thousands"),
    "nameless trajectory": (table(trajectory=["a", None], time=[0.0, 0.1]), None, errors.ColumnTypeError, "no run in 1"),
    # values
    "NaN": (text("time,q\n0,0\n0.1,\n0.2,nan\n"), None, errors.NonFiniteError, "2 rows of q"),
    "infinite": (text("time,q\n0,0\n0.1,inf\n0.2,0\n"), None, errors.NonFiniteError, "infinite"),
    "nothing left of NaN": (text("time,q\n0,nan\n0.1,nan\n"), {"nan": "drop"}, errors.EmptyLogError, "no usable rows"),
    "millimetres": (table(time=T, length=T + 120), None, errors.UnitError, "length 120 looks like mm"),
    "bar": (table(time=T, P=T + 6), None, errors.UnitError, "looks like bar"),
    "gauge": (table(time=T, P=np.linspace(0, 5e5, 6)), None, errors.PressureReferenceError, "gauge = true"),
    "degrees": (table(time=T, q=np.linspace(-25, 25, 6)), None, errors.UnitError, "degrees"),
    "percent": (table(time=T, eps=np.linspace(0, 25, 6)), None, errors.UnitError, "percent"),
    "milliseconds": (table(time=T * 1e3, q=T), None, errors.UnitError, "looks like ms"),
    # time and trajectories
    "one row": (text("time,q\n0,0\n"), None, errors.ShortTrajectoryError, "has 1 row"),
    "time stands still": (table(time=T * 0, q=T), None, errors.TimeError, "in all 6 rows"),
    "time goes back": (table(time=T[[0, 2, 1, 3, 4, 5]], q=T), None, errors.TimeOrderError, "goes backwards 1 times"),
    "coarse clock": (table(time=np.repeat([0.0, 0.1, 0.2], [3, 2, 1]), q=T), None, errors.TimeOrderError, "duplicates"),
    "interleaved": (table(trajectory=list("abab"), time=[0, 0, 0.1, 0.1]), None, errors.InterleavedTrajectoryError, "'a' comes back"),
    "mixed sampling refused": (
        table(trajectory=list("aaabbb"), time=[0, 0.1, 0.2, 0, 0.01, 0.02]), {"sampling": "raise"}, errors.SamplingError, "mixed"),
    # mappings
    "mapping file missing": (text(CSV), "none.toml", errors.LogNotFoundError, "mapping file"),
    "mapping of a wrong type": (text(CSV), 3, errors.MappingError, "int"),
    "unknown setting": (text(CSV), {"signals": Q, "skip": 2}, errors.MappingError, "unknown setting 'skip'"),
    "unknown setting of a signal": (text(CSV), {"q": {"colum": 1}}, errors.MappingError, "Did you mean 'column'"),
    "unknown unit": (text(CSV), {"P": {"unit": "baar"}}, errors.UnitError, "Unknown unit 'baar'"),
    "unit of another dimension": (text(CSV), {"P": {"unit": "mm"}}, errors.UnitError, "unit of length"),
    "gauge of a force": (text(CSV), {"F": {"column": "q", "gauge": True}}, errors.MappingError, "pressures only"),
    "unit against gauge": (text(CSV), {"P": {"unit": "barg", "gauge": False}}, errors.MappingError, "agree"),
    "sign of two": (text(CSV), {"q": {"sign": 2}}, errors.MappingError, "1 or -1"),
    "scale as text": (text(CSV), {"q": {"scale": "2"}}, errors.MappingError, "a finite number"),
    "ambient in bar": (text(CSV), {"signals": Q, "ambient_pressure": 1.013}, errors.UnitError, "in Pa"),
    "constant without number": (text(CSV), {"signals": Q, "constants": {"eps": "small"}}, errors.MappingError, "small"),
    "length without rest length": (
        text(CSV), {"time": "time", "eps": {"column": "q", "source": "length"}}, errors.MappingError, "rest_length"),
    "no such variable": (mat(run=RUN), {"signals": {"time": 0}, "trajectories": "Test*"}, errors.MappingError, "it has run"),
    "no zero run": (
        mat(run=RUN), {"signals": {"time": 0}, "zero_run": "Offset"}, errors.MissingColumnError, "zero_run|Offset"),
    "zero run unsaid": (
        text(CSV), {"time": "time", "q": {"subtract_zero_run": True}}, errors.MappingError, "zero run"),
    "name asks for what is not there": (text(CSV), {"signals": Q, "name": "{kp}"}, errors.MappingError, "kp"),
    "unknown policy": (text(CSV), {"nan": "ignore"}, errors.ParameterError, "nan is 'ignore'"),
}  # fmt: skip


def _renamed(folder: Path) -> Path:
    return table(time=T, q=T)(folder).rename(folder / "log.csv")


def _npz(folder: Path) -> Path:
    np.savez(folder / "log.npz", a=np.array([{}], dtype=object))
    return folder / "log.npz"


@pytest.mark.parametrize("case", CASES, ids=str)
def test_each_broken_log_has_its_own_error(case, tmp_path):
    make, mapping, expected, words = CASES[case]
    path = make(tmp_path)
    options = {}
    if isinstance(mapping, dict) and set(mapping) & {"nan", "sampling"}:
        options, mapping = mapping, None
    if isinstance(mapping, str):
        mapping = tmp_path / mapping
    with pytest.raises(expected, match=words) as caught:
        read_log(path, mapping, **options)
    error = caught.value
    assert type(error) is expected, "the error is no more general than it could be"
    assert error.found
    assert error.expected
    assert error.remedy
    assert str(error).startswith(error.found.rstrip())
    assert error.__suppress_context__ or error.__context__ is None, "no bare error of a library behind it"


@pytest.mark.parametrize("kind", ["csv", "json", "parquet", "mat", "h5"])
def test_no_damage_gives_a_bare_error(kind, tmp_path):
    """Bytes changed, removed or repeated anywhere lead to a PamidError or to a log, never to anything else."""
    rng = np.random.default_rng(0)
    whole = tmp_path / f"whole.{kind}"
    frame = pd.DataFrame({"time": np.arange(50) * 1e-3, "q": 0.1 * rng.standard_normal(50)})
    if kind == "csv":
        frame.to_csv(whole, index=False)
    elif kind == "json":
        whole.write_text(json.dumps({"entries": frame.to_dict("records")}))
    elif kind == "parquet":
        frame.to_parquet(whole)
    elif kind == "mat":
        scipy.io.savemat(whole, {"time": frame["time"].to_numpy(), "q": frame["q"].to_numpy()})
    else:
        with h5py.File(whole, "w") as f:
            f["time"], f["q"] = frame["time"], frame["q"]
    content = whole.read_bytes()
    assert len(read_log(whole)) == 50
    damaged = tmp_path / f"damaged.{kind}"
    refused = 0
    for _ in range(60):
        data = bytearray(content)
        for _ in range(rng.integers(1, 12)):
            data[rng.integers(len(data))] = rng.integers(256)
        if rng.random() < 0.3:
            data = data[: rng.integers(1, len(data))]
        damaged.write_bytes(bytes(data))
        try:
            read_log(damaged, sampling="ignore")
        except errors.PamidError:
            refused += 1
    assert refused > 20
