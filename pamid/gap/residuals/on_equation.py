"""One equation of an actuator under the effects of the library, and what is typical of its log."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from itertools import pairwise
from operator import attrgetter
from typing import Any

import numpy as np

from ...constants import ATMOSPHERIC_PRESSURE
from ...effects import Effect, Parameter, Plant, all_effects
from ...equations.noise import channel_noise
from ...remembered import Remembered
from ...signals.paths import steady_path
from ...signals.state import ROLES
from ...simulators.placement import Placement, Scales
from ...simulators.placing import GAP, STRAIN
from ...simulators.sizes import SignalSizes, typical_second
from .protocol import Active
from .units import Units, powers_of
from .window_length import LEAST_WINDOWS

Table = Mapping[str, np.ndarray]
"""Signals by role, see `pamid.effects.Signals`."""
OUTPUT = {"force": "F", "torque": "F", "flow": "mdot"}
"""For each kind of target the sensor channel that measures it."""
HOOKS = {"force": ("force",), "torque": ("force", "torque"), "flow": ("flow",)}
"""For each kind of target the hooks of effects that add to it."""
SENSED = {channel: ROLES[channel] for channel in ("P", "q")}
"""For each sensor channel of an input its role."""
_READ = {"F": "N", "mdot": "kg", "P": "Pa", "q": "rad"}  # the word for its reading in units of the library
_PRESSURE = {"force": 5e5, "torque": 5e5, "flow": 2e3}  # Pa; of a flow that is not in pascal: a head
_MOST_BYTES = 64 * 2**20  # a few dozen memories of a log of ordinary length
WINDOW = 0.02
"""Length of a window, s, in a log of usual length."""


class OnEquation:
    """One equation on the rows of a log, under effects that its model leaves out.

    `table` holds signals by role, `nominal` takes such a table and returns the modelled target; `usual` returns it for
    another number of rows, where columns without a role are as usual. Runs begin at the rows `starts`. In a `sense` of
    1 effects subtract from the target, as friction does from what an actuator delivers; in one of -1 they add to it.
    """

    def __init__(
        self, table: Table, nominal: Callable[[Table], np.ndarray], dt: float, starts: np.ndarray, equation: str,
        plant: Plant | None = None, units: Units | None = None, sense: int = 1,
        usual: Callable[[int], Callable[[Table], np.ndarray]] | None = None,
    ) -> None:  # fmt: skip
        self.table, self.nominal, self.dt, self.starts, self.kind = dict(table), nominal, dt, starts, equation
        self.plant, self.units, self.sense = plant, units or Units(), sense
        self.usual = usual
        self.predicted = np.asarray(nominal(self.table), dtype=float)
        self._remembered: Remembered[np.ndarray] = Remembered(_MOST_BYTES, attrgetter("nbytes"))
        self._path: np.ndarray | None = None

    def on(self, table: Table, starts: np.ndarray) -> OnEquation:
        """Return the equation on other rows."""
        nominal = self.nominal if self.usual is None else self.usual(len(next(iter(table.values()))))
        return OnEquation(table, nominal, self.dt, starts, self.kind, self.plant, self.units, self.sense, self.usual)

    def join(self, other: OnEquation) -> None:
        """Take the sense of effects from another equation on the log, and share what depends on its signals alone."""
        self.sense, known = other.sense, other.table
        apart = self._remembered is not other._remembered
        if apart and all(np.array_equal(x, known[k]) for k, x in self.table.items()):
            self._remembered, self._path = other._remembered, other._path

    @property
    def window(self) -> int:
        """Samples in a window."""
        n = len(self.predicted)
        second = typical_second(float(np.median(np.diff([*self.starts, n]))) * self.dt, self.dt)
        return max(1, min(round(WINDOW / self.dt / second), n // LEAST_WINDOWS))

    @property
    def path(self) -> np.ndarray:
        """The position without reversals by noise: friction would follow every one of them."""
        if self._path is None:
            x, n = np.asarray(self.table["position"], dtype=float), self.window
            sigma = [channel_noise(x[a:b], n).white for a, b in pairwise([*self.starts.tolist(), len(x)])]
            self._path = steady_path(x, self.starts, sigma, n)
        return self._path

    # --- where effects act ------------------------------------------------------------------------------------
    def placements(self, scales: Scales, sizes: SignalSizes | None = None) -> dict[str, Placement]:
        """Return where each effect of the library acts on the equation, by name, bounded by the given signal sizes."""
        table, flow = self.table, self.kind == "flow"
        gauge = "pressure" in table and _is_gauge(scales.pressure * table["pressure"])
        # What leaks depends on the absolute pressure.
        lacks = ATMOSPHERIC_PRESSURE if gauge and self.plant is None and flow else 0.0
        scales = replace(scales, offset=lacks, ambient=ATMOSPHERIC_PRESSURE if lacks or not gauge else 0.0)
        found = {}
        for name, effect in all_effects().items():
            enters, at, own = "output", self.kind, scales
            powers = {p.name: p.position for p in effect.parameters}
            if "measure" in effect.hooks():
                powers = {p.name: powers_of(p.unit).get(_READ[effect.channel], 0) for p in effect.parameters}
                if effect.channel in SENSED:
                    enters, at = "input", SENSED[effect.channel]
                    own = replace(scales, target=1.0 / scales.pressure if at == "pressure" else 1.0)
            elif effect.site == "joint":
                own = replace(own, position=1.0)
            told = {p.name: self.units.of(effect, p) for p in effect.parameters}
            follows = {role: role for role in (*table, *effect.roles) if role != "time"} | {"pressure": "pressure"}
            changes: dict[str, Any] = {}
            of_motion = any(p.periods or p.refines for p in effect.parameters)
            if sizes is not None and (of_motion or effect.channel == OUTPUT[self.kind]):
                changes["parameters"] = tuple(_shown(p, sizes, self.kind, own) for p in effect.parameters)
            if scales.position != 1.0 and "bench" in effect.kinds:  # drag is as likely as any friction elsewhere
                changes["prior"] = 0.0
            bound = effect.narrowed(**changes) if changes else effect
            found[name] = Placement(name, name, "", bound, enters, at, follows, own, powers, told, numbers=self.plant)
        return found

    def holds(self, effect: type[Effect]) -> bool:
        """Return whether the signals that an effect reads are there; without a pressure, growth with it is none."""
        if effect.channel:
            return effect.channel == OUTPUT[self.kind] or SENSED.get(effect.channel) in self.table
        return set(effect.roles) - {"pressure"} <= set(self.table)

    # --- what they do -----------------------------------------------------------------------------------------
    def modelled(self, active: Active) -> np.ndarray:
        """Return the target that a sensor reads under effects, at each row."""
        table, base, starts = dict(self.table), self.predicted, self.starts
        faults = [(p, e) for p, e in active if p.enters == "input" and p.at in table]
        for place, effect in faults:
            table[place.at] = place.truth(effect, table[place.at], self.dt, starts)
        if faults:
            with np.errstate(all="ignore"):
                base = np.asarray(self.nominal(table), dtype=float)
        holding = [(p, e) for p, e in active if type(e).braid_pressure is not Effect.braid_pressure]
        braid = table
        for place, effect in holding if any(e.on_braid for _, e in active) else ():
            s = place.signals(braid)
            braid = {**braid, "pressure": np.asarray(effect.braid_pressure(s, place.plant), dtype=float)}
        total = np.array(base, dtype=float)
        for place, effect in active:
            seen, through = (braid, (*faults, *holding)) if effect.on_braid else (table, faults)
            key = tuple(e for _, e in through), effect
            total += self.sense * self._remembered.get(key, lambda: self._added(place, effect, seen, key[0]))  # noqa: B023
        return self.read(active, total)

    def read(self, active: Active, total: np.ndarray, memory: bool = True) -> np.ndarray:
        """Return the sensor's reading of the true target; faults with memory may be left out."""
        for place, effect in active:
            if effect.channel == OUTPUT[self.kind] and (memory or not effect.n_states):
                total = place.reading(effect, total, self.dt, self.starts)
        return total

    def _added(self, place: Placement, effect: Effect, table: Table, faults: tuple[Effect, ...]) -> np.ndarray:
        hooks = [hook for hook in HOOKS[self.kind] if hook in effect.hooks()]
        shape = self.predicted.shape
        if not hooks:
            return np.zeros(shape)
        used = dict(table)
        if effect.path_dependent and used.get("position") is self.table.get("position"):
            used["position"] = self.path
        used.setdefault("pressure", np.full(shape, place.plant.atmospheric_pressure))  # growth with it is undefined
        s, dt = place.signals(used), self.dt * place.scales.time
        bent = tuple(effect.values[p.name] for p in effect.parameters if not p.linear)
        x = self._remembered.get(
            (faults, effect.name, bent), lambda: np.asarray(effect.trace(s, place.plant, dt, self.starts))
        )
        if hooks == ["flow"]:
            a, b = effect.flow(s, x, place.plant)
            total = a + (b * s.pressure_rate if np.any(b) else 0.0)
        else:
            total = sum(getattr(effect, hook)(s, x, place.plant) for hook in hooks)
        return np.broadcast_to(place.scales.target * total, shape).astype(float)


