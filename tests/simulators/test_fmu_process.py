"""The process of an FMU: it may stammer, fork or be left alone, and nothing of it stays."""

from __future__ import annotations

import contextlib
import io
import os
import shutil
import signal
import subprocess
import sys
import time
import zipfile
from pathlib import Path

import numpy as np
import pytest

from pamid.cli import main
from pamid.errors import ForeignSimulatorError, SimulatorRunError
from pamid.export.ode_fmu import ode_fmu
from pamid.simulators import FmuSimulator, fmu_model, workers

pytestmark = pytest.mark.skipif(os.name != "posix", reason="groups of processes")
PARENT = """
import sys
import numpy as np
from pamid.export.ode_fmu import ode_fmu
from pamid.simulators import FmuSimulator
fmu = ode_fmu("a", lambda t, x, u, p: [u.go], {"y": 0.0}, {"go": 0.0}, {}, lambda t, x, u, p: {"z": x.y})
open(sys.argv[1], "wb").write(fmu)
sim = FmuSimulator(sys.argv[1], trust=True)
sim.run(np.arange(0, 1, 0.1), np.zeros((1, 10)), np.zeros(0), np.zeros(0))
print(*[w._process.pid for w in sim._workers if w._process], flush=True)
sys.stdin.read()
"""


def gone(pid: int) -> bool:
    """Wait until a process is no more, or a zombie that nobody has asked after."""
    for _ in range(200):
        try:
            state = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
        except (OSError, IndexError):
            return True
        if state == "Z":
            return True
        time.sleep(0.05)
    return False


@pytest.mark.parametrize(
    "said", [b"x", b"\x10" + bytes(7) + b"\x10" + bytes(7) + b"{", b"\xff" * 16], ids=["byte", "begin", "endless"]
)
def test_a_byte_and_then_silence_is_a_hang(said: bytes, tmp_path: Path, monkeypatch) -> None:
    code = f"import sys, time; sys.stdout.buffer.write({said!r}); sys.stdout.flush(); time.sleep(99)"
    pipe = subprocess.PIPE
    process = subprocess.Popen([sys.executable, "-c", code], stdin=pipe, stdout=pipe)
    monkeypatch.setattr(fmu_model, "_LOADING", 0.0)
    worker = fmu_model._Worker(tmp_path / "a.fmu", 1.0)
    monkeypatch.setattr(worker, "_started", lambda: process)
    worker._process = process
    with pytest.raises(ForeignSimulatorError, match="did not answer within 1 s"):
        worker.asked({"do": "run"}, {})
    assert process.poll() is not None


def test_what_a_process_has_forked_ends_with_it() -> None:
    code = "import os, time; pid = os.fork(); print(pid, flush=True) if pid else None; time.sleep(99)"
    process = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, start_new_session=True)
    assert process.stdout is not None
    child = int(process.stdout.readline())
    workers.ended(process)
    assert gone(child) and process.poll() is not None


def test_an_fmu_leaves_nothing_where_its_caller_is_killed(tmp_path: Path) -> None:
    pytest.importorskip("fmpy")
    (tmp_path / "t").mkdir()
    environment = {**os.environ, "TMPDIR": str(tmp_path / "t")}
    command = [sys.executable, "-c", PARENT, str(tmp_path / "a.fmu")]
    caller = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=environment)
    assert caller.stdout is not None
    pids = [int(word) for word in caller.stdout.readline().split()]
    assert pids and any((tmp_path / "t").glob("pamid_fmu_*"))
    caller.send_signal(signal.SIGKILL)
    caller.wait()
    assert all(gone(pid) for pid in pids)
    assert not any((tmp_path / "t").iterdir())


def test_a_worker_imports_nothing_from_the_folder_of_the_user(tmp_path: Path) -> None:
    (tmp_path / "json.py").write_text("raise SystemExit('a file of the folder was run')")
    process = workers.started("pamid.simulators.fmu_worker", "none.fmu", str(2**32), str(tmp_path / "made"),
                              cwd=tmp_path, stdin=subprocess.DEVNULL, stderr=subprocess.PIPE)  # fmt: skip
    assert b"was run" not in process.communicate()[1]


def foreign(folder: Path, inside: str) -> Path:
    """Return an FMU whose steps do something else after 0.25 s."""
    pytest.importorskip("fmpy")
    compiler = shutil.which("cc") or shutil.which("gcc")
    if compiler is None:
        pytest.skip("needs a C compiler")
    made = ode_fmu("a", lambda t, x, u, p: [u.go], {"y": 0.0}, {"go": 0.0}, {}, lambda t, x, u, p: {"z": x.y})
    with zipfile.ZipFile(io.BytesIO(made)) as whole:
        parts = {name: whole.read(name) for name in whole.namelist()}
    begin = b"int no_set_back)\n{"
    [source], [library] = ([n for n in parts if n.startswith(f)] for f in ("sources/", "binaries/"))
    assert parts[source].count(begin) == 1
    code = parts[source].replace(begin, begin + f" if (now > 0.25) {{ {inside} }} ".encode())
    (folder / "a.c").write_bytes(b"#include <stdio.h>\n#include <stdlib.h>\n#include <unistd.h>\n" + code)
    subprocess.run([compiler, "-shared", "-fPIC", "-o", "a.so", "a.c", "-lm"], cwd=folder, check=True)
    with zipfile.ZipFile(folder / "a.fmu", "w") as whole:
        for name, data in parts.items():
            whole.writestr(name, (folder / "a.so").read_bytes() if name == library else data)
    return folder / "a.fmu"


