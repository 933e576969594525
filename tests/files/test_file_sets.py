"""Sets of files are written whole or not at all, even while others write or read them."""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest
from support.killing import forked

from pamid.errors import OutputError
from pamid.file_sets import UNFINISHED, replacing_together
from pamid.files import write_whole

pytestmark = pytest.mark.skipif(not hasattr(os, "fork"), reason="needs a system with fork")


# --- sets of files --------------------------------------------------------------------------------------------------
def test_two_writers_at_once_leave_the_whole_of_one(tmp_path):
    for others in (False, True):  # exchanged as a whole, and file by file
        out = tmp_path / f"out-{others}"
        (out / "photos" if others else out).mkdir(parents=True)

        def write(which: str, out: Path = out) -> int:
            for _ in range(40):
                with replacing_together(out, "abcdef") as stage:
                    for name in "abcdef":
                        write_whole(stage / name, which * 1000)
            return 0

        def both() -> int:
            other = os.fork()
            code = write("1" if other == 0 else "2")
            if other == 0:
                os._exit(code)
            return code or os.waitstatus_to_exitcode(os.waitpid(other, 0)[1])

        assert forked(both) == 0
        assert len({(out / name).read_text() for name in "abcdef"}) == 1
        assert len(list(out.iterdir())) == 6 + others


def test_what_others_put_into_a_folder_meanwhile_stays(tmp_path):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "theirs").write_text("before")
    with replacing_together(tmp_path / "out", ["a", "b"]) as stage:
        (stage / "a").write_text("new")
        (tmp_path / "out" / "late").write_text("late")
    assert {f.name: f.read_text() for f in (tmp_path / "out").iterdir()} == {
        "a": "new",
        "theirs": "before",
        "late": "late",
    }


def test_the_working_folder_stays_the_same_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a").write_text("old")
    number = tmp_path.stat().st_ino
    with replacing_together(".", ["a", "b"]) as stage:
        (stage / "b").write_text("new")
    assert tmp_path.stat().st_ino == number
    assert [f.name for f in tmp_path.iterdir()] == ["b"]


def test_a_record_of_other_files_is_no_order_to_move_or_remove_them(tmp_path):
    (tmp_path / "photos").mkdir()
    (tmp_path / "thesis").write_text("mine")
    for record in ({"from": ".pamid-000000000000.tmp", "move": [], "remove": ["thesis"]}, {"from": "photos"}, []):
        (tmp_path / UNFINISHED).write_text(json.dumps(record))
        with pytest.raises(OutputError, match="other files"), replacing_together(tmp_path, ["a"]) as stage:
            (stage / "a").write_text("new")
    assert (tmp_path / "thesis").read_text() == "mine"
    assert not (tmp_path / "a").exists()


def test_a_body_that_fails_changes_nothing(tmp_path):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "a").write_text("old")
    with pytest.raises(ZeroDivisionError), replacing_together(tmp_path / "out", ["a"]) as stage:
        (stage / "a").write_text("new")
        _ = 1 / 0
    assert (tmp_path / "out" / "a").read_text() == "old"
    assert [f.name for f in tmp_path.iterdir()] == ["out"]


def test_a_file_keeps_its_mode_and_a_link_its_place(tmp_path):
    (tmp_path / "real").write_text("old")
    (tmp_path / "real").chmod(0o640)
    (tmp_path / "link").symlink_to("real")
    write_whole(tmp_path / "link", "new")
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "real").read_text() == "new"
    assert (tmp_path / "real").stat().st_mode & 0o777 == 0o640
