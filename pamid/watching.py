"""Watch a stream of samples with any simulator that has ports: has the rig changed, and what has."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Self

import numpy as np
import pandas as pd

from .any_simulator import diagnose
from .errors import MissingColumnError, ParameterError, ShortTrajectoryError, StreamChangeWarning
from .gap.diagnosis.result import Diagnosis
from .gap.evaluation import residuals_of
from .gap.several.history import History
from .gap.several.result import Change
from .simulators import Simulator

if TYPE_CHECKING:
    from .online import ChangeMonitor

    _Left = tuple[pd.DataFrame, pd.Series, pd.Series]

PIECES = 10
"""Pieces of the healthy stretch; the stream is looked at in pieces as long, so that both are filtered alike."""
NAMED = 3
"""Pieces of a change that are diagnosed together: a third of the healthy stretch."""


@dataclass(frozen=True)
class StreamChange:
    """A change of the rig that a stream shows."""

    time: float
    """When it began, s."""
    equation: str
    """Where it showed first."""
    changes: list[Change]
    """What has changed, as the diagnosis of what came since says; empty where the library does not hold it."""
    diagnosis: Diagnosis = field(repr=False)
    """That diagnosis, of the healthy stretch and what came since."""


class SimulatorWatch:
    """Follow a rig with its simulator: diagnose a healthy stretch, then watch what it leaves and diagnose changes.

    `false_alarms` is the share of streams of `per` seconds with a false alarm, `growth` the error ratio of a change.
    """

    def __init__(
        self,
        simulator: Simulator,
        effects: str | Sequence[str] = "all",
        *,
        false_alarms: float = 0.01,
        per: float = 600.0,
        growth: float = 1.25,
        random_state: int = 0,
    ) -> None:
        self.simulator = simulator
        self.effects = effects
        self.false_alarms = false_alarms
        self.per = per
        self.growth = growth
        self.random_state = random_state
        self.history: History | None = None
        self.known: list[str] = []
        self.piece = float("nan")
        self._named = 0
        self._now = simulator
        self._waiting: pd.DataFrame
        self._monitors: dict[str, ChangeMonitor] = {}
        self._times: dict[str, list[float]] = {}
        self._recent: list[pd.DataFrame] = []
        self._since: tuple[float, str] | None = None
        self._found: Diagnosis | None = None

    def learn(self, log: pd.DataFrame, progress: Callable[[str], None] | None = None) -> Self:
        """Learn the rig while all is well."""
        found = diagnose({"healthy": log}, self.simulator, self.effects, seed=self.random_state, progress=progress)
        self._know(found, log)
        return self

    def update(self, log: pd.DataFrame) -> list[StreamChange]:
        """Take the samples that follow."""
        if self.history is None:
            raise ParameterError("The monitor has not been trained.", "a healthy stretch first", "Call learn.")
        self._waiting = pd.concat([self._waiting, log], ignore_index=True)
        found: list[StreamChange] = []
        while (piece := self._next_piece()) is not None:
            found += self._take(piece)
        return found

    # --- the rig as it is ---------------------------------------------------------------------------------------
    def _know(self, found: Diagnosis, log: pd.DataFrame) -> None:
        """Adopt a diagnosis of the rig, and learn its residuals on a stretch."""
        from .online import ChangeMonitor

        self.history = found.history
        causes = [zip(c.effects, c.where or ("",) * len(c.effects), strict=True) for c in found.causes]
        self.known = [f"{e} at {w}" if w else e for each in causes for e, w in each]
        self._now = found.corrected if found.corrected is not None else self.simulator
        spans = log.groupby("trajectory", sort=False)["time"].agg(["first", "last"])
        self.piece = float((spans["last"] - spans["first"]).sum()) / PIECES
        self._waiting = log.reset_index(drop=True)
        left: dict[str, list[_Left]] = {}
        while (piece := self._next_piece()) is not None:
            for equation, some in self._residuals(piece).items():
                left.setdefault(equation, []).append(some)
        self._monitors = {}
        for equation, parts in left.items():
            signals, z, times = (pd.concat([part[k] for part in parts]) for k in range(3))
            self._monitors[equation] = ChangeMonitor(
                _Nothing(), sampling_interval=float(np.median(np.diff(times))),
                false_alarms=self.false_alarms / len(left), per=self.per, growth=self.growth,
                random_state=self.random_state,
            ).calibrate(signals, z)  # fmt: skip
        self._times = {e: [] for e in self._monitors}
        self._recent, self._since, self._found = [], None, None
        self._waiting = self._waiting[:0]

    def _next_piece(self) -> pd.DataFrame | None:
        """Take the next piece off the waiting rows; None where too few wait."""
        t, run = self._waiting["time"].to_numpy(), self._waiting["trajectory"].to_numpy()
        if not len(t):
            return None
        same = int(np.argmax(run != run[0])) if np.any(run != run[0]) else len(t)
        cut = int(np.searchsorted(t[:same], t[0] + self.piece * (1.0 - 1e-9)))
        if cut >= same == len(t):
            return None
        piece, self._waiting = self._waiting[: min(cut, same)], self._waiting[min(cut, same) :].reset_index(drop=True)
        return piece

    def _residuals(self, piece: pd.DataFrame) -> dict[str, _Left]:
        """Return for each equation signals, residuals in units of the noise, and times, by windows."""
        try:
            evidence = residuals_of(piece, self._now)
        except (ShortTrajectoryError, MissingColumnError):  # the rest of a run, or a signal that does not come
            return {}
        # Inputs and states are compared: an output that left its old values is a change.
        by = {k: v for k, v in evidence.log.channels.items() if k not in self.simulator.outputs}
        table = pd.DataFrame({k: v[evidence.centre] for k, v in by.items()})
        begins = float(piece["time"].iloc[0])
        found = {}
        for equation, part in zip(evidence.equations, evidence.parts, strict=True):
            times = pd.Series(evidence.time[part] - float(evidence.log.t[0]) + begins)
            found[equation] = table[part], pd.Series(evidence.value[part]), times
        return found

    # --- the stream ---------------------------------------------------------------------------------------------
    def _take(self, piece: pd.DataFrame) -> list[StreamChange]:
        """Take a piece: watch it, or keep it for the diagnosis of a change that has begun."""
        self._recent.append(piece)
        if self._found is not None:
            if len(self._recent) >= PIECES:
                self._know(self._found, pd.concat(self._recent, ignore_index=True))
            return []
        if self._since is None:
            self._watch(piece)
            self._recent = self._recent[-PIECES:] if self._since is None else self._since_then()
        return [self._name()] if self._since is not None and len(self._recent) >= NAMED else []

    def _watch(self, piece: pd.DataFrame) -> None:
        for equation, (signals, z, times) in self._residuals(piece).items():
            if (monitor := self._monitors.get(equation)) is None:
                continue
            self._times[equation] += times.tolist()
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", StreamChangeWarning)
                monitor.update(signals, z)
            if monitor.changed_at is not None and self._since is None:
                row = round(monitor.changed_at / monitor.sampling_interval)
                self._since = self._times[equation][min(row, len(self._times[equation]) - 1)], equation

    def _since_then(self) -> list[pd.DataFrame]:
        """Return the pieces since the change; the one in which it began holds both, and is left out."""
        assert self._since is not None
        after = [p for p in self._recent if float(p["time"].iloc[0]) >= self._since[0]]
        return after or self._recent[-1:]

    def _name(self) -> StreamChange:
        assert self._since is not None and self.history is not None
        self._named += 1
        rows = pd.concat(self._recent, ignore_index=True)
        found = diagnose({f"change {self._named}": rows}, self.simulator, since=self.history, seed=self.random_state)
        self._found = found
        here = [c for c in found.changes if c.log == f"change {self._named}"]
        return StreamChange(*self._since, here, found)


class _Nothing:
    """The model of the residual: zero."""

    def predict(self, X: pd.DataFrame) -> np.ndarray:
        """Return zeros."""
        return np.zeros(len(X))
