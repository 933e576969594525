"""Any actuator's log against any model of one equation, as windows: the evidence of `pamid.estimators.GapDiagnoser`."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from ..constants import ATMOSPHERIC_PRESSURE
from ..effects import Effect, Plant, Signals, all_effects, make_effect
from ..equations.noise import channel_noise
from .evidence import STATE, Spec

Table = Mapping[str, np.ndarray]
"""Signals by role, see `pamid.effects.Signals`."""

OUTPUT = {"force": ("F", "force"), "torque": ("F", "force"), "flow": ("mdot", "flow")}
"""For each kind of target the sensor channel that measures it and its role."""
INPUTS = {"P": "pressure", "q": "position"}
"""For each sensor channel of an input its role."""
WINDOW = 0.02
_ROLES = {"eps": "position", "deps": "velocity", "P": "pressure", "dP": "pressure_rate", "u": "command"}
_STRAIN = 0.2  # range that the position of a muscle typically covers; others are scaled to it


class _Ambient:
    """What is known of a bench without its numbers: the ambient pressure, 0 if the pressures are gauge pressures."""

    def __init__(self, pressure: np.ndarray | None) -> None:
        gauge = pressure is not None and len(pressure) > 0 and float(np.min(pressure)) < 0.5 * ATMOSPHERIC_PRESSURE
        self.atmospheric_pressure = 0.0 if gauge else ATMOSPHERIC_PRESSURE


class SignalEvidence:
    """Residuals of one equation under effects that its model leaves out.

    It has what the search over the library reads of `pamid.gap.evidence.Evidence`.

    Parameters
    ----------
    table : mapping of str to array, shape (n_samples,)
        Signals by role; ``position`` in the user's unit.
    y : array, shape (n_samples,)
        Measured target.
    nominal : callable
        Takes a table of signals, returns the modelled target.
    codes : array of int, shape (n_samples,)
        Trajectory of each row; contiguous.
    dt : float
        Sampling interval, s.
    equation : str
        ``"force"``, ``"torque"`` or ``"flow"``: which hooks of an effect add to the target.
    plant : Plant, optional
        Numbers of the bench; effects that need them are left out without.
    position_scale : float
        Length (or angle) that counts as a strain of one.
    floor : float, default=0.0
        Standard deviation of what no model of these signals predicts, in the target's unit.
    columns : mapping of str to str, optional
        The user's name of each role, for what is written about it.
    """

    def __init__(
        self,
        table: Table,
        y: np.ndarray,
        nominal: Callable[[Table], np.ndarray],
        codes: np.ndarray,
        dt: float,
        equation: str,
        plant: Plant | None = None,
        position_scale: float = 1.0,
        floor: float = 0.0,
        columns: Mapping[str, str] | None = None,
    ) -> None:
        self.table, self.y, self.nominal, self.dt = dict(table), y, nominal, dt
        self.plant: Any = plant or _Ambient(self.table.get("pressure"))
        self.scale, self.kind = position_scale, equation
        edges = [0, *(np.flatnonzero(np.diff(codes)) + 1).tolist(), len(codes)]
        self.borders = np.array(edges[:-1])
        self.n = max(1, round(WINDOW / dt))
        self.first = np.concatenate(
            [np.arange(a, b - self.n + 1, self.n) for a, b in pairwise(edges) if b - a >= self.n] or [np.zeros(0, int)]
        ).astype(int)
        self.predicted = np.asarray(nominal(self.table), dtype=float)
        white = [channel_noise(y[a:b], self.n).white for a, b in pairwise(edges)]
        self.channel = float(np.sqrt(np.average(np.square(white), weights=np.diff(edges)) / self.n))
        self.equations, self.units = [equation], {equation: ""}
        self.parts = [slice(0, len(self.first))]
        self.run = np.searchsorted(self.borders, self.first, side="right") - 1
        self.block, self.side = self.run, np.zeros(len(self.first), dtype=int)
        self.trajectories = [str(codes[a]) for a in self.borders]
        self.time = (self.first - self.borders[self.run] + (self.n - 1) / 2) * dt
        self.measured = self._mean(y)
        value = self._mean(y - self.predicted)
        size = float(np.sqrt(np.mean(np.square(value)))) if len(value) else 1.0
        self.noise = np.full(len(self.first), max(float(np.hypot(self.channel, floor)), 1e-4 * size, 1e-300))
        self.z0 = value / self.noise
        self.J = np.zeros((len(self.first), 0))
        self.free: list[str] = []
        self.skipped: dict[str, str] = {}
        self._touched: dict[str, bool] = {}
        centre = self.first + self.n // 2
        empty = np.full(len(self.first), np.nan)
        self.state = {k: self.table[r][centre] if (r := _ROLES.get(k, "")) in self.table else empty for k in STATE}
        self._columns = dict(columns or {})

    def column(self, name: str) -> str:
        """Return the user's name of a signal of the state."""
        role = _ROLES.get(name, name)
        return self._columns.get(role, role)

    def _mean(self, x: np.ndarray) -> np.ndarray:
        if not len(self.first):
            return np.zeros(0)
        sums = np.concatenate([[0.0], np.cumsum(x - np.mean(x))])
        return (sums[self.first + self.n] - sums[self.first]) / self.n + np.mean(x)

    # --- effects --------------------------------------------------------------------------------------------
    def added(self, spec: Spec) -> np.ndarray:
        """Return what effects add to the modelled target at each sample."""
        effects = [make_effect(name, **values) for name, values in spec.items()]
        table = dict(self.table)
        for effect in effects:
            role = INPUTS.get(effect.channel)
            if role in table:
                table[role] = np.asarray(effect.restore(table[role], self.dt, self.borders), dtype=float)
        changed = any(INPUTS.get(e.channel) in self.table for e in effects)
        base = np.asarray(self.nominal(table), dtype=float) if changed else self.predicted
        total = base + sum((self._hooks(e, table) for e in effects), start=np.zeros(len(base)))
        for effect in effects:
            channel, role = OUTPUT[self.kind]
            if effect.channel == channel:
                x = None
                if effect.n_states:
                    x = effect.trace(Signals(**{role: total}), self.plant, self.dt, self.borders)
                total = np.asarray(effect.measure(total, x), dtype=float)
        return total - self.predicted

    def _hooks(self, effect: Effect, table: Table) -> np.ndarray:
        hooks = {"flow"} if self.kind == "flow" else {"force", "torque"}
        if not hooks & set(effect.hooks()):
            return np.zeros(len(self.y))
        scale = 1.0 if effect.site == "joint" else self.scale
        used = dict(table)
        for role in ("position", "velocity"):
            if role in used:
                used[role] = used[role] / scale
        # Without a pressure, what grows with it has nothing to grow with.
        used.setdefault("pressure", np.full(len(self.y), self.plant.atmospheric_pressure))
        s = Signals(**used)
        x = effect.trace(s, self.plant, self.dt, self.borders)
        total: Any = 0.0
        if self.kind == "flow":
            a, b = effect.flow(s, x, self.plant)
            return np.broadcast_to(a + (b * used["pressure_rate"] if np.any(b) else 0.0), self.y.shape).astype(float)
        for hook in ("force", "torque"):
            if hook in effect.hooks():
                total = total + getattr(effect, hook)(s, x, self.plant)
        return np.broadcast_to(total, self.y.shape).astype(float)

    def z(self, spec: Spec, deviations: Any = None, equations: Sequence[str] | None = ()) -> np.ndarray:
        """Return the residuals with effects added, in units of the noise."""
        if not spec:
            return self.z0.copy()
        return self.z0 - self._mean(self.added(spec)) / self.noise

    def touched(self, names: Collection[str]) -> list[str]:
        """Return the equation if any of the effects can be evaluated with the signals at hand and changes it."""
        return [self.kind] if any(self._usable(name) for name in names) else []

    def _usable(self, name: str) -> bool:
        if name not in self._touched:
            effect = all_effects()[name]
            needed = set(effect.roles)
            if effect.channel:
                needed = {INPUTS.get(effect.channel, OUTPUT[self.kind][1])}
                known = INPUTS.get(effect.channel) in self.table or effect.channel == OUTPUT[self.kind][0]
            else:
                known = needed - {"pressure"} <= set(self.table)
            try:
                self._touched[name] = bool(known and np.any(self.added({name: make_effect(name).values})))
            except (TypeError, AttributeError, KeyError):  # it reads a signal or a number that is not there
                self._touched[name] = False
        return self._touched[name]

    def widening(self, spec: Spec) -> np.ndarray | None:
        """Return None: lags are put on the model, not taken off the measurement."""
        return None


