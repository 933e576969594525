"""An FMU as a simulator: FMI 2 and 3, run in a process of its own with limits of time and memory."""

from __future__ import annotations

import contextlib
import copy
import io
import math
import os
import re
import select
import shutil
import subprocess
import tempfile
import time
import weakref
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np

from ..errors import (
    ForeignSimulatorError,
    MissingDependencyError,
    ParameterError,
    SimulatorNotFoundError,
    SimulatorRunError,
    SimulatorSyntaxError,
    UntrustedCodeError,
)
from ..files import named_from
from .base import Simulator
from .fmu_worker import is_whole, receive, send
from .ports import RESERVED, ModelParameter, Port, merged
from .workers import ended, killed, started

SECONDS, BYTES = 60.0, 4 * 2**30
"""Default limits of time and memory for a run of an FMU."""
_LOADING = 30.0  # s more for the first answer of a process, which loads Python and fmpy
_PIECE = 2**16
_STREAMS = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.DEVNULL}
_NUMERIC = ("Real", "Float64", "Float32")


class FmuSimulator(Simulator):
    """A functional mock-up unit, for co-simulation or model exchange.

    Its inputs and outputs are ports, under names without dots and brackets. A state port names a variable whose start
    value is fitted to each run. An FMU is native code: it runs only where it is trusted, in a process of its own.

    Parameters
    ----------
    fmu : path-like
        The ``.fmu`` file.
    ports : sequence of Port, optional
        Ports that differ from the FMU's own, and states.
    parameters : mapping, optional
        Its parameters that have a tolerance or another value.
    trust : bool, default=False
        Whether it may run. Its description is read in any case.
    seconds : float, default=60
        Time that one run may take, s.

    Raises
    ------
    MissingDependencyError
        fmpy is not installed.
    SimulatorSyntaxError
        The file is not an FMU.
    ParameterError
        It lacks a variable that is named.

    Examples
    --------
    >>> from pamid.simulators import FmuSimulator
    >>> FmuSimulator("gone.fmu")
    Traceback (most recent call last):
    pamid.errors.SimulatorNotFoundError: gone.fmu does not exist. Expected an FMU. Check the path.
    """

    kind: ClassVar[str] = "fmu"
    kinds: ClassVar[tuple[str, ...]] = ("fmu",)
    one_by_one: ClassVar[bool] = True
    any_step: ClassVar[bool] = True
    form = "run"

    def __init__(
        self,
        fmu: str | Path,
        ports: Sequence[Port] = (),
        parameters: Mapping[str, Any] | None = None,
        effects: Sequence[tuple[str, str, Mapping[str, float]]] = (),
        *,
        trust: bool = False,
        seconds: float = SECONDS,
    ) -> None:
        self.path, self.trust, self.seconds = Path(fmu), trust, float(seconds)
        if not self.path.is_file():
            raise SimulatorNotFoundError(f"{self.path} does not exist.", "an FMU", "Check the path.")
        self._workers = [_Worker(self.path, self.seconds), _Worker(self.path, self.seconds)]
        self.described = self._workers[0].asked({"do": "describe"}, {})[0]["ok"]
        self._names = _distinct([v["name"] for v in self.described["variables"]])
        plain = {name: own for own, name in self._names.items()}
        own = [
            Port(
                plain[v["name"]],
                v["causality"],
                v["unit"],
                start=(_start(v) or None) if v["causality"] == "input" else None,
            )
            for v in self.described["variables"]
            if v["causality"] in ("input", "output") and v["type"] in _NUMERIC
        ]
        super().__init__(merged(own, ports), parameters, effects)
        if unknown := [n for n in (*self.parameters, *self.states) if n not in self._names]:
            known = [plain[v["name"]] for v in self.described["variables"] if v["causality"] == "parameter"]
            raise ParameterError(
                f"{self.path.name} has no variable {', '.join(unknown)}.",
                f"one of {', '.join(known[:30]) or 'none'}",
                "Correct the name.",
            )

    @classmethod
    def from_page(
        cls, kind: str, table: Mapping[str, Any], ports: Sequence[Port], parameters: Mapping[str, ModelParameter],
        effects: Sequence[tuple[str, str, Mapping[str, float]]], folder: Path,
    ) -> Self:  # fmt: skip
        """Return the simulator of a trusted file; its table has ``fmu``, and optionally ``seconds``."""
        seconds = table.get("seconds", SECONDS)
        if isinstance(seconds, bool) or not isinstance(seconds, (int, float)) or not seconds > 0:
            raise ParameterError(f"seconds is {seconds!r}.", "a positive number", "Correct it.")
        plain = {k: v for k, v in table.items() if k != "seconds"}
        path = folder / cls.text_of(plain, "fmu")
        return cls(path, ports, parameters, effects, trust=True, seconds=float(seconds))

    def page_table(self, folder: Path) -> dict[str, Any]:
        """Return the entries of the simulator file's table."""
        return {"fmu": named_from(self.path, folder), "seconds": self.seconds}

    def run(self, t: np.ndarray, u: np.ndarray, p: np.ndarray, x0: np.ndarray) -> np.ndarray:
        """Return the outputs of a whole run."""
        return self.runs(t, u[None], p[None], x0[None])[0]

    def runs(self, t: np.ndarray, u: np.ndarray, p: np.ndarray, x0: np.ndarray) -> np.ndarray:
        """Return the outputs of several runs of the same times, shape (n_runs, n_outputs, n), in two processes."""
        if not self.trust:
            raise UntrustedCodeError(
                f"{self.path} is native code.", "your permission to run it", "Pass trust=True, or add --trust."
            )
        said = {
            "do": "run",
            "kind": self.described["kinds"][0],
            "start": [self._names[n] for n in (*self.parameters, *self.states)],
            "inputs": [self._names[n] for n in self.inputs],
            "outputs": [self._names[n] for n in self.outputs],
        }
        start = np.hstack([p, x0])
        workers = self._workers[: 2 if len(u) > 3 and (os.cpu_count() or 1) > 1 else 1]
        shares = np.array_split(np.arange(len(u)), len(workers))
        for w in workers:
            w.begin()
        with ThreadPoolExecutor(len(workers)) as pool:
            asked = [
                pool.submit(w.asked, said, {"t": t, "u": u[share], "start": start[share]}, int(share[0]))
                for w, share in zip(workers, shares, strict=True)
            ]
            try:
                return np.concatenate([a.result()[1]["y"] for a in asked])
            except SimulatorRunError:
                raise
            except BaseException:  # hung, dead or interrupted: nobody waits for the rest
                for w in workers:
                    w.kill()
                raise

    def own_numbers(self) -> dict[str, ModelParameter]:
        """Return the parameters of the FMU with the values that its description gives them."""
        found, plain = {}, {name: own for own, name in self._names.items()}
        for v in self.described["variables"]:
            if v["causality"] == "parameter" and v["type"] in _NUMERIC:
                with contextlib.suppress(ValueError, ParameterError):
                    found[plain[v["name"]]] = ModelParameter(float(v["start"]), unit=v["unit"])
        return found

    def own_states(self) -> list[Port]:
        """Return the continuous states whose start values may be set, as its description says."""
        plain = {name: own for own, name in self._names.items()}
        taken = {p.name for p in self.ports}
        return [
            Port(plain[v["name"]], "state", v["unit"], start=_start(v))
            for v in self.described["variables"]
            if v.get("state") and v["type"] in _NUMERIC and plain[v["name"]] not in taken
        ]

    def name_of(self, port: str) -> str:
        """Return the FMU's own name of a port or parameter."""
        return self._names[port]

    def start_values(self) -> dict[str, float]:
        """Return the values of the parameters under the FMU's own names, for any importer."""
        return {self._names[k]: float(v.value) for k, v in self.parameters.items()}

    def __deepcopy__(self, memo: Any) -> Self:
        return copy.copy(self)


