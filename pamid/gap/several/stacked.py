r"""Several logs compared with one simulator, as one vector of windows.

Causes and geometry are shared by all logs; what may change from one day to the next is each day's own:

.. math:: z_k = z_k(\theta, x, y_{d(k)}), \qquad \ell = \sum_k \ell_k

with the causes' parameters θ, the tolerances x that all logs share and those y of the day d(k) of log k. The logs'
residuals are stacked; the columns of a day's own parameters are zero in the logs of all other days.
"""

from collections.abc import Collection, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from ...effects import Parameter
from ...remembered import Remembered
from ..residuals.protocol import STATE, ResidualSource, Spec
from ..residuals.settled import Settled
from .variants import Variants

KEPT = 1500
"""Residual vectors that are cached: those of the library's grid, which is used several times."""


class Log(NamedTuple):
    """One of several logs."""

    name: str
    """Its name."""
    evidence: Any
    """Its windows."""
    day: str
    """Logs of one day share what may change from day to day."""


class StackedEvidence(Settled):
    """Several logs as one source of residuals; a `pamid.gap.residuals.protocol.ResidualSource`."""

    lasting: Collection[str] = ()

    def __init__(self, logs: Sequence[Log], variants: Variants | None = None) -> None:
        names, _, days = zip(*logs, strict=True)
        known = variants or Variants([], logs[0].evidence.effects, names, days)
        self.logs, self.active, self.plain = list(logs), known.acts, known.plain
        self.effects, self._odds = known.effects, known.odds
        for log in logs:
            log.evidence.also_under(known.names)
        sources: list[ResidualSource] = [log.evidence for log in self.logs]
        self.exact, self.bends, self.one_sided = sources[0].exact, sources[0].bends, sources[0].one_sided
        self.simulates = any(s.simulates for s in sources)
        self.overlap = max(s.overlap for s in sources)
        self.rows = sum(s.rows for s in sources)
        self.curved, self.rough = any(s.curved for s in sources), any(s.rough for s in sources)
        first, *others = [s.twins for s in sources]
        self.twins: Mapping[str, str] = {a: b for a, b in first.items() if all(t.get(a, b) == b for t in others)}
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
        self.side = self._gathered([self._sides(s) for s in sources])
        self.time = self._gathered([s.time for s in sources])
        self.log = self._gathered([np.full(len(s.z0), k) for k, s in enumerate(sources)])
        before = np.cumsum([0, *(int(s.run.max(initial=-1)) + 1 for s in sources)])
        self.run = self._gathered([s.run + b for s, b in zip(sources, before, strict=False)])
        before = np.cumsum([0, *(len(s.trajectories) for s in sources)])
        self.block = self._gathered([s.block + b for s, b in zip(sources, before, strict=False)])
        several = len(self.logs) > 1
        self.trajectories = [
            f"{log.name}: {name}" if several and name != log.name else name
            for log in self.logs
            for name in log.evidence.trajectories
        ]
        self._tolerances()
        self.weights = self._weights()
        sharp = {
            e
            for s in sources
            for e, part in zip(s.equations, s.parts, strict=True)
            if any(part == other for other in s.sharp)
        }
        self.sharp = [part for e, part in zip(self.equations, self.parts, strict=True) if e in sharp]
        self.stretch = max(s.stretch for s in sources)
        self.pace = sources[0].pace
        self.least_gain = max(s.least_gain for s in sources)
        self.decisive = max(s.decisive for s in sources)
        self._state: dict[str, np.ndarray] | None = None
        self._kept: Remembered[np.ndarray] = Remembered(KEPT)

    def _place(self) -> None:
        """Index each log's windows: equation after equation, log after log."""
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
        """Make the columns of parameters with a tolerance: shared ones, and those of each day."""
        self.free: list[str] = []
        self._of: list[list[tuple[int, int]]] = [[] for _ in self.logs]  # of each log: its column, and the stack's
        columns: list[np.ndarray] = []
        place: dict[str, int] = {}
        for k, log in enumerate(self.logs):
            for j, name in enumerate(log.evidence.free):
                own = name not in log.evidence.lasting and len({other.day for other in self.logs}) > 1
                key = f"{name} ({log.day})" if own else name
                if key not in place:
                    place[key] = len(columns)
                    self.free.append(key)
                    columns.append(np.zeros(self.n))
                columns[place[key]][self.places[k]] = log.evidence.J[:, j]
                self._of[k].append((j, place[key]))
        self.J = np.column_stack(columns) if columns else np.zeros((self.n, 0))
        self.about, low, high = np.zeros((3, len(columns)))
        self.ends = low, high
        for log, columns_of in zip(self.logs, self._of, strict=True):
            mine, theirs = np.array(columns_of, dtype=int).reshape(-1, 2).T
            self.about[theirs] = log.evidence.about[mine]
            low[theirs], high[theirs] = (end[mine] for end in log.evidence.ends)

    def _sides(self, source: ResidualSource) -> np.ndarray:
        """Return the side of each window; where that is the equation, its place among those of all logs."""
        if not source.one_sided:
            return source.side
        places = np.array([self.equations.index(e) for e in source.equations], dtype=int)
        return places[source.side]

    def _weights(self) -> np.ndarray:
        """Return the weight of a window of each equation: the mean over the windows of all logs."""
        each = self._gathered(
            [
                np.concatenate(
                    [np.full(p.stop - p.start, w) for p, w in zip(s.parts, s.weights, strict=True)] or [s.z0]
                )
                for s in (log.evidence for log in self.logs)
            ]
        )
        return np.array([float(np.mean(each[part])) if part.stop > part.start else 1.0 for part in self.parts])

    # --- one log of the stack -----------------------------------------------------------------------------------
    def spec_in(self, k: int, spec: Spec) -> dict[str, dict[str, float]]:
        """Return the effects that act in a log, by the library's names where these are unambiguous."""
        here = [name for name in spec if self._is_there(name, k)]
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
        deviations = dict(zip(source.free, map(float, mine), strict=True))
        return self._kept.get(key, lambda: source.z(here, deviations, equations))

    def tangent(self, spec: Spec, x: np.ndarray) -> np.ndarray:
        """Return z0 such that z0 + ``J x`` equals the exact residuals at deviations x, in tolerances."""
        return self._gathered(
            [
                log.evidence.tangent(self.spec_in(k, spec), self.deviations_in(k, np.asarray(x, dtype=float)))
                for k, log in enumerate(self.logs)
            ]
        )

    def slopes(self, spec: Spec, x: np.ndarray) -> np.ndarray:
        """Return the change of the residuals by one tolerance of each parameter, under effects, at deviations x."""
        if not (spec or np.any(x)):
            return self.J
        out = np.zeros_like(self.J)
        for k, (log, place) in enumerate(zip(self.logs, self.places, strict=True)):
            found = log.evidence.slopes(self.spec_in(k, spec), self.deviations_in(k, np.asarray(x, dtype=float)))
            for j, at in self._of[k]:
                out[place, at] = found[:, j]
        return out

    def folded(self, spec: Spec, x: np.ndarray) -> tuple[dict[str, dict[str, float]], np.ndarray]:
        """Return the same with no tolerance left that an effect contains, as the first log with the effect has it."""
        out, x = {name: dict(values) for name, values in spec.items()}, np.array(x, dtype=float)
        for name in spec:
            k = next((k for k in range(len(self.logs)) if self._is_there(name, k)), None)
            if k is None:
                continue
            mine = self.deviations_in(k, x)
            here, moved = self.logs[k].evidence.folded(self.spec_in(k, {name: out[name]}), mine)
            [out[name]] = here.values()
            for j, at in self._of[k]:
                x[at] += moved[j] - mine[j]
        return out, x

    def change(self, spec: Spec, about: Spec, x: np.ndarray) -> np.ndarray:
        """Return by how much the residuals change from effects to others, at deviations x."""
        each = []
        for k, log in enumerate(self.logs):
            here, there, mine = self.spec_in(k, spec), self.spec_in(k, about), self.deviations_in(k, np.asarray(x))
            each.append(np.zeros(len(log.evidence.z0)) if here == there else log.evidence.change(here, there, mine))
        return self._gathered(each)

    def glance(self, spec: Spec) -> np.ndarray:
        """Return roughly what effects change in the residuals of each log."""
        each = [(log.evidence, self.spec_in(k, spec)) for k, log in enumerate(self.logs)]
        return self._gathered([e.glance(here) if here else np.zeros(len(e.z0)) for e, here in each])

    def raw(self, z: np.ndarray) -> np.ndarray:
        """Return residuals as the windows have them, in units of each window's noise."""
        return self._gathered([log.evidence.raw(z[p]) for log, p in zip(self.logs, self.places, strict=True)])

    def white(self, z: np.ndarray) -> np.ndarray:
        """Return residuals with noise that is independent from window to window."""
        return self._gathered([log.evidence.white(z[p]) for log, p in zip(self.logs, self.places, strict=True)])

    def touched(self, names: Collection[str]) -> list[str]:
        """Return the equations that effects change in any log."""
        here = [[self.plain(name) for name in names if self._is_there(name, k)] for k in range(len(self.logs))]
        found = {e for log, some in zip(self.logs, here, strict=True) for e in log.evidence.touched(some)}
        return [e for e in self.equations if e in found]

    def has(self, name: str) -> bool:
        """Return whether any log has the signals that an effect acts on."""
        return any(self._is_there(name, k) for k in range(len(self.logs)))

    def _is_there(self, name: str, k: int) -> bool:
        """Return whether an effect acts in a log, on something that the log holds."""
        return self.active(name, k) and self.logs[k].evidence.has(self.plain(name))

    def reads(self, channel: str) -> bool:
        """Return whether an equation that is tested reads a channel."""
        return any(log.evidence.reads(channel) for log in self.logs)

    def pieces(self) -> tuple[np.ndarray, int]:
        """Return the run of each window, which is left out as a whole, and how many there are."""
        each = [log.evidence.pieces() for log in self.logs]
        if sum(n for _, n in each) <= len(self.trajectories):
            return self.block, len(self.trajectories)
        before = np.cumsum([0, *(n for _, n in each)])
        return self._gathered([piece + b for (piece, _), b in zip(each, before, strict=False)]), int(before[-1])

    def freedom(self, spec: Spec) -> float:
        """Return the price of unknown initial memory of runs."""
        return sum(log.evidence.freedom(self.spec_in(k, spec)) for k, log in enumerate(self.logs))

    def reached(self, p: Parameter) -> Parameter:
        """Return a parameter with bounds that any of the logs reaches."""
        return max((log.evidence.reached(p) for log in self.logs), key=lambda within: within.upper)

    def widening(self, spec: Spec) -> np.ndarray | None:
        """Return by how much undoing the lags of sensors widens each window's noise; None without such effects."""
        return self._factors([log.evidence.widening(self.spec_in(k, spec)) for k, log in enumerate(self.logs)])

    def spread(self, spec: Spec, x: np.ndarray) -> np.ndarray | None:
        """Return how wide the noise is under a changed simulator, as a share of what `z` is divided by."""
        return self._factors(
            [log.evidence.spread(self.spec_in(k, spec), self.deviations_in(k, x)) for k, log in enumerate(self.logs)]
        )

    def filtered(self, spec: Spec, z: np.ndarray) -> np.ndarray | None:
        """Return residuals filtered as undoing faults of readings filters their noise; None without such faults."""
        mine = [z[place] for place in self.places]
        each = [log.evidence.filtered(self.spec_in(k, spec), mine[k]) for k, log in enumerate(self.logs)]
        if all(f is None for f in each):
            return None
        return self._gathered([mine[k] if f is None else f for k, f in enumerate(each)])

    def scales_noise(self, spec: Spec) -> bool:
        """Return whether undoing faults of readings changes their noise, which first order takes for evidence."""
        return any(log.evidence.scales_noise(self.spec_in(k, spec)) for k, log in enumerate(self.logs))

    def _factors(self, each: Sequence[np.ndarray | None]) -> np.ndarray | None:
        if all(f is None for f in each):
            return None
        sizes = [len(log.evidence.z0) for log in self.logs]
        return self._gathered([np.ones(n) if f is None else f for f, n in zip(each, sizes, strict=True)])

    def prior(self, name: str) -> float:
        """Return the logarithm of the odds with which an effect is expected."""
        plain = self.plain(name)
        known = max(float(log.evidence.prior(plain)) for log in self.logs)
        return known if name == plain else min(known, float(self.effects[name].prior) + self._odds)

    def column(self, name: str, side: int = 0) -> str:
        """Return the user's name of a signal of the state."""
        source = self.logs[0].evidence
        if source.one_sided and side < len(self.equations):
            asked = self.equations[side]
            source = next(log.evidence for log in self.logs if asked in log.evidence.equations)
            side = source.equations.index(asked)
        return str(source.column(name, side))

    def signals(self) -> dict[str, np.ndarray]:
        """Return the signals that all logs hold, at the centre of each window."""
        each = [{k: v[log.evidence.centre] for k, v in log.evidence.signals().items()} for log in self.logs]
        return {name: self._gathered([s[name] for s in each]) for name in each[0] if all(name in s for s in each)}

    def told(self, equation: str) -> dict[str, np.ndarray]:
        """Return what tells a reader where the windows of an equation lie, by the user's names."""
        if not self.one_sided:
            return {self.column(name): values for name, values in self.state.items()}
        each = [log.evidence.told(equation) if equation in log.evidence.equations else {} for log in self.logs]
        names = dict.fromkeys(name for signals in each for name in signals)
        none = [np.full(len(log.evidence.time), np.nan) for log in self.logs]
        return {n: self._gathered([s.get(n, x) for s, x in zip(each, none, strict=True)]) for n in names}

    @property
    def state(self) -> dict[str, np.ndarray]:
        """The state at each window, by the names of `STATE`; NaN where it has none."""
        if self._state is None:
            each = [log.evidence.state for log in self.logs]
            self._state = {name: self._gathered([s[name] for s in each]) for name in STATE}
        return self._state
