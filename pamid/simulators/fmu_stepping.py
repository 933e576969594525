"""Runs of an FMU in its process: co-simulation step by step in one instance that is reset between runs."""

from __future__ import annotations

import ctypes
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

_STATUS = ("OK", "Warning", "Discard", "Error", "Fatal", "Pending")
_WARNING = 1


def _well(status: int, what: str, time: float) -> None:
    """Raise where a call has failed."""
    if not 0 <= status <= _WARNING:
        word = _STATUS[status] if 0 <= status < len(_STATUS) else str(status)
        raise FailedStepError(f"{what} at {time:g} s returned the status {word}")


class FailedStepError(RuntimeError):
    """A call of an FMU that did not succeed."""


class Stepper:
    """A co-simulation FMU of FMI 2 or 3, kept loaded; raises LookupError for what fmpy must run."""

    def __init__(self, folder: str, inputs: Sequence[str], outputs: Sequence[str]) -> None:
        import fmpy
        from fmpy import simulation

        self._simulation, self._folder = simulation, folder
        self.description = d = fmpy.read_model_description(folder, validate=False)
        if d.coSimulation is None or d.fmiVersion not in ("2.0", "3.0"):
            raise LookupError(d.fmiVersion)
        known = {v.name: v for v in d.modelVariables}
        if any(known[n].type not in ("Real", "Float64") or known[n].shape for n in (*inputs, *outputs)):
            raise LookupError("variables")
        self.two = d.fmiVersion == "2.0"
        self._given = (ctypes.c_uint32 * len(inputs))(*(known[n].valueReference for n in inputs))
        self._asked = (ctypes.c_uint32 * len(outputs))(*(known[n].valueReference for n in outputs))
        self._fmu: Any = None
        self._used = False

    def _begin(self, start: Mapping[str, float], first: np.ndarray, length: float) -> None:
        """Bring an instance to the beginning of a run."""
        s, d = self._simulation, self.description
        if self._fmu is not None and self._used:
            try:
                self._fmu.reset()
            except s.FMICallException:  # what cannot be reset is made again
                self._fmu.freeInstance()
                self._fmu = None
        if self._fmu is None:
            self._fmu = s.instantiate_fmu(self._folder, d, "CoSimulation")
        fmu, left, self._used = self._fmu, dict(start), True
        if self.two:
            fmu.setupExperiment(startTime=0.0, stopTime=length)
            left = s.apply_start_values(fmu, d, left, settable=s.settable_in_instantiated)
            fmu.enterInitializationMode()
        else:
            left = s.apply_start_values(fmu, d, left, settable=s.settable_in_instantiated)
            fmu.enterInitializationMode(startTime=0.0, stopTime=length)
        left = s.apply_start_values(fmu, d, left, settable=s.settable_in_initialization_mode)
        self._put(np.ascontiguousarray(first), 0.0)
        fmu.exitInitializationMode()
        if left:
            raise ValueError(f"{', '.join(left)} cannot be set before a run")

    def _put(self, values: np.ndarray, time: float) -> None:
        if not len(values):
            return
        at = values.ctypes.data_as(ctypes.POINTER(ctypes.c_double))
        n = len(values)
        size, fmu = ctypes.c_size_t(n), self._fmu
        if self.two:
            status = fmu.dll.fmi2SetReal(fmu.component, self._given, size, at)
        else:
            status = fmu.dll.fmi3SetFloat64(fmu.component, self._given, size, at, size)
        _well(status, "setting its inputs", time)

    def _get(self, values: np.ndarray, time: float) -> None:
        at, n = values.ctypes.data_as(ctypes.POINTER(ctypes.c_double)), ctypes.c_size_t(len(values))
        if self.two:
            status = self._fmu.dll.fmi2GetReal(self._fmu.component, self._asked, n, at)
        else:
            status = self._fmu.dll.fmi3GetFloat64(self._fmu.component, self._asked, n, at, n)
        _well(status, "reading its outputs", time)

    def run(self, t: np.ndarray, u: np.ndarray, start: Mapping[str, float]) -> np.ndarray:
        """Return the outputs at the times of a run, inputs held over each step; each row is read under its own ones."""
        t = t - t[0]
        given, out = np.ascontiguousarray(u.T, dtype=float), np.empty((len(t), len(self._asked)))
        self._begin(start, given[0], float(t[-1]))
        self._get(out[0], 0.0)
        fmu, flags = self._fmu, [ctypes.c_bool() for _ in range(3)]
        last = ctypes.c_double()
        for k in range(len(t) - 1):
            step = ctypes.c_double(t[k + 1] - t[k])
            if self.two:
                status = fmu.dll.fmi2DoStep(fmu.component, ctypes.c_double(t[k]), step, ctypes.c_int(1))
            else:
                status = fmu.dll.fmi3DoStep(
                    fmu.component, ctypes.c_double(t[k]), step, ctypes.c_bool(True),
                    *(ctypes.byref(f) for f in flags), ctypes.byref(last),
                )  # fmt: skip
            _well(status, "doStep", float(t[k]))
            self._put(given[k + 1], float(t[k + 1]))  # what feeds through an output does so at once
            self._get(out[k + 1], float(t[k + 1]))
        return out.T