class _Worker:
    """The other process; it is started when first needed, and again after it has died."""

    def __init__(self, path: Path, seconds: float) -> None:
        self.path, self.seconds = path, seconds
        self._process: subprocess.Popen[bytes] | None = None
        self._ended: Callable[[], object] = lambda: None

    def begin(self) -> None:
        """Start the process, unless it runs."""
        self._started()

    def kill(self) -> None:
        """Kill the process; who waits for its answer hears that it has died."""
        if self._process is not None:
            killed(self._process)

    def _started(self) -> subprocess.Popen[bytes]:
        if self._process is not None and self._process.poll() is not None:
            self._given_up()
        if self._process is None:
            # The process may be killed, and cannot remove the folder itself.
            folder = tempfile.mkdtemp(prefix="pamid_fmu_")
            said = [str(self.path.resolve()), str(BYTES), folder]
            self._process = started(
                "pamid.simulators.fmu_worker", *said, cwd=folder, env={"TMPDIR": folder}, **_STREAMS
            )
            self._ended = weakref.finalize(self._process, shutil.rmtree, folder, ignore_errors=True)
            weakref.finalize(self, _end, self._process, self._ended)
        return self._process

    def asked(
        self, said: dict[str, Any], arrays: dict[str, np.ndarray], first: int = 0
    ) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
        """Return the answer to a request; raise where there is none in time."""
        process = self._started()
        assert process.stdin is not None and process.stdout is not None
        try:
            send(process.stdin, said, arrays)
            answer = self._awaited(process)
        except OSError:  # it has died
            with contextlib.suppress(subprocess.TimeoutExpired):
                process.wait(timeout=5)
            code = process.poll()
            self._given_up()
            raise ForeignSimulatorError(
                f"{self.path.name} ended its process with exit code {code}.", "a run that completes", "Fix the FMU."
            ) from None
        if answer is None:
            self._given_up()
            raise ForeignSimulatorError(
                f"{self.path.name} did not answer within {self.seconds:g} s.",
                "a run that ends",
                "Give it more time (seconds in [fmu]), or fix it.",
            )
        if "error" in answer[0]:
            text = " ".join(str(answer[0]["error"]).split()).rstrip(".")  # a line, as all errors
            if "No module named 'fmpy'" in text:
                raise MissingDependencyError(
                    "fmpy is not installed.", "the package fmpy", "pip install 'pamid[export]'."
                )
            if said["do"] == "describe":
                raise SimulatorSyntaxError(
                    f"{self.path} is not an FMU: {text}.", "an FMU of FMI 2 or 3", "Check the file."
                )
            if "run" in answer[0]:
                raise SimulatorRunError(
                    f"{self.path.name} failed in run {first + int(answer[0]['run']) + 1}: {text}.",
                    "a run that completes, with finite numbers",
                    "Fix the FMU, or the inputs and parameters that it is given.",
                )
            raise ForeignSimulatorError(f"{self.path.name} failed: {text}.", "a run that completes", "Fix the FMU.")
        return answer

    def _given_up(self) -> None:
        if self._process is not None:
            _end(self._process, self._ended)
        self._process = None

    def _awaited(self, process: subprocess.Popen[bytes]) -> Any:
        """Return the answer, or None where none is complete in time; raise where the process has died."""
        assert process.stdout is not None
        until = time.monotonic() + max(self.seconds, 1.0) + (_LOADING if self._fresh(process) else 0.0)
        heard = bytearray()
        while (left := until - time.monotonic()) > 0.0:
            ready, _, _ = select.select([process.stdout], [], [], min(left, 0.2))
            if ready:
                if not (more := os.read(process.stdout.fileno(), _PIECE)):
                    raise BrokenPipeError
                heard += more
                if is_whole(heard):
                    return receive(io.BytesIO(heard))
                if len(heard) > BYTES:
                    return None
            elif process.poll() is not None:
                raise BrokenPipeError
        return None

    def _fresh(self, process: subprocess.Popen[bytes]) -> bool:
        """Return whether a process has just been started: Python and fmpy take a while to load."""
        first = getattr(process, "_pamid_asked", False) is False
        process._pamid_asked = True  # type: ignore[attr-defined]
        return first


def _end(process: subprocess.Popen[bytes], remove: Callable[[], object]) -> None:
    ended(process)
    remove()


def _start(variable: Mapping[str, Any]) -> float:
    """Return the default start value of a variable; 0 where the FMU states none."""
    try:
        value = float(variable["start"])
    except ValueError:
        return 0.0
    return value if math.isfinite(value) else 0.0


def _plain(name: str) -> str:
    plain = re.sub(r"\W+", "_", name).strip("_")
    return plain if plain.isidentifier() and plain not in RESERVED else f"_{plain}"


def _distinct(names: Sequence[str]) -> dict[str, str]:
    """Return the original names by plain, unique ones; plain names are kept."""
    found = {name: name for name in names if _plain(name) == name}
    for name in names:
        if name in found.values():
            continue
        plain, k = _plain(name), 1
        while plain in found:
            k += 1
            plain = f"{_plain(name)}_{k}"
        found[plain] = name
    return found
