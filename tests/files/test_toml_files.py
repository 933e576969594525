"""Simulator and mapping files that are no page of text; outputs that nobody can read."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

import pandas as pd
import pytest

from pamid.bench import BenchParameters, simulate, sine
from pamid.cli import main
from pamid.errors import PamidError
from pamid.signals import LogMapping, read_log, write_log
from pamid.survey.survey import survey
from pamid.systems import read_system

READERS = [BenchParameters.from_toml, LogMapping.load, read_system]


@pytest.fixture
def sim(tmp_path) -> Path:
    BenchParameters.for_muscle("B").to_toml(tmp_path / "bench.toml")
    return tmp_path / "bench.toml"


def test_a_byte_order_mark_is_no_damage(sim):
    sim.write_bytes(b"\xef\xbb\xbf" + sim.read_bytes().replace(b"\n", b"\r\n"))
    assert BenchParameters.from_toml(sim) == BenchParameters.for_muscle("B")


@pytest.mark.parametrize("read", READERS)
@pytest.mark.parametrize(
    "content",
    [
        ".".join(["a"] * 5_000) + " = 1\n",
        "\n".join("[" + ".".join(["a"] * 900) + f".b{k}]" for k in range(200)),
        "a = {" + " . ".join(['"b"'] * 5_000) + " = 1}\n",
        "a = " + "9" * 5_000,
        "a = " + "[" * 100_000,
        "a" * 900_000,
        'a = "\ud800"'.encode("utf-8", "surrogatepass"),
        b"\x00" * 1000,
        b" " * 1_100_000,
    ],
)
def test_strange_pages_are_refused_at_once(read, content, tmp_path):
    file = tmp_path / "page.toml"
    file.write_bytes(content if isinstance(content, bytes) else content.encode())
    began = time.perf_counter()
    with pytest.raises(PamidError) as caught:
        read(file)
    assert time.perf_counter() - began < 5.0
    assert len(str(caught.value)) < 5_000


@pytest.mark.parametrize("read", [*READERS, read_log])
def test_a_pipe_is_refused_and_not_waited_for(read, tmp_path):
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(PamidError, match="not a regular file"):
        read(tmp_path / "pipe")


def test_numbers_are_no_keys(sim):
    text = sim.read_text() + "\n# 1.0, 2.0, " + ", ".join(f"{k}.5" for k in range(100)) + "\n"
    sim.write_text(text)
    assert BenchParameters.from_toml(sim) == BenchParameters.for_muscle("B")


@pytest.mark.parametrize(
    ("redirection", "code", "words"),
    [
        (">/dev/full", 2, "cannot be written"),
        (">&-", 0, ""),
        ("2>/dev/full", 0, ""),
        ("2>&-", 0, ""),
        ("| true", 0, ""),
    ],
)
def test_outputs_that_nobody_can_read(redirection, code, words, sim, tmp_path):
    if not Path("/dev/full").exists():
        pytest.skip("needs /dev/full")
    bench = BenchParameters.for_muscle("B")
    log = write_log(simulate(bench, [sine(4, 10, 200)]), tmp_path / "log.parquet")
    command = f"{sys.executable} -c 'from pamid.cli import main; raise SystemExit(main())' evaluate {log} --sim {sim}"
    shell = ["bash", "-c", f"set -o pipefail; {command} {redirection}"]
    done = subprocess.run(shell, capture_output=True, text=True, timeout=120)
    assert (done.returncode, "inside pamid" in done.stderr, "Traceback" in done.stderr) == (code, False, False)
    assert words in done.stderr


def test_a_pause_in_a_run_is_told_and_not_refused(tmp_path, capsys):
    bench = BenchParameters.for_muscle("B")
    log = simulate(bench, [sine(8, 10, 1000)])
    paused = log.assign(time=log["time"].where(log.index < 500, log["time"] + 60.0))
    file = write_log(paused, tmp_path / "log.parquet")
    assert main(["check", str(file), "--quiet"]) == 0
    assert "1 gap(s) in time, the longest of 60 s" in capsys.readouterr().out
    halves = log.assign(trajectory=pd.Series(["a", "b"]).repeat(500).to_numpy())
    assert survey(paused).coverage.bandwidth == pytest.approx(survey(halves).coverage.bandwidth, rel=0.2)
