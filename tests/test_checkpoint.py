"""Work that is killed goes on where it was, to the same result; no half-written file is read as whole."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from unittest import mock

import pytest

from pamid.checkpoint import Checkpoint
from pamid.errors import CheckpointError, OutputError

WORK = """
import sys, time
from pathlib import Path
from pamid.checkpoint import Checkpoint

file, log = Path(sys.argv[1]), Path(sys.argv[2])
kept = Checkpoint(file, {"seed": 1})

def compute(k):
    with log.open("a") as out:
        out.write(f"{k}\\n")
    time.sleep(0.02)
    return [k, k * 0.1, "x" * 2000]

print(sum(kept.step(str(k), lambda k=k: compute(k))[1] for k in range(30)))
"""


def test_work_that_is_killed_goes_on_to_the_same_result(tmp_path):
    file, log = tmp_path / "work.json", tmp_path / "log"
    command = [sys.executable, "-c", WORK, str(file), str(log)]
    kills = 0
    for wanted in (2, 9, 17):
        with subprocess.Popen(command, stdout=subprocess.PIPE) as process:
            for _ in range(3000):
                if log.exists() and len(log.read_text().split()) > wanted:
                    break
                time.sleep(0.01)
            process.send_signal(signal.SIGKILL)
            kills += process.wait() == -signal.SIGKILL
        assert len(json.loads(file.read_text())["results"]) > wanted - 1 - kills, (
            "what was finished is whole and on disk"
        )
    assert kills == 3
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert float(done.stdout) == sum(k * 0.1 for k in range(30))
    computed = log.read_text().split()
    assert sorted(set(map(int, computed))) == list(range(30))
    assert len(computed) <= 30 + kills, "no more than the step that was cut short is done twice"


def test_a_damaged_or_foreign_checkpoint_is_refused(tmp_path):
    file = tmp_path / "work.json"
    Checkpoint(file, {"seed": 1}).step("a", lambda: 1)
    with pytest.raises(CheckpointError, match="another run"):
        Checkpoint(file, {"seed": 2})
    file.write_text(file.read_text()[:-5])
    with pytest.raises(CheckpointError, match="no checkpoint"):
        Checkpoint(file, {"seed": 1})


def test_a_full_disk_keeps_the_last_whole_checkpoint(tmp_path):
    file = tmp_path / "work.json"
    kept = Checkpoint(file)
    kept.step("a", lambda: 1)
    with mock.patch("os.fsync", side_effect=OSError(28, "No space left on device")), pytest.raises(OutputError):
        kept.step("b", lambda: 2)
    assert Checkpoint(file).results == {"a": 1}
    assert [p.name for p in tmp_path.iterdir()] == ["work.json"]
