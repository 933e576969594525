"""The bench as a rig: its runs are simulated under its controller, with the noise of its own sensors."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from ...bench import Controller, simulate
from ...bench.parameters import BenchParameters
from ...bench.references import Trajectory
from ...bench.sensors import Sensor
from ...errors import DivergedError, ExcitationError
from ..diagnosis.rivals import Rival
from ..inference.gauss_newton import Fit
from ..residuals.bench import Evidence
from .family import DesignedRun, Limits, StandardRun
from .followed import controller_of
from .rig import Rig

CHANNELS = ("q", "P", "F", "mdot")


@dataclass(frozen=True)
class Bench(Rig):
    """The bench, for the planner."""

    params: BenchParameters
    """The simulator."""
    logs: Sequence[Evidence]
    """The logs of its present state."""
    limits: Limits
    """What it allows."""
    controller: Controller | None = None
    """What moves it; the simulator's own controller by default."""

    def evidence(self, table: pd.DataFrame) -> Evidence:
        """Return a log of the bench, recorded or simulated, compared with its simulator."""
        return Evidence(table, self.params)

    def recorded(self, runs: Sequence[DesignedRun | StandardRun], truth: Fit) -> tuple[pd.DataFrame, list[int]]:
        """Return runs simulated with an explanation, with the indices of those that could be simulated."""
        log = self.logs[-1]
        actual = log.corrected(truth.spec, dict(zip(log.free, map(float, truth.x), strict=True)))
        told = [run.trajectory(str(k)) for k, run in enumerate(runs)]
        table, there = self._simulated(actual, told, list(range(len(runs))))
        return table[[c for c in self.columns() if c in table]], there

    def _simulated(
        self, actual: BenchParameters, told: Sequence[Trajectory], which: list[int]
    ) -> tuple[pd.DataFrame, list[int]]:
        try:
            runs = [told[k] for k in which]
            return simulate(actual, runs, seed=0, sensors=self.sensors, controller=self.controller), which
        except (DivergedError, ArithmeticError, ValueError):
            if len(which) == 1:
                return pd.DataFrame(), []
            half = len(which) // 2
            a, b = (self._simulated(actual, told, part) for part in (which[:half], which[half:]))
            parts = [t for t, there in (a, b) if there]
            if not parts and len(which) == len(told):
                raise ExcitationError(
                    "No design within the limits could be simulated with the likeliest explanation.",
                    "a bench that stays within its range",
                    "Narrow the limits of angle and pressure.",
                ) from None
            return (pd.concat(parts, ignore_index=True) if parts else pd.DataFrame()), [*a[1], *b[1]]

    @property
    def sensors(self) -> dict[str, Sensor]:
        """The noise of the bench's own sensors, as its logs show it."""
        found: dict[str, list[float]] = {}
        for log in self.logs:
            for run in log.runs:
                for channel, noises in run.stretch.noises.items():
                    found.setdefault(channel, []).extend(float(np.hypot(n.white, n.fixed)) for n in noises)
        return {c: Sensor(float(np.median(v))) for c, v in found.items() if c in CHANNELS and np.median(v) > 0.0}

    def columns(self) -> list[str]:
        """The columns of a log that equations of the bench's logs read."""
        channels = [c for c in ("P", "F", "mdot", "u") if any(log.reads(c) for log in self.logs)]
        return ["trajectory", "time", "q", *(f"{c}{k}" for c in channels for k in (1, 2))]


def bench_rig(
    params: BenchParameters, logs: Mapping[str, pd.DataFrame], rivals: Sequence[Rival], limits: Limits | None = None
) -> Rig:
    """Return the bench with its logs, under a controller that moves it as they are moved."""
    evidence = [Evidence(log, params) for log in logs.values()]
    return Bench(params, evidence, limits or Limits(), controller_of(logs.values(), params))
