"""Parameters within their tolerances: sensitivities, and starting values where tolerances are wide.

Where tolerances are so wide that sensitivities vary within them, they are relinearised at each fit, under the effects
at that point.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence

import numpy as np

from ...remembered import Remembered
from ...simulators.base import Simulator
from ...simulators.placement import Placement
from ..inference.descent import Bounds, Prior, descend
from ..inference.student_t import loglik, solve
from ..settings import TOLERANCE
from .between_rows import METHODS, TIMINGS
from .port_signals import PortSignals
from .protocol import Active, Spec
from .whitening import Whitening

LAYINGS, STRAIGHT, SMALL, MOST_LAID = 40, 0.1, 0.05, 24
"""Most times that the tolerances are relinearised, how straight it must be not to need it, the
share of a tolerance that is a small change then; linear models that are kept."""
CURVED = 0.3
"""Share by which what parameters do differs between where they are given and where they fit, from which responses known
at other values are not reused; the same causes come of half and of twice as much (``benchmarks/settings.py
--computed``)."""


class Tolerances(PortSignals, ABC):
    """Sensitivities of residuals to a simulator's free parameters."""

    given: Simulator
    free: list[str]
    about: np.ndarray
    z0: np.ndarray
    J: np.ndarray
    noise: np.ndarray
    weights: np.ndarray
    _own: Active
    skews: dict[str, np.ndarray]
    twins: Mapping[str, str]
    placements: Mapping[str, Placement]
    _kept: Remembered[np.ndarray]
    _laid: Remembered[np.ndarray]
    _timings: Remembered[dict[str, np.ndarray]]
    _whitening: Whitening
    curved = False

    # --- what a subclass says -------------------------------------------------------------------------------
    @abstractmethod
    def _residual(
        self, active: Active, numbers: np.ndarray, channels: Mapping[str, np.ndarray] | None = None
    ) -> np.ndarray:
        """Return measured less modelled at every window, under effects, numbers and, if given, other readings."""

    @abstractmethod
    def _again(self) -> None:
        """Clear caches of the simulator with other parameters."""

    # --- residuals of a simulator with other numbers --------------------------------------------------------
    def numbers(self, deviations: Mapping[str, float] | None) -> np.ndarray:
        """Return the parameters changed by multiples of their tolerances."""
        out = self.simulator.numbers
        for k, (name, p) in enumerate(self.given.parameters.items()):
            out[k] += p.value * p.tolerance * (deviations or {}).get(name, 0.0)
        return out

    def active(self, spec: Spec) -> Active:
        """Return the simulator's own effects and those of a spec, made."""
        return [*self._own, *((self.placements[k], self.placements[k].effect(**v)) for k, v in spec.items())]

    def z(
        self, spec: Spec, deviations: Mapping[str, float] | None = None, equations: Sequence[str] | None = ()
    ) -> np.ndarray:
        """Return the residuals under effects and changed parameters, in units of the noise and white."""
        if not spec and not any((deviations or {}).values()):
            return self.z0.copy()
        known = {k: dict(v) for k, v in spec.items()}, self._asks_anew(deviations or {})
        active = self.active(spec)
        found = self._kept.get(repr(known), lambda: self._bare(active, deviations or {}))
        return self._whitening.white(
            self._finite(found + self._skewed(deviations or {}, active)) / self._noise_as(active)
        )

    def _asks_anew(self, deviations: Mapping[str, float]) -> dict[str, float]:
        """Return the deviations that need new residuals: clocks act linearly."""
        return {k: v for k, v in deviations.items() if v and k not in self.skews}

    def _moved_by(self, steps: Sequence[np.ndarray], x: np.ndarray, active: Active) -> list[np.ndarray]:
        """Return what steps of the tolerances from deviations x change, in the units of the equations."""
        here, *there = (self._finite(self._bare(active, self._named(v))) for v in (x, *(x + step for step in steps)))
        return [one - here for one in there]

    def _bare(self, active: Active, deviations: Mapping[str, float]) -> np.ndarray:
        """Return the same without clock offsets; not finite where the simulator is not."""
        with np.errstate(all="ignore"):
            return self._residual(active, self.numbers(deviations))

    def _noise_as(self, active: Active) -> np.ndarray:
        """Return the noise of each window as effects scale it together with readings."""
        return self.noise

    def _finite(self, found: np.ndarray) -> np.ndarray:
        return np.where(np.isfinite(found), found, 1e3 * self.noise)

    # --- what follows ---------------------------------------------------------------------------------------
    def tangent(self, spec: Spec, x: np.ndarray) -> np.ndarray:
        """Return z0 such that z0 + slopes @ x equals the exact residuals at deviations x, in tolerances."""
        return self.z(spec, self._named(x)) - self.slopes(spec, x) @ x

    @property
    def ends(self) -> tuple[np.ndarray, np.ndarray]:
        """The lowest and highest deviations of the free parameters; an integrator's step is never negative."""
        return np.where([name in METHODS for name in self.free], 0.0, -1.0) - self.about, 1.0 - self.about

    def _named(self, x: np.ndarray) -> dict[str, float]:
        """Return deviations by the names of their parameters."""
        return dict(zip(self.free, map(float, x), strict=True))

    def slopes(self, spec: Spec, x: np.ndarray) -> np.ndarray:
        """Return the change of the residuals by one tolerance of each free parameter, under a spec and deviations."""
        found = self.J
        if spec or np.any(x):
            key = repr(({k: dict(v) for k, v in spec.items()}, x.tolist()))
            found = self._laid.get(key, lambda: self._slopes_at(self.active(spec), x))
        within = [k for _, k in self._contained(spec)]
        return np.where(np.isin(np.arange(len(self.free)), within), 0.0, found) if within else found

    def folded(self, spec: Spec, x: np.ndarray) -> tuple[dict[str, dict[str, float]], np.ndarray]:
        """Return the same simulator with the tolerance of each parameter that deviates made part of the deviation."""
        out, x = {name: dict(values) for name, values in spec.items()}, np.array(x, dtype=float)
        for name, k in self._contained(spec):
            tolerance = self.given.parameters[self.free[k]].tolerance
            within = 1.0 + tolerance * (self.about[k] + x[k])
            out[name] = {p: within * (1.0 + v) - 1.0 for p, v in spec[name].items()}
            x[k] = -self.about[k]
        return out, x

    def _contained(self, spec: Spec) -> list[tuple[str, int]]:
        """Return deviations of parameters that have a tolerance: a fit of both would give each any share of the sum."""
        at = [(name, name.removeprefix("parameter_deviation@")) for name in spec]
        return [(name, self.free.index(one)) for name, one in at if one != name and one in self.free]

    # --- what is unknown within a sample ------------------------------------------------------------------------
    def _timed(self, active: Active) -> dict[str, np.ndarray]:
        """Return the columns of when within a sample inputs act, as effects on them pass them on."""
        return {}

    def _passes_on(self, active: Active) -> tuple[Active, set[str]]:
        """Return the effects that pass timings on, and the inputs whose timings they change."""
        on = [(place, made) for place, made in active if place.enters == "input" and not place.acts]
        return on, {place.at for place, _ in on}

    def _skews_under(self, active: Active) -> Mapping[str, np.ndarray]:
        """Return the columns of nuisance parameters under effects, which change the shifted input."""
        on, inputs = self._passes_on(active)
        names = {f"{what} of {name}" for what in TIMINGS for name in inputs} & self.skews.keys()
        still = {name: np.zeros(len(self.noise)) for name in self._delayed(active) & self.skews.keys()}
        if not names:
            return self.skews | still
        key = repr([(place.key, made.values) for place, made in on]) + repr(self.simulator.numbers.tobytes())
        found = self._timings.get(key, lambda: self._timed(on))
        return self.skews | {k: v for k, v in found.items() if k in names and np.all(np.isfinite(v))} | still

    def _delayed(self, active: Active) -> set[str]:
        """Return the timings that a delay contains: a fit of both would give each any share of their sum."""
        sought = [place.key for place, _ in active[len(self._own) :]]
        both = [self.twins.get(key, key) if key.startswith("sensor_") else key for key in sought]
        return {f"{TIMINGS[0]} of {key.partition('@')[2]}" for key in both if key.startswith("actuator_delay@")}

    def _skewed(self, deviations: Mapping[str, float], active: Active) -> np.ndarray | float:
        """Return the contribution of nuisance parameters to the residuals; it is linear in them."""
        about = dict(zip(self.free, self.about, strict=True))
        sizes = {k: about[k] + deviations.get(k, 0.0) for k in self.skews}
        skews = self._skews_under(active) if any(sizes.values()) else self.skews
        return sum((column * sizes[k] for k, column in skews.items() if sizes[k]), 0.0)

    def _slopes_at(self, active: Active, x: np.ndarray, step: float = SMALL) -> np.ndarray:
        """Return the slopes under effects and deviations, by small steps."""
        skews = self._skews_under(active)
        steps = [step * e for e, name in zip(np.eye(len(self.free)), self.free, strict=True) if name not in skews]
        found = iter(self._moved_by(steps, x, active) if steps else [])
        columns = [skews[name] if name in skews else next(found) / step for name in self.free]
        return self._whitening.white((np.array(columns).reshape(-1, len(self.noise)) / self._noise_as(active)).T)

    def _deviated(self, x: np.ndarray) -> np.ndarray:
        return self.z({}, self._named(x))

    def _bends(self) -> bool:
        """Start from the best fit of wide tolerances if residuals are nonlinear on the way; return whether they are."""
        x = np.zeros(len(self.free))
        least = loglik(self.z0, self.parts, self.weights)[0]
        low, high = self.ends
        step = solve(self.z0, self.J, low, high, self.parts, self.weights).x
        there = self._deviated(step)
        linear, moved = self.J @ step, there - self.z0
        straight = rms(moved - linear) <= min(STRAIGHT * rms(linear), 1.0)  # in shares, and in noise
        if straight and loglik(there, self.parts, self.weights)[0] > least:
            return False
        bounds = Bounds.of(low, high)
        prior = Prior(-self.about, np.full(len(x), TOLERANCE))

        def slopes(x: np.ndarray) -> np.ndarray:
            return self._slopes_at(self._own, x)

        x = descend(self._deviated, slopes, x, lambda _: bounds, self.parts, self.weights, LAYINGS, prior).x
        if not np.any(x):
            return False
        self._begin_from(x)
        return True

    def _begin_from(self, x: np.ndarray) -> None:
        """Change the simulator's parameters by multiples of their tolerances, from here on."""
        numbers = self.numbers(self._named(x))
        self.simulator = self.simulator.with_(dict(zip(self.simulator.parameters, map(float, numbers), strict=True)))
        self.about = self.about + x


def differ(before: np.ndarray, after: np.ndarray) -> bool:
    """Return whether sensitivities differ between the given and the fitted parameters."""
    return rms((after - before).ravel()) > CURVED * rms(before.ravel())


def rms(x: np.ndarray) -> float:
    """Return the root mean square; 0 of nothing."""
    return float(np.sqrt(np.mean(np.square(x)))) if len(x) else 0.0


def typical(rate: np.ndarray) -> float:
    """Return the size of a relevant change of a rate: a share of how it varies, or of one that stands still."""
    varies, size = float(np.std(rate)), rms(rate)
    return 0.3 * (varies if varies > 1e-9 * size else size)
