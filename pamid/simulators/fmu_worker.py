"""The process that runs an FMU: it reads requests from stdin and answers on stdout; a crash stays in it."""

from __future__ import annotations

import contextlib
import ctypes
import io
import json
import os
import shutil
import signal
import struct
import sys
import threading
import time
import zipfile
from pathlib import Path
from typing import IO, Any

import numpy as np

from .workers import MARK, kill_marked

MOST_UNPACKED = 500_000_000
"""Most bytes that an FMU may unpack to."""
_SUBREAPER = 36  # PR_SET_CHILD_SUBREAPER of prctl


def send(stream: IO[bytes], said: dict[str, Any], arrays: dict[str, np.ndarray] | None = None) -> None:
    """Write a message: numbers and texts as JSON, arrays as npz without pickle."""
    packed = io.BytesIO()
    named: dict[str, Any] = dict(arrays or {})
    np.savez(packed, **named)
    head, body = json.dumps(said).encode(), packed.getvalue()
    stream.write(struct.pack("<QQ", len(head), len(body)) + head + body)
    stream.flush()


def receive(stream: IO[bytes]) -> tuple[dict[str, Any], dict[str, np.ndarray]] | None:
    """Read a message; None where the other side has closed."""
    lengths = stream.read(16)
    if len(lengths) < 16:
        return None
    n, m = struct.unpack("<QQ", lengths)
    head, body = stream.read(n), stream.read(m)
    if len(head) < n or len(body) < m:
        return None
    with np.load(io.BytesIO(body), allow_pickle=False) as found:
        return json.loads(head), {k: found[k] for k in found.files}


def is_whole(heard: bytes | bytearray) -> bool:
    """Return whether a message is complete."""
    return len(heard) >= 16 and len(heard) >= 16 + sum(struct.unpack_from("<QQ", heard))


def described(path: str) -> dict[str, Any]:
    """Return the variables of ``modelDescription.xml``; no code of the FMU runs."""
    import fmpy

    with zipfile.ZipFile(path) as archive:
        if (size := sum(i.file_size for i in archive.infolist())) > MOST_UNPACKED:
            raise ValueError(f"it unpacks to {size:,} bytes; at most {MOST_UNPACKED:,} are read")
    d = fmpy.read_model_description(path, validate=False)
    states = {v.derivative.name for v in d.modelVariables if v.derivative is not None}
    variables = [
        {
            "name": v.name,
            "causality": v.causality or "local",
            "variability": v.variability or "",
            "unit": v.unit or (v.declaredType.unit if v.declaredType is not None else "") or "-",
            "start": str(v.start or ""),
            "type": v.type,
            "state": v.name in states and v.initial in ("exact", "approx"),
        }
        for v in d.modelVariables
    ]
    kinds = [k for k, given in (("CoSimulation", d.coSimulation), ("ModelExchange", d.modelExchange)) if given]
    return {"name": d.modelName, "version": d.fmiVersion, "kinds": kinds, "variables": variables}


def _run(folder: str, kind: str, said: dict[str, Any], given: dict[str, np.ndarray]) -> np.ndarray:
    import fmpy

    t = given["t"]
    names = said["inputs"]
    table = np.zeros(len(t), dtype=[("time", float), *((n, float) for n in names)])
    table["time"] = t - t[0]
    for name, row in zip(names, given["u"], strict=True):
        table[name] = row
    dt = float(np.median(np.diff(t)))
    found = fmpy.simulate_fmu(
        folder,
        validate=False,
        start_time=0.0,
        stop_time=float(t[-1] - t[0]),
        output_interval=dt,
        step_size=dt if kind == "CoSimulation" else None,
        fmi_type=kind,
        start_values=said["start"],
        input=table if names else None,
        output=said["outputs"],
    )
    return np.stack([np.interp(t - t[0], found["time"], found[n].astype(float)) for n in said["outputs"]])


def limited(memory: int, seconds: int | None = None) -> None:
    """Limit the memory and processor time of this process, where the system can."""
    try:
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (memory, memory))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        if seconds is not None:
            resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds))
    except (ImportError, ValueError, OSError):
        pass


