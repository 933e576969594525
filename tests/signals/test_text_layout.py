"""Text tables: comments, delimiters and the number of fields in a row."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pamid import errors
from pamid.signals import read_log

ROWS = "".join(f"{k / 1000},{10 + k},2e5\n" for k in range(4))
POSITIONS = {"signals": {"time": 1, "P": 2}, "trajectory": 0}


def read(folder: Path, content: str, mapping=None, **options):
    file = folder / "log.csv"
    file.write_text(content, encoding="utf-8")
    return read_log(file, mapping, **options)


@pytest.mark.parametrize(
    ("content", "expected", "words"),
    [
        ("time,F,P\n" + ROWS.replace("\n", ",293\n"), errors.LogFormatError, "line 2 has 4 fields .* names 3; 4 of 4"),
        ("time,F,P\n" + ROWS.replace("0.001,11,", "0.001,"), errors.LogFormatError, "line 3 has 2 fields .* names 3"),
        ("# by hand\n\ntime,F,P\n" + ROWS + "# end\n" + ROWS, errors.LogFormatError, "line 8 has 1 field where"),
        ("time,F,P\n" + ROWS + "0.004,", errors.TruncatedLogError, "2 of 3 fields: '0.004,'"),
        ('time,F,P\n"0",10,2e5\n' + ROWS[10:] + "1,2\n3,4,5\n", errors.LogFormatError, "line 7 has 2 fields"),
        ("0.0 1 2\n0.1 1 2\n0.2 1 2 3\n", errors.LogFormatError, "line 3 has 4 fields where most rows have 3"),
        ('time,F,P\n"0,10,2e5\n' + ROWS, errors.LogFormatError, "log.csv"),
    ],
)
def test_every_row_has_its_fields(content, expected, words, tmp_path):
    with pytest.raises(expected, match=words):
        read(tmp_path, content)


def test_a_long_log_is_counted_in_blocks(tmp_path, monkeypatch):
    monkeypatch.setattr("pamid.signals.formats._fields._CHUNK", 64)
    log = read(tmp_path, "time,P\r\n" + "".join(f"{k / 100},2e5\r\n" for k in range(500)))
    assert len(log) == 500
    lines = ["time,P", *(f"{k / 100},2e5" for k in range(500))]
    lines[321] += ",1"
    with pytest.raises(errors.LogFormatError, match="line 322 has 3 fields"):
        read(tmp_path, "\n".join(lines))


@pytest.mark.parametrize("end", ["", ","])
def test_a_delimiter_behind_the_last_field_is_no_column(end, tmp_path):
    log = read(tmp_path, f"time,F,P{end}\n" + ROWS.replace("\n", ",\n"))
    assert list(log.columns) == ["trajectory", "time", "F", "P"]
    np.testing.assert_array_equal(log["F"], [10, 11, 12, 13])


def test_an_empty_last_column_stays(tmp_path):
    log = read(tmp_path, "time,F,P\n" + ROWS.replace("2e5\n", "\n"), nan="keep")
    assert log["P"].isna().all()


def test_comments_stand_above_the_header_only(tmp_path):
    assert len(read(tmp_path, '# 5" hose\n#\n\ntime,F,P\n' + ROWS)) == 4
    names = "".join(f"#{k},0.1,2e5\n#{k},0.11,2e5\n" for k in (1, 2))
    assert read(tmp_path, "run,time,P\n" + names, {**POSITIONS, "trajectory": "run"})["trajectory"].nunique() == 2
    assert read(tmp_path, names, POSITIONS)["trajectory"].unique().tolist() == ["#1", "#2"]
    mixed = names + names.replace("#", "")
    assert read(tmp_path, mixed, POSITIONS)["trajectory"].unique().tolist() == ["#1", "#2", "1", "2"]


def test_an_unfinished_or_strange_delimiter_is_refused(tmp_path):
    with pytest.raises(errors.PamidError, match="delimiter"):
        read(tmp_path, "time,F,P\n" + ROWS, {"delimiter": "::", "signals": {"time": 0}})


def test_a_long_field_gives_a_short_message(tmp_path):
    for long in ("x" * 100_000, "x" * 3_000_000, "9" * 5_000):
        with pytest.raises(errors.PamidError) as caught:
            read(tmp_path, f"time,F,P\n{ROWS}0.01,{long},2e5\n0.02,1,2e5\n")
        assert len(str(caught.value)) < 1_000
    with pytest.raises(errors.PamidError) as caught:
        read(tmp_path, f"time,{'F' * 3_000_000},P\n{ROWS}", {"time": "t", "P": "P"})
    assert len(str(caught.value)) < 10_000


def test_a_field_that_is_too_long_is_named_among_the_first_lines_too(tmp_path):
    with pytest.raises(errors.LogFormatError, match="line 6 holds 3,000,000 characters without a delimiter"):
        read(tmp_path, f"time,F,P\n{ROWS}{'x' * 3_000_000},1,2e5\n")