def explainable_floor(
    table: Table, residual: np.ndarray, codes: np.ndarray, dt: float, seed: int = 0
) -> tuple[float, np.ndarray]:
    """Return what a flexible learner on the same signals and their past leaves of a residual, and its predictions.

    Trajectories are held out; a single one is cut into five pieces of time.

    Parameters
    ----------
    table : mapping of str to array
        Signals by role.
    residual : array, shape (n_samples,)
        Measured minus modelled.
    codes : array of int, shape (n_samples,)
        Trajectory of each row.
    dt : float
        Sampling interval, s.
    seed : int, default=0
        Seed of the learner.
    """
    from sklearn.ensemble import HistGradientBoostingRegressor
    from sklearn.model_selection import GroupKFold, cross_val_predict

    borders = np.concatenate([[0], np.flatnonzero(np.diff(codes)) + 1, [len(codes)]])
    start = np.repeat(borders[:-1], np.diff(borders))
    rows = np.arange(len(codes))
    columns = []
    for role, x in table.items():
        if role == "time":
            continue
        columns.append(x)
        columns += [x[np.maximum(rows - max(1, round(lag / dt)), start)] for lag in (0.02, 0.1, 0.5)]
    step = max(1, len(rows) // 20_000)
    keep = rows[::step]
    X = np.column_stack(columns)[keep]
    groups = codes[keep]
    if len(np.unique(groups)) < 2:
        groups = (5 * np.arange(len(keep))) // max(len(keep), 1)
    folds = min(5, len(np.unique(groups)))
    if folds < 2 or len(keep) < 50:
        return 0.0, np.zeros(len(codes))
    learner = HistGradientBoostingRegressor(max_iter=80, min_samples_leaf=50, random_state=seed)
    predicted = cross_val_predict(learner, X, residual[keep], groups=groups, cv=GroupKFold(folds))
    left = float(np.sqrt(np.mean(np.square(residual[keep] - predicted))))
    whole = np.interp(rows, keep, predicted)
    return min(left, float(np.sqrt(np.mean(np.square(residual))))), whole


def strain_scale(position: np.ndarray) -> float:
    """Return the length that counts as a strain of one: five times the range, or one for a contraction ratio."""
    span = float(np.ptp(position)) if len(position) else 0.0
    return 1.0 if 0.0 < span <= 0.5 and np.max(np.abs(position)) < 1.0 else span / _STRAIN if span > 0 else 1.0
