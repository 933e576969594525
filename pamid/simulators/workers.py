"""Child processes: starting a module of pamid in one, and ending it with all that it has started."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import weakref
from pathlib import Path
from typing import Any

_ROOT = Path(__file__).resolve().parents[2]
_ENDED: weakref.WeakSet[subprocess.Popen[bytes]] = weakref.WeakSet()


def started(module: str, *said: str, **streams: Any) -> subprocess.Popen[bytes]:
    """Start a module of pamid as the leader of a new process group."""
    given = [str(Path(p).resolve()) for p in os.environ.get("PYTHONPATH", "").split(os.pathsep) if p]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([*given, str(_ROOT)]), "PYTHONSAFEPATH": "1"}
    environment |= streams.pop("env", {})
    command = [sys.executable, "-m", module, *said]
    return subprocess.Popen(command, env=environment, start_new_session=os.name == "posix", **streams)


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
    with contextlib.suppress(OSError):
        if os.name == "posix":
            os.killpg(process.pid, signal.SIGKILL)
        else:
            process.kill()
