"""Child processes: starting a module of pamid in one, and ending it with all that it has started."""

from __future__ import annotations

import contextlib
import os
import secrets
import signal
import subprocess
import sys
import weakref
from pathlib import Path
from typing import Any

_ROOT = Path(__file__).resolve().parents[2]
_ENDED: weakref.WeakSet[subprocess.Popen[bytes]] = weakref.WeakSet()
MARK = "PAMID_WORKER"
"""The environment variable by which what a worker has started is known, even when its parent has ended."""
_ROUNDS = 100
_MARKS: weakref.WeakKeyDictionary[subprocess.Popen[bytes], str] = weakref.WeakKeyDictionary()


def started(module: str, *said: str, **streams: Any) -> subprocess.Popen[bytes]:
    """Start a module of pamid as the leader of a new process group."""
    given = [str(Path(p).resolve()) for p in os.environ.get("PYTHONPATH", "").split(os.pathsep) if p]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([*given, str(_ROOT)]), "PYTHONSAFEPATH": "1"}
    environment |= {**streams.pop("env", {}), MARK: (mark := secrets.token_hex(16))}
    command = [sys.executable, "-m", module, *said]
    process = subprocess.Popen(command, env=environment, start_new_session=os.name == "posix", **streams)
    _MARKS[process] = mark
    return process


def ended(process: subprocess.Popen[bytes]) -> None:
    """End a process and its children, and close its pipes."""
    if process in _ENDED:  # its number may have been reused
        return
    killed(process)
    _ENDED.add(process)
    with contextlib.suppress(OSError, subprocess.TimeoutExpired):
        process.kill()
        process.wait(timeout=5)
    for stream in (process.stdin, process.stdout, process.stderr):
        if stream is not None:
            with contextlib.suppress(OSError):
                stream.close()


def killed(process: subprocess.Popen[bytes]) -> None:
    """Kill a process and its children; its pipes stay open for who reads them."""
    kill_marked(_MARKS.get(process, ""))
    with contextlib.suppress(OSError):
        if os.name == "posix":
            os.killpg(process.pid, signal.SIGKILL)
        else:
            process.kill()


def kill_marked(mark: str) -> None:
    """Kill what a worker has started, in other sessions, too, but not this process; Linux only."""
    stopped: set[int] = set()
    for _ in range(_ROUNDS):
        if not (new := _marked(mark) - stopped - {os.getpid()}):
            break
        for pid in new:  # what is stopped starts nothing more
            with contextlib.suppress(OSError):
                os.kill(pid, signal.SIGSTOP)
        stopped |= new
    for pid in stopped:
        with contextlib.suppress(OSError):
            os.kill(pid, signal.SIGKILL)


def _marked(mark: str) -> set[int]:
    """Return the processes with a mark in their environment, and their descendants; none where ``/proc`` is not."""
    found: set[int] = set()
    parents: dict[int, int] = {}
    for entry in Path("/proc").glob("[0-9]*") if mark else ():
        with contextlib.suppress(OSError, IndexError, ValueError):
            parents[int(entry.name)] = int((entry / "stat").read_bytes().rpartition(b")")[2].split()[1])
            if f"{MARK}={mark}".encode() in (entry / "environ").read_bytes().split(b"\0"):
                found.add(int(entry.name))
    while more := {pid for pid, parent in parents.items() if parent in found} - found:
        found |= more
    return found