@pytest.mark.parametrize(
    ("inside", "error"),
    [("return 2;", "status Discard"), ("return 3;", "status Error"), ("return -1;", "status -1"),
     ("((Instance *)instance)->v[1] = 0.0 / 0.0; return 0;", "z at 0.4 s is nan"),
     ("__builtin_trap();", "exit code -")],
    ids=["discards", "fails", "no status", "no number", "dies"],
)  # fmt: skip
def test_a_step_that_fails_is_told_with_its_time_or_exit(inside: str, error: str, tmp_path: Path) -> None:
    """What an FMU returns is no number of a comparison then."""
    simulator = FmuSimulator(foreign(tmp_path, inside), trust=True)
    with pytest.raises((SimulatorRunError, ForeignSimulatorError), match=error):
        simulator.run(np.arange(0, 1, 0.1), np.ones((1, 10)), np.zeros(0), np.zeros(0))


PAGE = """kind = "fmu"
[fmu]
fmu = "a.fmu"
seconds = {}
[ports]
go = {{ kind = "input" }}
z = {{ kind = "output" }}
"""


def endless(folder: Path, seconds: float) -> list[str]:
    """Return the arguments of an evaluation whose FMU never ends a step."""
    foreign(folder, 'fclose(fopen("begun", "w")); for (;;) ;')
    (folder / "sim.toml").write_text(PAGE.format(seconds))
    rows = (f"{0.01 * k:.2f},{np.sin(0.1 * k)},{np.sin(0.1 * k + 0.1)}" for k in range(100))
    (folder / "log.csv").write_text("\n".join(["time,go,z", *rows]))
    return ["evaluate", str(folder / "log.csv"), "--sim", str(folder / "sim.toml"), "--trust", "--quiet"]


def test_a_step_that_never_ends_is_waited_for_once(tmp_path: Path, monkeypatch, capsys) -> None:
    """Whether the simulator repeats its answer is asked first, and its error is the error of the command."""
    begun = []
    monkeypatch.setattr(fmu_model, "started", lambda *a, **k: begun.append(a) or workers.started(*a, **k))
    assert main(endless(tmp_path, 1.0)) == 2
    assert "did not answer within 1 s" in capsys.readouterr().err
    assert len(begun) == 1


def test_a_command_that_is_ended_ends_a_step_that_never_ends(tmp_path: Path) -> None:
    (tmp_path / "t").mkdir()
    environment = {**os.environ, "TMPDIR": str(tmp_path / "t")}
    command = [sys.executable, "-m", "pamid", *endless(tmp_path, 60.0)]
    caller = subprocess.Popen(command, env=environment, stderr=subprocess.PIPE, cwd=tmp_path)
    try:
        for _ in range(600):
            if begun := list((tmp_path / "t").glob("pamid_fmu_*/**/begun")):
                break
            time.sleep(0.05)
        assert begun
        caller.send_signal(signal.SIGTERM)
        assert b"interrupted" in caller.communicate(timeout=15)[1]
        assert not any((tmp_path / "t").iterdir())
    finally:
        caller.kill()


STARTS = """static int n;
if (!n++ && !fork()) {{
  setsid();
  if (!fork()) {{
    setsid();
    FILE *f = fopen("{0}.part", "w"); fprintf(f, "%d", getpid()); fclose(f); rename("{0}.part", "{0}");
    {1}
    for (;;) sleep(1);
  }}
  _exit(0);
}}
while (access("{0}", 0)) usleep(1000);
"""
"""Starts an orphan in a session of its own, and waits until it has told its number."""


@pytest.mark.skipif(not Path("/proc/self/environ").exists(), reason="lists of processes")
@pytest.mark.parametrize("end", ["is told to end", "has no caller", "dies"])
def test_what_an_fmu_has_started_in_another_session_ends_with_it(end: str, tmp_path: Path) -> None:
    other = 'char *none[] = {0}; execle("/bin/sleep", "sleep", "99", (char *)0, none);' if end != "dies" else ""
    inside = STARTS.format(tmp_path / "pid", other) + ("__builtin_trap();" if end == "dies" else "")
    simulator = FmuSimulator(foreign(tmp_path, inside), trust=True)
    with pytest.raises(ForeignSimulatorError) if end == "dies" else contextlib.nullcontext():
        simulator.run(np.arange(0, 1, 0.1), np.ones((1, 10)), np.zeros(0), np.zeros(0))
    child, process = int((tmp_path / "pid").read_text()), simulator._workers[0]._process
    try:
        if process is not None:
            assert process.stdin is not None and Path(f"/proc/{child}/stat").exists()
            workers.ended(process) if end == "is told to end" else process.stdin.close()
        assert gone(child)
    finally:
        with contextlib.suppress(OSError):
            os.kill(child, signal.SIGKILL)


def test_states_begin_at_the_start_values_of_the_description(tmp_path: Path) -> None:
    """Where no column reads them: a tank that `next` fills from 0 leaves the range of its log."""
    pytest.importorskip("fmpy")
    rates = ode_fmu("tank", lambda t, x, u, p: [u.q - x.h], {"h": 0.5}, {"q": 0.0}, {}, lambda t, x, u, p: {"y": x.h})
    (tmp_path / "tank.fmu").write_bytes(rates)
    assert [(p.name, p.start) for p in FmuSimulator(tmp_path / "tank.fmu").own_states()] == [("h", 0.5)]