def _is_gauge(pressure: np.ndarray) -> bool:
    """Return whether pressures are gauge pressures: absolute ones are not far below the ambient pressure."""
    return len(pressure) > 0 and float(np.min(pressure)) < 0.5 * ATMOSPHERIC_PRESSURE


def _shown(p: Parameter, sizes: SignalSizes, kind: str, scales: Scales) -> Parameter:
    """Return bounds that the model reaches, beyond which a limit does nothing, and periods in a range."""
    if p.periods or p.refines:
        return p.over(sizes.spans.get("position", 0.0), scales.speed(sizes.spans.get("velocity", 0.0)))
    top = sizes.tops[kind] / scales.target
    lower, upper = max(p.lower, 0.05 * top), min(p.upper, top)
    within = p.idle and lower < upper
    return replace(p, lower=lower, upper=upper, nominal=min(max(0.6 * top, lower), upper)) if within else p


def scales_of(sizes: SignalSizes, position: float, equation: str, muscle: bool) -> Scales:
    """Return the typical sizes of a log's signals by role; for a known muscle, the units of the library."""
    if muscle:
        return Scales(position=position)
    top = sizes.tops.get("pressure", 0.0)
    return Scales(
        position=position,
        time=sizes.time,
        pressure=_PRESSURE[equation] / top if 0.0 < top < 2e4 else 1.0,
        target=sizes.gaps[equation] / GAP["flow" if equation == "flow" else "force"] or 1.0,
    )


def strain_scale(span: float, contraction: bool) -> float:
    """Return the position scale: one for a contraction ratio, else five times the range."""
    return 1.0 if contraction or span == 0.0 else span / STRAIN