def adopt_orphans() -> None:
    """Become the parent of descendants whose parents end, so that they are found; Linux only."""
    if sys.platform == "linux":
        with contextlib.suppress(OSError, AttributeError):
            ctypes.CDLL(None).prctl(_SUBREAPER, *map(ctypes.c_ulong, (1, 0, 0, 0)))


class FailedRunError(Exception):
    """A run of a batch that failed: which, and how."""

    def __init__(self, run: int, told: str) -> None:
        super().__init__(told)
        self.run = run


def _numbers(y: np.ndarray, t: np.ndarray, names: list[str]) -> None:
    """Raise where an output is not finite."""
    wrong = ~np.isfinite(y)
    if wrong.any():
        k = int(np.argmax(wrong.any(axis=0)))
        name = int(np.argmax(wrong[:, k]))
        raise ArithmeticError(f"its output {names[name]} at {t[k] - t[0]:g} s is {y[name, k]}")


class _Served:
    """One FMU and its loaded instance."""

    def __init__(self, path: str, folder: str) -> None:
        self.path, self.folder = path, folder
        self._unpacked = ""
        self._steppers: dict[str, Any] = {}

    def runs(self, said: dict[str, Any], given: dict[str, np.ndarray]) -> np.ndarray:
        """Return the outputs of several runs, shape (n_runs, n_outputs, n)."""
        import fmpy

        if not self._unpacked:
            self._unpacked = str(fmpy.extract(self.path, unzipdir=str(Path(self.folder) / "fmu")))
        stepper = self._stepper(said)
        found = []
        for k, (u, values) in enumerate(zip(given["u"], given["start"], strict=True)):
            one = {**said, "start": dict(zip(said["start"], map(float, values), strict=True))}
            try:
                if stepper is not None:
                    y = stepper.run(given["t"], u, one["start"])
                else:
                    y = _run(self._unpacked, said["kind"], one, {"t": given["t"], "u": u})
                _numbers(y, given["t"], said["outputs"])
            except Exception as error:  # whatever foreign code and fmpy raise: the rest of the batch is skipped
                raise FailedRunError(k, f"{type(error).__name__}: {error}") from error
            found.append(y)
        return np.stack(found)

    def _stepper(self, said: dict[str, Any]) -> Any:
        from .fmu_stepping import Stepper

        if said["kind"] != "CoSimulation":
            return None
        key = json.dumps([said["inputs"], said["outputs"]])
        if key not in self._steppers:
            try:
                self._steppers[key] = Stepper(self._unpacked, said["inputs"], said["outputs"])
            except LookupError:
                self._steppers[key] = None
        return self._steppers[key]


def main() -> None:
    """Serve one FMU (first argument) within a memory limit, unpacked into a folder (the other arguments)."""
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what the FMU prints is not an answer
    path, memory, folder = sys.argv[1], int(sys.argv[2]), sys.argv[3]
    limited(memory)
    adopt_orphans()
    threading.Thread(target=_leave_with, args=(os.getppid(), folder), daemon=True).start()
    try:
        _serve(_Served(path, folder), path, answers)
    finally:
        _leave(folder)


def _serve(served: _Served, path: str, answers: IO[bytes]) -> None:
    """Answer requests until there are no more."""
    while (asked := receive(sys.stdin.buffer)) is not None:
        said, given = asked
        try:
            if said["do"] == "describe":
                send(answers, {"ok": described(path)})
            else:
                send(answers, {"ok": True}, {"y": served.runs(said, given)})
        except FailedRunError as error:
            send(answers, {"error": str(error)[:500], "run": error.run})
        except Exception as error:  # whatever foreign code and fmpy raise is the answer
            send(answers, {"error": f"{type(error).__name__}: {error}"[:500]})


def _leave_with(parent: int, folder: str) -> None:
    """Exit when the parent process is gone, even while the FMU runs: nobody else could clean up."""
    while os.getppid() == parent:
        time.sleep(0.5)
    _leave(folder)


def _leave(folder: str) -> None:
    """Remove unpacked files, and end with all processes that the FMU has started."""
    kill_marked(os.environ.get(MARK, ""))
    shutil.rmtree(folder, ignore_errors=True)
    if os.name == "posix" and os.getpgrp() == os.getpid():
        os.killpg(os.getpid(), signal.SIGKILL)
    os.kill(os.getpid(), signal.SIGTERM)


if __name__ == "__main__":
    main()
