r"""Several logs held against one simulator, as one vector of windows.

Causes and geometry are shared by all logs; what may change from one day to the next is each day's own:

.. math:: z_k = z_k(\theta, x, y_{d(k)}), \qquad \ell = \sum_k \ell_k

with the causes' parameters θ, the tolerances x that all logs share and those y of the day d(k) of log k. The logs'
residuals stand below one another; the columns of a day's own parameters are zero in the logs of all other days.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from ...effects import Parameter, all_effects
from ..residuals.bench import Evidence
from ..residuals.protocol import STATE, Spec
from ..residuals.straight import Straight

OF_THE_BENCH = ("rest_length", "rest_diameter", "braid_angle", "initial_contraction", "pulley_radius", "inertia")
"""Parameters that stay from day to day: lengths, angles and masses. Valves, friction and gas need not."""
KEPT = 1500
"""Residual vectors that are kept: those of the library's grid, which is looked at several times."""


class Log(NamedTuple):
    """One of several logs.

    Parameters
    ----------
    name : str
        Its name.
    evidence : Evidence
        Its windows.
    day : str
        Logs of one day share what may change from day to day.
    """

    name: str
    evidence: Evidence
    day: str


class StackedEvidence(Straight):
    """Several logs as one source of residuals; a `pamid.gap.residuals.protocol.ResidualSource`.

    Parameters
    ----------
    logs : sequence of Log
        The logs, in the order in which they were recorded.
    active : callable
        Takes the name of an effect and the place of a log, returns whether the effect acts there.
    plain : callable
        Takes the name of an effect, returns that of the library.
    """

    exact = True
    bends = False

    def __init__(
        self, logs: Sequence[Log], active: Callable[[str, int], bool], plain: Callable[[str], str] = str
    ) -> None:
        self.logs, self.active, self.plain = list(logs), active, plain
        sources = [log.evidence for log in self.logs]
        self.params = sources[-1].params
        every = dict.fromkeys(e for s in sources for e in s.equations)
        order = [e for e in sources[0].units if e in every]
        self.equations = [*order, *(e for e in every if e not in order)]
        self.units = {k: v for s in sources for k, v in s.units.items()}
        self.skipped = {e: why for s in sources for e, why in s.skipped.items() if e not in every}
        self._place()
        n = len(sources[0].z0) if len(sources) == 1 else sum(len(s.z0) for s in sources)
        assert n == self.n
        self.z0 = self._gathered([s.z0 for s in sources])
        self.noise = self._gathered([s.noise for s in sources])
        self.measured = self._gathered([s.measured for s in sources])
        self.side = self._gathered([s.side for s in sources])
        self.time = self._gathered([s.time for s in sources])
        self.log = self._gathered([np.full(len(s.z0), k) for k, s in enumerate(sources)])
        before = np.cumsum([0, *(len(s.runs) for s in sources)])
        self.run = self._gathered([s.run + b for s, b in zip(sources, before, strict=False)])
        before = np.cumsum([0, *(len(s.trajectories) for s in sources)])
        self.block = self._gathered([s.block + b for s, b in zip(sources, before, strict=False)])
        several = len(self.logs) > 1
        self.trajectories = [
            f"{log.name}: {name}" if several else name for log in self.logs for name in log.evidence.trajectories
        ]
        self._tolerances()
        self.weights = np.ones(len(self.parts))
        sharp = {
            e
            for s in sources
            for e, part in zip(s.equations, s.parts, strict=True)
            if any(part == other for other in s.sharp)
        }
        self.sharp = [part for e, part in zip(self.equations, self.parts, strict=True) if e in sharp]
        self.stretch = max(s.stretch for s in sources)
        self.least_gain = max(s.least_gain for s in sources)
        self.decisive = max(s.decisive for s in sources)
        self._state: dict[str, np.ndarray] | None = None
        self._kept: dict[tuple[int, str], np.ndarray] = {}

    def _place(self) -> None:
        """Find where each log's windows stand: equation after equation, log after log."""
        sources = [log.evidence for log in self.logs]
        self.places = [np.zeros(len(s.z0), dtype=int) for s in sources]
        self.parts: list[slice] = []
        n = 0
        for name in self.equations:
            first = n
            for place, source in zip(self.places, sources, strict=True):
                if name in source.equations:
                    part = source.parts[source.equations.index(name)]
                    place[part] = np.arange(n, n + part.stop - part.start)
                    n += part.stop - part.start
            self.parts.append(slice(first, n))
        self.n = n

    def _gathered(self, each: Sequence[np.ndarray]) -> np.ndarray:
        out = np.empty((self.n, *each[0].shape[1:]), dtype=np.result_type(*each))
        for place, x in zip(self.places, each, strict=True):
            out[place] = x
        return out

    def _tolerances(self) -> None:
        """Make the columns of what has a tolerance: shared ones, and those of each day."""
        self.free: list[str] = []
        self._of: list[list[tuple[int, int]]] = [[] for _ in self.logs]  # of each log: its column, and the stack's
        columns: list[np.ndarray] = []
        place: dict[str, int] = {}
        for k, log in enumerate(self.logs):
            for j, name in enumerate(log.evidence.free):
                own = name not in OF_THE_BENCH and len({other.day for other in self.logs}) > 1
                key = f"{name} ({log.day})" if own else name
                if key not in place:
                    place[key] = len(columns)
                    self.free.append(key)
                    columns.append(np.zeros(self.n))
                columns[place[key]][self.places[k]] = log.evidence.J[:, j]
                self._of[k].append((j, place[key]))
        self.J = np.column_stack(columns) if columns else np.zeros((self.n, 0))

    # --- one log of the stack -----------------------------------------------------------------------------------
    def spec_in(self, k: int, spec: Spec) -> dict[str, dict[str, float]]:
        """Return the effects that act in a log, by the library's names where these are unambiguous."""
        here = [name for name in spec if self.active(name, k)]
        plain = [self.plain(name) for name in here]
        return {p if plain.count(p) == 1 else name: dict(spec[name]) for name, p in zip(here, plain, strict=True)}

    def deviations_in(self, k: int, x: np.ndarray) -> np.ndarray:
        """Return the deviations of a log's own parameters, in tolerances."""
        out = np.zeros(len(self.logs[k].evidence.free))
        for j, at in self._of[k]:
            out[j] = x[at]
        return out

    # --- the protocol -------------------------------------------------------------------------------------------
    def z(
        self, spec: Spec, deviations: Mapping[str, float] | None = None, equations: Sequence[str] | None = ()
    ) -> np.ndarray:
        """Return the residuals under effects and changed parameters, in units of the noise and white."""
        x = np.array([float((deviations or {}).get(name, 0.0)) for name in self.free])
        return self._gathered([self._z(k, spec, x, equations) for k in range(len(self.logs))])

    def _z(self, k: int, spec: Spec, x: np.ndarray, equations: Sequence[str] | None) -> np.ndarray:
        source, here = self.logs[k].evidence, self.spec_in(k, spec)
        if equations:
            equations = [e for e in equations if e in source.equations]
        mine = self.deviations_in(k, x)
        if not (here or np.any(mine)) or (not equations and equations is not None and not source.touched(here)):
            return source.z0
        key = (k, f"{here!r} {mine.tobytes()!r} {equations!r}")
        if key not in self._kept:
            if len(self._kept) >= KEPT:
                self._kept.pop(next(iter(self._kept)))
            self._kept[key] = source.z(here, dict(zip(source.free, map(float, mine), strict=True)), equations)
        return self._kept[key]

    def tangent(self, spec: Spec, x: np.ndarray) -> np.ndarray:
        """Return what plus ``J x`` are the exact residuals at deviations x, in tolerances."""
        return self._gathered(
            [
                log.evidence.tangent(self.spec_in(k, spec), self.deviations_in(k, np.asarray(x, dtype=float)))
                for k, log in enumerate(self.logs)
            ]
        )

    def change(self, spec: Spec, about: Spec, x: np.ndarray) -> np.ndarray:
        """Return by how much the residuals change from effects to others, at deviations x."""
        return self.tangent(spec, x) - self.tangent(about, x)

    def raw(self, z: np.ndarray) -> np.ndarray:
        """Return residuals as the windows have them, in units of each window's noise."""
        return self._gathered([log.evidence.raw(z[p]) for log, p in zip(self.logs, self.places, strict=True)])

    def white(self, z: np.ndarray) -> np.ndarray:
        """Return residuals with noise that is independent from window to window."""
        return self._gathered([log.evidence.white(z[p]) for log, p in zip(self.logs, self.places, strict=True)])

    def touched(self, names: Collection[str]) -> list[str]:
        """Return the equations that effects change in any log."""
        found = {e for k, log in enumerate(self.logs) for e in log.evidence.touched(self._here(names, k))}
        return [e for e in self.equations if e in found]

    def _here(self, names: Collection[str], k: int) -> list[str]:
        return [name for name in names if self.active(name, k)]

    def reads(self, channel: str) -> bool:
        """Tell whether an equation that is tested reads a channel."""
        return any(log.evidence.reads(channel) for log in self.logs)

    def pieces(self) -> tuple[np.ndarray, int]:
        """Return the trajectory of each window, which is left out as a whole, and how many there are."""
        return self.block, len(self.trajectories)

    def freedom(self, spec: Spec) -> float:
        """Return what it costs that the beginnings of runs are unknown."""
        return sum(log.evidence.freedom(self.spec_in(k, spec)) for k, log in enumerate(self.logs))

    def reach(self, spec: Spec) -> np.ndarray | None:
        """Return None: sensitivities about no effect hold beside any."""
        return None

    def reached(self, p: Parameter) -> Parameter:
        """Return a parameter within what any of the logs reaches."""
        return max((log.evidence.reached(p) for log in self.logs), key=lambda within: within.upper)

    def widening(self, spec: Spec) -> np.ndarray | None:
        """Return by how much undoing the lags of sensors widens each window's noise; None without such effects."""
        return self._factors([log.evidence.widening(self.spec_in(k, spec)) for k, log in enumerate(self.logs)])

    def spread(self, spec: Spec, x: np.ndarray) -> np.ndarray | None:
        """Return how wide the noise is under a changed simulator, as a share of the nominal one's."""
        return self._factors(
            [log.evidence.spread(self.spec_in(k, spec), self.deviations_in(k, x)) for k, log in enumerate(self.logs)]
        )

    def _factors(self, each: Sequence[np.ndarray | None]) -> np.ndarray | None:
        if all(f is None for f in each):
            return None
        sizes = [len(log.evidence.z0) for log in self.logs]
        return self._gathered([np.ones(n) if f is None else f for f, n in zip(each, sizes, strict=True)])

    def prior(self, name: str) -> float:
        """Return the logarithm of the odds with which an effect is expected."""
        effect = all_effects()[name]
        known = self.logs[0].evidence.prior(self.plain(name))
        return known if name == self.plain(name) else min(known, float(effect.prior))

    @staticmethod
    def column(name: str, side: int = 0) -> str:
        """Return the name under which a reader knows a signal of the state."""
        return Evidence.column(name, side)

    @property
    def state(self) -> dict[str, np.ndarray]:
        """The state at each window, by the names of `STATE`; NaN where it has none."""
        if self._state is None:
            each = [log.evidence.state for log in self.logs]
            self._state = {name: self._gathered([s[name] for s in each]) for name in STATE}
        return self._state
