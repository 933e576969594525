"""Damaged files: no traceback, no answer that differs from that of the healthy file without a word, no file changed.

The corpus is that of ``benchmarks/damaged_files.py``; hypothesis adds what nobody thought of.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import shutil
import sys
import tempfile
import warnings
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

ROOT = Path(__file__).resolve().parents[2]
if not (ROOT / "benchmarks").is_dir():
    pytest.skip("needs the repository", allow_module_level=True)
sys.path.append(str(ROOT))

from benchmarks import damaged_foreign  # noqa: E402
from benchmarks.damaged_files import (  # noqa: E402
    CELLS,
    TEXTS,
    answer,
    damaged_logs,
    damaged_simulators,
    healthy_log,
    healthy_simulator,
    log_outcome,
    simulator_outcome,
)
from pamid.bench import BenchParameters  # noqa: E402
from pamid.cli import main  # noqa: E402
from pamid.errors import PamidError  # noqa: E402
from pamid.signals import read_log, write_log  # noqa: E402

HARMLESS = {
    "no end of line",
    "carriage returns",
    "old ends of line",
    "byte order mark",
    "semicolons",
    "semicolons and commas",
    "tabs",
    "bars",
    "quotes",
    "blanks behind delimiters",
    "delimiter behind each row",
    "blank lines",
    "comments above",
}
QUICK = 25  # one in so many goes through the command line
slow = pytest.mark.slow


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    return list(damaged_logs(tmp_path_factory.mktemp("logs")))


@pytest.fixture(scope="module")
def healthy(tmp_path_factory):
    return answer(write_log(healthy_log(), tmp_path_factory.mktemp("healthy") / "log.csv"), healthy_simulator())[0]


def fingerprints(folder: Path) -> dict[str, str]:
    return {p.name: hashlib.sha256(p.read_bytes()).hexdigest() for p in folder.iterdir() if p.is_file()}


def test_the_corpus_is_large_enough(logs, tmp_path):
    assert len(logs) >= 250
    assert len(list(damaged_simulators(tmp_path))) >= 60
    assert sum(MANY.values()) >= 5_000


@slow
def test_no_damaged_log_changes_an_answer_in_silence(logs, healthy):
    before = fingerprints(logs[0].path.parent)
    params = healthy_simulator()
    outcomes = {d.damage: log_outcome(d.path, params, healthy) for d in logs}
    assert not {damage: o.said for damage, o in outcomes.items() if o.kind == "silent"}
    assert {damage for damage in TEXTS if outcomes[damage].kind == "same"} >= HARMLESS, "other forms of a healthy log"
    assert fingerprints(logs[0].path.parent) == before


def test_no_damaged_simulator_is_taken_for_another(tmp_path):
    found = {d.damage: simulator_outcome(d.path) for d in damaged_simulators(tmp_path)}
    assert not {damage: o.said for damage, o in found.items() if o.kind == "silent"}
    assert found["byte order mark"].kind == found["carriage returns"].kind == "same"


def test_commands_refuse_or_answer(logs, tmp_path, capsys):
    healthy_simulator().to_toml(tmp_path / "bench.toml")
    for number, damaged in enumerate(logs[::QUICK]):
        before = fingerprints(damaged.path.parent)
        argv = ["evaluate", str(damaged.path), "--sim", str(tmp_path / "bench.toml"), "--json"]
        code = main(argv if number % 2 else ["check", str(damaged.path), "--json"])
        out, err = capsys.readouterr()
        assert code in (0, 2, 3), (damaged.damage, err)
        assert "Traceback" not in err
        assert "inside pamid" not in err
        assert (out == "") == (code == 2), damaged.damage
        if out:
            json.loads(out)
        assert fingerprints(damaged.path.parent) == before


# --- FMUs and MuJoCo files -------------------------------------------------------------------------------------
def taken(kind: str, number: int, seed: int, folder: Path) -> set[str]:
    """Return how damaged files were taken; anything but an answer or an error of three sentences fails."""
    if kind == "fmu":
        pytest.importorskip("fmpy")
        if not any(shutil.which(name) for name in ("cc", "gcc", "clang")):
            pytest.skip("needs a C compiler")
    pytest.importorskip("mujoco")
    found = damaged_foreign.outcomes(kind, number, folder, seed)
    assert found.pop("nothing") == "answered"
    assert {damage: said for damage, said in found.items() if said not in damaged_foreign.GOOD} == {}
    return set(found.values())


@pytest.mark.parametrize(("kind", "number"), [("mujoco", 8), ("fmu", 8)])
def test_a_damaged_foreign_simulator_answers_or_is_refused(kind: str, number: int, tmp_path: Path) -> None:
    assert taken(kind, number, 0, tmp_path) == {"answered", "refused"}


@pytest.mark.long
@pytest.mark.parametrize("kind", ["mujoco", "fmu"])
def test_many_damaged_foreign_simulators_answer_or_are_refused(kind: str, tmp_path: Path) -> None:
    assert taken(kind, 200, 1, tmp_path) == {"answered", "refused"}


def raising(argv: list[str]) -> int:
    raise ValueError(argv)


def saying_little(argv: list[str]) -> int:
    sys.stderr.write("pamid: error: no")
    return 2


def logging(argv: list[str]) -> int:
    Path("MUJOCO_LOG.TXT").touch()
    return 0


def unpacking(argv: list[str]) -> int:
    return len(tempfile.mkdtemp(prefix="pamid_")) * 0


@pytest.mark.parametrize(
    ("command", "said"),
    [(raising, "raised ValueError"), (saying_little, "no three sentences"), (logging, "left here/MUJOCO_LOG.TXT"),
     (unpacking, "left temporary/pamid_"), (lambda argv: 1, "inside pamid: 1")],
    ids=["raises", "says little", "logs", "unpacks", "other code"],
)  # fmt: skip
def test_what_is_wrong_is_not_called_good(command, said: str, tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr(damaged_foreign, "command", command)
    assert damaged_foreign.outcome("mujoco", b"", tmp_path).startswith(said)


# --- what nobody thought of -------------------------------------------------------------------------------------
ENDINGS = st.sampled_from([".csv", ".json", ".parquet", ".h5", ".mat", ".txt"])
MARKS = st.sampled_from(
    [b"", b"PAR1", b"\x89HDF\r\n\x1a\n", b"MATLAB 5.0 MAT-file".ljust(124) + b"\0\1IM", b"{", b"[", b"\xff\xfe"]
)
CELL = st.one_of(
    st.sampled_from(["0", "1", "2e5", "-1", "nan", "", "NA", "1e400", '"', "#", "x", "0,5", "true", "2024-01-01"]),
    st.floats(allow_nan=True).map(repr),
    st.text(max_size=4),
)
HEADER = st.lists(
    st.sampled_from(["time", "trajectory", "P", "q", "F1 [N]", "P [bar]", "x y", ""]), min_size=1, max_size=5
)
TABLE = st.tuples(HEADER, st.lists(st.lists(CELL, max_size=6), max_size=8), st.sampled_from([",", ";", "\t", " ", "|"]))
LINE = st.one_of(
    st.sampled_from(
        ["[muscle]", "[gas]", "[[effects]]", "[tolerance]", 'name = "leakage"', "rest_length = 0.2", "inertia = 1"]
    ),
    st.tuples(st.text(max_size=6), st.text(max_size=8)).map(" = ".join),
    st.text(max_size=12),
)
PLACE = st.floats(0.0, 0.999)
EDIT = st.one_of(
    st.tuples(st.sampled_from(["lose", "twice", "exchange", "blank", "cut off", "lose the fields", "comment"]), PLACE),
    st.tuples(st.sampled_from(["cell"]), PLACE, st.integers(0, 11), st.sampled_from(CELLS)),
    st.tuples(st.sampled_from(["field", "no field", "quote", "glue"]), PLACE, st.integers(0, 11)),
    st.tuples(
        st.sampled_from(["name"]), st.integers(0, 11), st.sampled_from(["", "x", "P1", "time", "F1 [lbf]", "q/°"])
    ),
    st.tuples(st.sampled_from(["all"]), st.sampled_from(list(TEXTS))),
)
"""What happens to a whole log: to one of its lines, to a cell of it, to a name in the header, or to every line."""
MANY = {"edits": 400, "bytes": 2_500, "tables": 2_000, "pages": 1_000}
"""Examples of the slow part."""
FUZZ = {
    "deadline": None,
    "derandomize": True,
    "suppress_health_check": [HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
}


def read_or_refuse(read, path: Path, content: bytes) -> None:
    path.write_bytes(content)
    with warnings.catch_warnings(), contextlib.suppress(PamidError):
        warnings.simplefilter("ignore")
        read(path)
    assert path.read_bytes() == content
    path.unlink()
    assert not list(path.parent.iterdir())


def keeping(path: Path):
    return read_log(path, nan="keep")


def any_bytes(mark: bytes, rest: bytes, ending: str, folder: Path) -> None:
    read_or_refuse(keeping, folder / f"log{ending}", mark + rest)


def any_table(table: tuple, folder: Path) -> None:
    header, rows, delimiter = table
    content = "\n".join(delimiter.join(row) for row in [header, *rows])
    read_or_refuse(keeping, folder / "log.csv", content.encode("utf-8", "replace"))


def any_page(lines: list[str], folder: Path) -> None:
    read_or_refuse(BenchParameters.from_toml, folder / "sim.toml", "\n".join(lines).encode("utf-8", "replace"))


def edited(text: str, edits: list[tuple]) -> str:
    """Return the text of a log after some edits."""
    for what, *where in edits:
        lines = text.split("\n")
        if what == "all":
            text = TEXTS[where[0]](text)
            continue
        if what == "name":
            names = lines[0].split(",")
            names[where[0] % len(names)] = where[1]
            text = "\n".join([",".join(names), *lines[1:]])
            continue
        at = 1 + int(where[0] * max(len(lines) - 2, 1)) if len(lines) > 1 else 0
        fields = lines[at].split(",")
        k = where[1] % len(fields) if len(where) > 1 else 0
        changed = {
            "lose": [],
            "twice": [lines[at], lines[at]],
            "exchange": [*lines[at + 1 : at + 2], lines[at]],
            "blank": ["", lines[at]],
            "cut off": [lines[at][: len(lines[at]) // 2]],
            "lose the fields": ["," * (len(fields) - 1)],
            "comment": [f"# {lines[at]}"],
            "cell": [",".join([*fields[:k], str(where[-1]), *fields[k + 1 :]])],
            "field": [",".join([*fields[:k], "7", *fields[k:]])],
            "no field": [",".join(fields[:k] + fields[k + 1 :])],
            "quote": [",".join([*fields[:k], f'"{fields[k]}', *fields[k + 1 :]])],
            "glue": [",".join(fields[:k]) + ",".join(fields[k:])],
        }[what]
        after = lines[at + 1 :] if what != "exchange" else lines[at + 2 :]
        text = "\n".join([*lines[:at], *changed, *([] if what == "cut off" else after)])
    return text


def any_edits(edits: list[tuple], healthy_text: str, short: dict[str, float], folder: Path) -> None:
    path = folder / "log.csv"
    content = edited(healthy_text, edits).encode("utf-8", "replace")
    path.write_bytes(content)
    outcome = log_outcome(path, healthy_simulator(), short)
    # A unit in a header is a word: what was read in it is no answer in silence.
    if ("name", 6, "F1 [lbf]") in edits:
        path.unlink()
        return
    assert outcome.kind != "silent", outcome.said
    assert path.read_bytes() == content
    path.unlink()
    assert not list(folder.iterdir())


@pytest.fixture(scope="module")
def short_log(tmp_path_factory):
    """A shorter log, since each example reads one anew: its text, and the answer."""
    log = healthy_log()
    log = log[log["trajectory"] == log["trajectory"].iloc[0]].head(300)
    path = write_log(log, tmp_path_factory.mktemp("short") / "log.csv")
    return path.read_text(), answer(path, healthy_simulator())[0]


@given(st.lists(EDIT, min_size=1, max_size=3))
@settings(max_examples=40, **FUZZ)
def test_some_edits_change_no_answer_in_silence(tmp_path, short_log, edits):
    any_edits(edits, *short_log, tmp_path)


@slow
@given(st.lists(EDIT, min_size=1, max_size=3))
@settings(max_examples=MANY["edits"], **FUZZ)
def test_many_edits_change_no_answer_in_silence(tmp_path, short_log, edits):
    any_edits(edits, *short_log, tmp_path)


@pytest.mark.long
@given(st.lists(EDIT, min_size=1, max_size=4))
@settings(max_examples=10_000, **FUZZ)
def test_very_many_edits_change_no_answer_in_silence(tmp_path, short_log, edits):
    any_edits(edits, *short_log, tmp_path)


@given(MARKS, st.binary(max_size=400), ENDINGS)
@settings(max_examples=100, **FUZZ)
def test_some_bytes(tmp_path, mark, rest, ending):
    any_bytes(mark, rest, ending, tmp_path)


@slow
@given(MARKS, st.binary(max_size=400), ENDINGS)
@settings(max_examples=MANY["bytes"], **FUZZ)
def test_many_bytes(tmp_path, mark, rest, ending):
    any_bytes(mark, rest, ending, tmp_path)


@given(TABLE)
@settings(max_examples=100, **FUZZ)
def test_some_tables(tmp_path, table):
    any_table(table, tmp_path)


@slow
@given(TABLE)
@settings(max_examples=MANY["tables"], **FUZZ)
def test_many_tables(tmp_path, table):
    any_table(table, tmp_path)


@slow
@given(st.lists(LINE, max_size=12))
@settings(max_examples=MANY["pages"], **FUZZ)
def test_many_pages(tmp_path, lines):
    any_page(lines, tmp_path)
