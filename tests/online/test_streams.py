"""A corpus of uneven, damaged and blind streams: `watch` finds the leak, or says why it cannot."""

from __future__ import annotations

import json
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[2]
if not (ROOT / "benchmarks").is_dir():
    pytest.skip("needs the repository", allow_module_level=True)
sys.path.append(str(ROOT))

from benchmarks.damaged_streams import BENCH, BLIND, SEEN, even, muscle, outcome, uneven  # noqa: E402
from pamid.cli import main  # noqa: E402
from pamid.online.lines import lines  # noqa: E402
from pamid.online.sight import Sight  # noqa: E402
from pamid.online.stream import Samples  # noqa: E402


def check(name: str, folder: Path) -> None:
    found, said = outcome(name, folder)
    assert found == ("told blind" if name in BLIND else "found"), said


@pytest.mark.slow
@pytest.mark.parametrize("name", [*SEEN, *BLIND])
def test_a_leak_is_found_or_said_why_not(name, tmp_path, monkeypatch):
    # The run that would confirm takes ten times as long as the watch; one is designed in test_online.py.
    monkeypatch.setattr("pamid.gap.design.confirm.confirming", lambda *args, **options: None)
    check(name, tmp_path)


def test_sight_says_which_unit_is_doubtful():
    t = np.arange(1000) * 1e-3
    table = {"time": t, "eps": 0.1 + 0 * t, "P": 3.0 + np.sin(t), "F": np.cos(t)}  # the pressure in bar
    assert Sight(["F", "mdot"], 1e-3).look(table) == "P reaches 3.84: that looks like bar; expected Pa, absolute."


def test_the_corpus_is_large():
    assert len(SEEN) + len(BLIND) >= 60


# --- files that change under the reader -------------------------------------------------------------------------------
def followed(file: Path, act: Callable[[], None]) -> list[bytes]:
    seen: list[bytes] = []

    def read() -> None:
        seen.extend(line for line in lines(file, follow=True, poll=0.01, patience=1.0) if line is not None)

    reader = threading.Thread(target=read)
    reader.start()
    time.sleep(0.1)
    act()
    reader.join(timeout=20)
    return seen


def test_a_replaced_file_is_told_by_its_identity(tmp_path):
    file, new = tmp_path / "s", tmp_path / "new"
    file.write_bytes(b"1\n2\n")

    def replace() -> None:
        new.write_bytes(b"3\n4\n5\n")  # no shorter than the old one
        new.replace(file)

    assert followed(file, replace) == [b"1", b"2", b"3", b"4", b"5"]


def test_a_deleted_file_is_waited_for(tmp_path):
    file = tmp_path / "s"
    file.write_bytes(b"1\n2")

    def delete() -> None:
        file.unlink()
        time.sleep(0.2)
        file.write_bytes(b"3\n")

    assert followed(file, delete) == [b"1", b"3"]


def test_a_file_that_is_cut_short_is_read_anew(tmp_path):
    file = tmp_path / "s"
    file.write_bytes(b"1\n2\n3\n")
    assert followed(file, lambda: file.write_bytes(b"9\n"))[-1] == b"9"


def test_silence_is_told_within_seconds(tmp_path, capsys):
    file = tmp_path / "s.jsonl"
    file.write_bytes(b"".join(json.dumps(r).encode() + b"\n" for r in muscle(even()[:500])))
    BENCH.to_toml(tmp_path / "sim.toml")
    assert main(["watch", str(file), "--sim", str(tmp_path / "sim.toml"), "--follow", "--patience", "2.6"]) == 2
    assert "blind because no sample has come for" in capsys.readouterr().out


def test_the_interval_is_that_of_the_stream():
    for rate in (50.0, 333.0, 1000.0, 1024.0):
        samples = Samples(("eps", "P"))
        for row in muscle(uneven(0.2, rate)[:200]):
            samples.take(json.dumps(row).encode())
        assert samples.interval == pytest.approx(1.0 / rate, rel=0.02)
