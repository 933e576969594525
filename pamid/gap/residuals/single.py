"""Any actuator's log against any model of one equation, as windows: the evidence of `pamid.estimators.GapDiagnoser`."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import pairwise
from operator import attrgetter
from typing import Any

import numpy as np

from ...effects import Effect, Parameter, Plant
from ...equations.noise import channel_noise
from ...errors import LackingNumberError
from ...remembered import Remembered
from ...signals.paths import steady_path, turns_back
from ...signals.roles import ROLES, STATE_ROLES
from ...simulators.placement import Scales
from ...simulators.port_log import PortLog
from ..settings import LEAST_GAIN
from .on_equation import OUTPUT, SENSED, on_equation
from .protocol import STATE, Spec
from .straight import Straight
from .units import Units
from .window_length import LEAST_WINDOWS

Table = Mapping[str, np.ndarray]
"""Signals by role, see `pamid.effects.Signals`."""

WINDOW = 0.02
_ROLES = {**STATE_ROLES, "u": ROLES["u"]}
MOST_KEPT, MOST_BYTES = 2000, 64 * 2**20  # the bytes are a few dozen memories of a log of ordinary length
MOST_MEMORY = 20.0  # windows: a residual that remembers longer is a gap rather than noise
UNTURNED = -12.0
"""Logarithm of the odds of an effect that follows a path alone which was never seen to turn back."""


class SignalEvidence(Straight):
    """Residuals of one equation under effects that its model leaves out.

    A `pamid.gap.residuals.protocol.ResidualSource` without tolerances, in the units of the log. `scales` are what is
    typical there; effects add to the target where that of the target is negative. `columns` are the user's names of the
    roles, `names` those of the runs, and windows with a row of `without` are left out.
    """

    overlap = 3
    exact = False
    bends = False
    """Any model may be wrong in several small ways at once."""
    sharp: list[slice] = []  # noqa: RUF012 - none, and nobody adds one
    """Windows in which none may be far out: none, where the noise is only guessed."""
    least_gain = 1.5 * LEAST_GAIN
    """Gain in log-likelihood that a first effect must bring at least: how the noise of any target depends on its past
    is not known."""
    log: PortLog
    """The log at the ports of a simulator, where one states the equation."""
    decisive = np.inf
    """Gain in log-likelihood that needs no draws to be believed: none, where the noise is only guessed."""

    def __init__(
        self, table: Table, y: np.ndarray, nominal: Callable[[Table], np.ndarray], codes: np.ndarray, dt: float,
        equation: str, plant: Plant | None = None, scales: Scales | None = None, units: Units | None = None,
        columns: Mapping[str, str] | None = None, names: Sequence[str] | None = None,
        without: np.ndarray | None = None,
    ) -> None:  # fmt: skip
        self.table, self.y, self.nominal = dict(table), y, nominal
        self.scales, self.kind, units = scales or Scales(), equation, units or Units()
        self.placements = on_equation(self.table, equation, self.scales, units, plant)
        self.effects: Mapping[str, type[Effect]] = {name: place.effect for name, place in self.placements.items()}
        self.pace = self.scales.time
        self.dt = dt * self.pace
        edges = [0, *(np.flatnonzero(np.diff(codes)) + 1).tolist(), len(codes)]
        self.borders = np.array(edges[:-1])
        self.n = max(1, min(round(WINDOW / self.dt), len(codes) // LEAST_WINDOWS))
        self.first = np.concatenate(
            [np.arange(a, b - self.n + 1, self.n) for a, b in pairwise(edges) if b - a >= self.n] or [np.zeros(0, int)]
        ).astype(int)
        if without is not None and without.any():
            lost = np.concatenate([[0], np.cumsum(without)])
            self.first = self.first[lost[self.first + self.n] == lost[self.first]]
        self.predicted = np.asarray(self.nominal(self.table), dtype=float)
        # Of the residual, not of the target alone: the inputs' noise comes through the model as well.
        mean, lengths = np.full(self.n, 1.0 / self.n), np.diff(edges)
        power = [channel_noise((y - self.predicted)[a:b], self.n).variance(mean) for a, b in pairwise(edges)]
        self.channel = float(np.sqrt(np.average(power, weights=lengths)))
        self.equations, self.units = [equation], {equation: units.target}
        self.parts = [slice(0, len(self.first))]
        self.run = np.searchsorted(self.borders, self.first, side="right") - 1
        self.block, self.side = self.run, np.zeros(len(self.first), dtype=int)
        self.trajectories = [str(codes[a]) if names is None else str(names[codes[a]]) for a in self.borders]
        self.time = (self.first - self.borders[self.run] + (self.n - 1) / 2) * dt
        self.measured = self._mean(y)
        self.value = self._mean(y - self.predicted)
        self.weights, self.stretch = np.ones(1), 0.3 / self.pace
        self._means: Remembered[np.ndarray] = Remembered(MOST_KEPT)
        self._remembered: Remembered[np.ndarray] = Remembered(MOST_BYTES, attrgetter("nbytes"))
        self.assume(0.0)
        self.J = np.zeros((len(self.first), 0))
        self.free: list[str] = []
        self.skipped: dict[str, str] = {}
        self._touched: dict[str, bool] = {}
        self.centre = centre = self.first + self.n // 2
        empty = np.full(len(self.first), np.nan)
        self.state = {k: self.table[r][centre] if (r := _ROLES.get(k, "")) in self.table else empty for k in STATE}
        self._columns = dict(columns or {})
        self._path: np.ndarray | None = None

    def assume(self, noise: float, left: np.ndarray | None = None) -> None:
        """Set the noise level, and estimate its correlation time from a learner's residual."""
        size = float(np.sqrt(np.mean(np.square(self.value)))) if len(self.value) else 1.0
        self.noise = np.full(len(self.first), max(self.channel, noise, 1e-4 * size, 1e-300))
        self.z0 = self.value / self.noise
        if left is not None and len(left) > 8:
            memory = memory_of(left, self.run)
            self.weights = np.array([1.0 / memory])
            step = self.n * self.dt
            # Enough stretches remain for their signs to be informative.
            stretch = float(np.clip(3.0 * memory * step, 0.3, max(0.3, len(left) * step / 24.0)))
            self.stretch = stretch / self.pace

    @property
    def path(self) -> np.ndarray:
        """The position without reversals by noise: friction would follow every one of them."""
        if self._path is None:
            x = np.asarray(self.table["position"], dtype=float)
            sigma = [channel_noise(x[a:b], self.n).white for a, b in pairwise([*self.borders.tolist(), len(x)])]
            self._path = steady_path(x, self.borders, sigma, self.n)
        return self._path

    def column(self, name: str, side: int = 0) -> str:
        """Return the user's name of a signal of the state."""
        role = _ROLES.get(name, name)
        return self._columns.get(role, role)

    def _mean(self, x: np.ndarray) -> np.ndarray:
        if not len(self.first):
            return np.zeros(0)
        sums = np.concatenate([[0.0], np.cumsum(x - np.mean(x))])
        return (sums[self.first + self.n] - sums[self.first]) / self.n + np.mean(x)

    @staticmethod
    def raw(z: np.ndarray) -> np.ndarray:
        """Return residuals as they are: the autocorrelation of the noise is not known."""
        return z

    white = raw

    def tangent(self, spec: Spec, x: np.ndarray) -> np.ndarray:
        """Return the residuals with effects added, in units of the noise; there are no tolerances."""
        return self.z(spec) if spec else self.z0

    def change(self, spec: Spec, about: Spec, x: np.ndarray) -> np.ndarray:
        """Return by how much the residuals change from effects to others, at deviations x."""
        return self.tangent(spec, x) - self.tangent(about, x)

    def prior(self, name: str) -> float:
        """Return the logarithm of the odds with which an effect is expected.

        On a muscle it is the library's. Elsewhere drag is as likely as any friction; but an effect of a path that never
        reverses could be any function of time.
        """
        effect = self.effects[name]
        if self.scales.position == 1.0:
            return effect.prior
        if effect.follows_path() and not turns_back(self.path, self.borders):
            return min(effect.prior, UNTURNED)
        return 0.0 if "bench" in effect.kinds else effect.prior

    # --- effects --------------------------------------------------------------------------------------------
    def added(self, spec: Spec) -> np.ndarray:
        """Return what effects add to the modelled target at each sample."""
        return self.added_by([self.effects[name](**values) for name, values in spec.items()])

    def added_by(self, effects: Sequence[Effect]) -> np.ndarray:
        """Return what effects, with values in the library's units, add to the modelled target at each sample."""
        table, base, places = dict(self.table), self.predicted, self.placements
        faults = tuple(e for e in effects if SENSED.get(e.channel) in self.table)
        for effect in faults:
            role = SENSED[effect.channel]
            table[role] = places[effect.name].truth(effect, table[role], self.dt / self.pace, self.borders)
        if faults:
            with np.errstate(all="ignore"):
                base = np.asarray(self.nominal(table), dtype=float)
        holding = tuple(e for e in effects if type(e).braid_pressure is not Effect.braid_pressure)
        braid = self._on_braid(holding, table) if any(e.on_braid for e in effects) else table
        total = np.array(base, dtype=float)
        for effect in effects:
            seen, through = (braid, (*faults, *holding)) if effect.on_braid else (table, faults)
            added = self._remembered.get((through, effect), partial(self._hooks, effect, seen, through))
            total += self.scales.target * added
        for effect in effects:
            if effect.channel == OUTPUT[self.kind]:
                total = places[effect.name].reading(effect, total, self.dt / self.pace, self.borders)
        return total - self.predicted

    def _on_braid(self, holding: Sequence[Effect], table: Table) -> Table:
        """Return the signals with the pressure that acts on the braid."""
        for effect in holding:
            place = self.placements[effect.name]
            s = place.signals(table)
            table = {**table, "pressure": np.asarray(effect.braid_pressure(s, place.plant), dtype=float)}
        return table

    def reach(self, spec: Spec) -> np.ndarray:
        """Return the share of a small addition to the model that reaches each window's reading; none if slack."""
        bending = {k: v for k, v in spec.items() if self.effects[k].channel == OUTPUT[self.kind]}
        straight = {k: v for k, v in spec.items() if k not in bending}
        total = self.predicted + (self.added(straight) if straight else 0.0)
        small = 1e-4 * float(np.std(self.y)) + 1e-12
        passed = np.ones(len(total))
        for place, effect in ((self.placements[k], self.effects[k](**v)) for k, v in bending.items()):
            if not effect.n_states:
                before, after = (place.reading(effect, x, self.dt, self.borders) for x in (total, total + small))
                passed, total = passed * (after - before) / small, before
        return self._mean(passed)

    def reached(self, p: Parameter) -> Parameter:
        """Return bounds that the model reaches, beyond which a limit does nothing, and periods in a range."""
        if p.periods:
            return p.over(float(np.ptp(self.table["position"])) if "position" in self.table else 0.0)
        top = float(np.max(np.abs(self.predicted), initial=0.0)) / abs(self.scales.target)
        lower, upper = max(p.lower, 0.05 * top), min(p.upper, top)
        # A limit of another signal than the reading, such as a command's, keeps its own bounds.
        return replace(p, lower=lower, upper=upper, nominal=min(0.6 * top, upper)) if p.idle and lower < upper else p

    def _hooks(self, effect: Effect, table: Table, faults: tuple[Effect, ...]) -> np.ndarray:
        hooks = {"force": {"force"}, "torque": {"force", "torque"}, "flow": {"flow"}}[self.kind]
        if not hooks & set(effect.hooks()):
            return np.zeros(len(self.y))
        place, used = self.placements[effect.name], dict(table)
        if effect.path_dependent and used.get("position") is self.table.get("position"):
            used["position"] = self.path
        # Without a pressure, growth with it is undefined.
        used.setdefault("pressure", np.full(len(self.y), place.plant.atmospheric_pressure))
        s = place.signals(used)
        bent = tuple(effect.values[p.name] for p in effect.parameters if not p.linear)
        x = self._remembered.get(
            (faults, effect.name, bent), lambda: np.asarray(effect.trace(s, place.plant, self.dt, self.borders))
        )
        total: Any = 0.0
        if self.kind == "flow":
            a, b = effect.flow(s, x, place.plant)
            return np.broadcast_to(a + (b * s.pressure_rate if np.any(b) else 0.0), self.y.shape).astype(float)
        for hook in ("force", "torque"):
            if hook in hooks and hook in effect.hooks():
                total = total + getattr(effect, hook)(s, x, place.plant)
        return np.broadcast_to(total, self.y.shape).astype(float)

    def z(self, spec: Spec, deviations: Any = None, equations: Sequence[str] | None = ()) -> np.ndarray:
        """Return the residuals with effects added, in units of the noise; large where the model is not finite."""
        if not spec:
            return self.z0.copy()
        found = self.z0 - self.means(spec) / self.noise
        return np.where(np.isfinite(found), found, 1e3)

    def means(self, spec: Spec) -> np.ndarray:
        """Return what effects add to the modelled target, as means over the windows."""
        key = repr({name: dict(values) for name, values in spec.items()})
        return self._means.get(key, lambda: self._mean(self.added(spec)))

    def touched(self, names: Collection[str]) -> list[str]:
        """Return the equation if any of the effects can be evaluated with the signals at hand and changes it."""
        return [self.kind] if any(self._usable(name) for name in names) else []

    def _usable(self, name: str) -> bool:
        if name not in self._touched:
            effect = self.effects[name]
            needed = set(effect.roles)
            if effect.channel:
                known = SENSED.get(effect.channel) in self.table or effect.channel == OUTPUT[self.kind]
            else:
                known = needed - {"pressure"} <= set(self.table)
            try:
                typical = {p.name: self.reached(p).nominal for p in effect.parameters}
                self._touched[name] = bool(known and np.any(self.added({name: typical})))
            except LackingNumberError:
                self._touched[name] = False
        return self._touched[name]

    def spread(self, spec: Spec, x: np.ndarray) -> np.ndarray | None:
        """Return None: the noise of the target is the same under any model."""
        return None

    def deviated(self, deviations: Mapping[str, float]) -> None:
        """Return None: the owner of the equation says how its simulator is corrected."""

    def corrected(self, spec: Spec, deviations: Mapping[str, float] | None = None) -> None:
        """Return None, see `deviated`."""

    def signals(self) -> dict[str, np.ndarray]:
        """Return the signals at each row, by the user's names."""
        return {self._columns.get(role, role): x for role, x in self.table.items()}

    def stepped(self) -> None:
        """Return None: one equation is not integrated."""

    def pieces(self) -> tuple[np.ndarray, int]:
        """Return the run of each window, which is left out as a whole, and how many there are."""
        return self.block, len(self.trajectories)

    def freedom(self, spec: Spec) -> float:
        """Return the price of unknown initial memory of runs: here it is taken as settled."""
        return 0.0

    def widening(self, spec: Spec) -> np.ndarray | None:
        """Return None: lags are applied to the model, not removed from the measurement."""
        return None


def memory_of(x: np.ndarray, run: np.ndarray) -> float:
    """Return the correlation length of a residual in windows: the sum of its autocorrelation."""
    x = x - np.mean(x)
    power = float(np.mean(np.square(x)))
    total, lag = 1.0, 1
    while power > 0.0 and lag < min(len(x) // 4, 200):
        same = run[lag:] == run[:-lag]
        if not same.any():
            break
        rho = float(np.mean((x[lag:] * x[:-lag])[same])) / power
        if rho < 0.05:
            break
        total += 2.0 * rho
        lag += 1
    return min(total, MOST_MEMORY)
