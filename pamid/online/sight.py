"""Whether a stream lets anything be seen right now, and if not, why; sensors that stand still although none did."""

from collections.abc import Mapping, Sequence
from typing import Any, Self

import numpy as np

from ..constants import ATMOSPHERIC_PRESSURE
from ..signals.plausibility import implausible_units

WINDOW = 1.0
"""Length of a judged interval, s; blindness is reported after one or two of them."""

LEAST_SAMPLES = 20
"""Least number of samples judged together."""


class Sight:
    """Judge the last second of a stream: whether there are signals, in SI, that move."""

    def __init__(self, targets: Sequence[str], interval: float, ambient: float = ATMOSPHERIC_PRESSURE) -> None:
        self.targets = tuple(targets)
        self.interval = interval
        self.ambient = ambient
        self.why = ""
        self._parts: list[Mapping[str, np.ndarray]] = []

    def look(self, table: Mapping[str, np.ndarray], stuck: Mapping[str, Any] | None = None) -> str:
        """Take a block; return why nothing can be seen since then, or nothing."""
        self._parts.append(table)
        n = sum(len(t["time"]) for t in self._parts)
        if n >= max(WINDOW / self.interval, LEAST_SAMPLES):
            names = ("time", "eps", "P", *self.targets)
            whole = {k: np.concatenate([t[k] for t in self._parts]) for k in names if k in table}
            self._parts = []
            self.why = self._judge(whole)
        return self.why or self._stuck(stuck or {})

    def _judge(self, whole: Mapping[str, np.ndarray]) -> str:
        for name in ("eps", "P"):
            if np.isfinite(whole[name]).mean() < 0.5:
                return f"most samples have no {name}."
        measured = [t for t in self.targets if t in whole and np.isfinite(whole[t]).mean() > 0.5]
        if not measured:
            return f"most samples have neither {' nor '.join(self.targets)}."
        doubts = implausible_units(whole, ambient_pressure=self.ambient)
        return " ".join(d.text for d in doubts)

    def _stuck(self, stuck: Mapping[str, Any]) -> str:
        blocked = [c for c in ("eps", "P") if c in stuck]
        if not blocked and self.targets and all(t in stuck for t in self.targets):
            blocked = list(self.targets)
        return f"the sensor of {' and '.join(blocked)} stands still." if blocked else ""


LEAST_READINGS = 5
"""Samples that must be equal before a channel counts as still."""


class StillSensors:
    """Find stuck sensors; a channel that rested on the healthy stretch is never called stuck."""

    def __init__(self, block: int) -> None:
        self.block = block
        self.rests: set[str] = set()
        self.stuck: dict[str, float] = {}

    def learn(self, channels: Mapping[str, np.ndarray]) -> Self:
        """Note which channels rest while all is well, each of shape (n_samples,)."""
        self.rests = {name for name, x in channels.items() if any(_still(x[b]) for b in self._blocks(len(x)))}
        self.stuck = {}
        return self

    def update(self, channels: Mapping[str, np.ndarray], time: np.ndarray) -> dict[str, np.ndarray]:
        """Take the next samples; return which of them to leave out, each of shape (n_samples,)."""
        left_out = {}
        for name, x in channels.items():
            left_out[name] = mask = np.zeros(len(x), dtype=bool)
            if name in self.rests:
                continue
            for b in self._blocks(len(x)):
                if _still(x[b]):
                    mask[b] = True
                    self.stuck.setdefault(name, float(time[b][0]))
                elif np.isfinite(x[b]).any():
                    self.stuck.pop(name, None)
        return left_out

    def _blocks(self, n: int) -> list[slice]:
        return [slice(i, i + self.block) for i in range(0, n, self.block)]


def _still(x: np.ndarray) -> bool:
    known = x[np.isfinite(x)]
    return len(known) >= LEAST_READINGS and bool(np.ptp(known) == 0.0)
