"""Refit a simulator with effects: tolerances and all parameters of the effects together, by Gauss–Newton."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from ...effects import Effect, Parameter
from ..residuals.protocol import ResidualSource, Spec
from ..settings import TOLERANCE
from .descent import BROYDEN, Bounds, Prior, descend
from .rough import compass, longer
from .sensitivity import adds
from .student_t import RobustFit, solve

SLACK = 1.005
"""How far a parameter may be refitted, in tolerances: what is at the very end of its tolerance is no gap yet."""
ROUNDS = 3
"""Most times that the tolerances are relinearised where a fit has come to."""
NEAR = 0.03
"""Move of the tolerances, in their unit, that needs no new one."""
MIX = 0.4
"""How far a share of another form may go in one step."""
REFINED = 0.05
"""Share of the upper bound that shows what a parameter that refines an effect changes, from 0."""
LAID, FINAL, FINEST = 24, 0.3, 0.01
"""Most steps of a fit that is relinearised as it goes, the gain in nats that ends it, and the one that ends the fit
that is told where slopes vary: sizes are a seventh of a standard error from the best ones."""


@dataclass(frozen=True)
class Fit:
    """A simulator refitted with effects."""

    spec: dict[str, dict[str, float]]
    x: np.ndarray  # deviations of the parameters, in tolerances
    loglik: float
    z: np.ndarray  # residuals, in units of the noise
    scales: np.ndarray  # of the equations' residuals, at least 1
    low: np.ndarray | float = -SLACK
    high: np.ndarray | float = SLACK

    @property
    def inside(self) -> np.ndarray:
        """Which parameters are inside their tolerance; one at its end cannot go further that way."""
        room = 0.001 * SLACK
        return (self.x > self.low + room) & (self.x < self.high - room)


Solved = TypeVar("Solved", Fit, RobustFit)


class Fitter:
    """Fits of one log."""

    def __init__(self, evidence: ResidualSource) -> None:
        self.evidence, self.weights = evidence, evidence.weights
        self.n = evidence.J.shape[1]
        self._steps: dict[tuple[str, ...], float] = {}
        low, high = evidence.ends
        self.low, self.high = low - (SLACK - 1.0), high + (SLACK - 1.0)

    def linear(
        self,
        z0: np.ndarray,
        J: np.ndarray,
        D: np.ndarray | None = None,
        lower: np.ndarray | None = None,
        upper: np.ndarray | None = None,
        prior: np.ndarray | None = None,
        iterations: int = 4,
        start: np.ndarray | None = None,
        soft: np.ndarray | None = None,
        widening: np.ndarray | None = None,
    ) -> RobustFit:
        """Fit tolerances and further columns to residuals."""
        cost = 0.0
        if widening is not None:
            soft = widening if soft is None else soft * widening
            parts = zip(self.evidence.parts, self.weights, strict=True)
            cost = sum(float(w) * float(np.sum(np.log(widening[part]))) for part, w in parts)
        if soft is not None:
            z0, J = z0 / soft, J / soft[:, None]
            D = None if D is None else D / soft[:, None]
        if D is None or lower is None or upper is None:
            found = solve(
                z0, J, self.low, self.high, self.evidence.parts, self.weights, iterations=iterations, start=start
            )
            return found._replace(loglik=found.loglik - cost)
        found = solve(
            z0,
            np.column_stack([J, D]),
            np.concatenate([self.low, lower]),
            np.concatenate([self.high, upper]),
            self.evidence.parts,
            self.weights,
            None if prior is None else np.concatenate([np.zeros(self.n), prior]),
            iterations,
            None if start is None else np.concatenate([start, np.zeros(D.shape[1])]),
        )
        return found._replace(loglik=found.loglik - cost)

    def base(self) -> Fit:
        """Fit the tolerances alone."""
        return self._exact({}, np.zeros(self.n))

    def unwhitened(self, fit: Fit) -> Fit:
        """Refit the tolerances to unwhitened windows, since whitening overweights slow errors."""
        evidence = self.evidence
        if evidence.bends:
            found = self._descended(fit.spec, fit.x, LAID, FINAL, -np.inf, held=True, turned=evidence.raw)
            return replace(fit, x=found.x, z=evidence.white(found.z))

        def solved(x: np.ndarray) -> RobustFit:
            z, J = evidence.raw(evidence.tangent(fit.spec, x)), evidence.raw(evidence.slopes(fit.spec, x))
            return solve(z, J, self.low, self.high, evidence.parts, self.weights, iterations=20, start=x)

        x = _relinearised(fit.x, solved).x
        return replace(fit, x=x, z=evidence.tangent(fit.spec, x) + evidence.slopes(fit.spec, x) @ x)

    def at(self, spec: Spec) -> Fit:
        """Fit the tolerances with effects held at their values."""
        return self._exact({k: dict(v) for k, v in spec.items()}, np.zeros(self.n))

    def approximate(self, spec: Spec, x: np.ndarray) -> float:
        """Return the likelihood of effects at their values, the tolerances near deviations x."""
        z = self.evidence.tangent({}, x) + self.evidence.change(spec, {}, x)
        return self._fit({k: dict(v) for k, v in spec.items()}, z, self.evidence.slopes({}, x), x).loglik

    def promise(self, spec: Spec, x: np.ndarray) -> RobustFit:
        """Return what a first step from effects and deviations x would come to, to first order."""
        slots = slots_of(self.evidence.effects, spec)
        phi, (z, J) = np.array([spec[name][p.name] for name, p in slots]), self._laid(spec, x)
        D, lower, upper = self.jacobian(slots, phi, z, x)
        return self.linear(z, J, D, lower, upper, iterations=6, start=x)

    def _exact(self, spec: dict[str, dict[str, float]], x: np.ndarray) -> Fit:
        """Fit the tolerances, linearised where the fit ends."""
        x = self.evidence.folded(spec, x)[1]
        if self.evidence.bends:
            return self._descended(spec, x, LAID, FINAL, -np.inf, held=True)
        return _relinearised(x, lambda x: self._fit(spec, *self._laid(spec, x), x, 20))

    def refine(
        self,
        spec: Spec,
        steps: int = 6,
        gain: float = 0.3,
        near: np.ndarray | None = None,
        behind: float = -np.inf,
    ) -> Fit:
        """Fit everything, beginning from a spec."""
        spec, x = self.evidence.folded(spec, np.zeros(self.n) if near is None else near)
        if self.evidence.bends:
            if self.evidence.simulates and any(self.evidence.effects[name].holds for name in spec):
                # When a hold begins and ends says little before its size is right.
                begun = {
                    name: dict(self.evidence.effects[name](**values).sharp().values) for name, values in spec.items()
                }
                sized = self._descended(begun, x, LAID, BROYDEN * FINAL, behind, moved=lambda p: p.linear)
                spec, x = sized.spec, sized.x
            return self._descended(spec, x, LAID, min(gain, FINAL), behind)
        found = self._refined(spec, x, steps, gain)
        for _ in range(ROUNDS - 1):
            if np.max(np.abs(found.x - x), initial=0.0) < NEAR or found.loglik < behind:
                break
            x = found.x
            found = self._refined(found.spec, x, 2, gain)
        return found

    def told(self, fit: Fit) -> Fit:
        """Return a fit as it is told: where slopes vary, one whose last step gained little may still be far off."""
        return self._descended(fit.spec, fit.x, LAID, FINEST, -np.inf) if self.evidence.curved else fit

    def _refined(self, spec: Spec, x: np.ndarray, steps: int, gain: float) -> Fit:
        """Fit everything with the tolerances linearised at deviations x."""
        slots = slots_of(self.evidence.effects, spec)
        phi = np.array([float(spec[name].get(p.name, p.nominal)) for name, p in slots])
        z, J = self._laid(_spec(slots, phi), x)
        best = self._fit(_spec(slots, phi), z, J, x)
        damping = 1.0
        for _ in range(steps):
            D, lower, upper = self.jacobian(slots, phi, z, x)
            solved = self.linear(
                z, J, D, lower, upper, iterations=6, start=best.x, widening=self.evidence.widening(best.spec)
            )
            step = solved.x[self.n :]
            while True:
                trial = np.array(
                    [np.clip(v, p.lower, p.upper) for v, (_, p) in zip(phi + damping * step, slots, strict=True)]
                )
                z_trial, J_trial = self._laid(_spec(slots, trial), x)
                found = self._fit(_spec(slots, trial), z_trial, J_trial, best.x)
                if found.loglik > best.loglik or damping < 0.1:
                    break
                damping *= 0.35
            if found.loglik <= best.loglik:
                break
            added, best, phi, z, J = found.loglik - best.loglik, found, trial, z_trial, J_trial
            damping = min(1.0, 2.0 * damping)
            if added < gain:
                break
        return best

    def _descended(
        self, spec: dict[str, dict[str, float]], x: np.ndarray, rounds: int, gain: float, behind: float,
        held: bool = False, turned: Callable[[np.ndarray], np.ndarray] = lambda z: z,
        moved: Callable[[Parameter], bool] = lambda p: True,
    ) -> Fit:  # fmt: skip
        """Fit everything, or tolerances beside fixed effects, each step linearised where the last one ended."""
        evidence, n = self.evidence, self.n
        every = slots_of(evidence.effects, spec)
        slots = [] if held else [(name, p) for name, p in every if moved(p)]
        phi = np.array([np.clip(spec[name].get(p.name, p.nominal), p.lower, p.upper) for name, p in slots], dtype=float)
        ends = np.array([(p.lower, p.upper) for _, p in slots]).reshape(-1, 2)

        def named(y: np.ndarray) -> dict[str, dict[str, float]]:
            if held:
                return spec
            there = {(name, p.name): v for (name, p), v in zip(slots, y[n:], strict=True)}
            return _spec(every, [there.get((k, p.name), spec[k].get(p.name, p.nominal)) for k, p in every])

        def slopes(y: np.ndarray) -> np.ndarray:
            J = evidence.slopes(named(y), y[:n])
            D = self.jacobian(slots, y[n:], J, y[:n], named(y))[0] if slots else np.zeros((len(J), 0))
            return turned(np.column_stack([J, D]))

        def bounds(y: np.ndarray) -> Bounds:
            back, on = _reach(slots, y[n:])
            whole = self.high - self.low
            return Bounds(np.concatenate([self.low, ends[:, 0]]), np.concatenate([self.high, ends[:, 1]]),
                          np.concatenate([whole, -back]), np.concatenate([whole, on]))  # fmt: skip

        def at(y: np.ndarray) -> np.ndarray:
            return turned(evidence.z(named(y), dict(zip(evidence.free, map(float, y[:n]), strict=True))))

        about = evidence.about
        prior = Prior(np.concatenate([-about, 0.0 * phi]), np.concatenate([np.full(n, TOLERANCE), 0.0 * phi]))
        begun, chance = self._begun(slots, phi, x) if slots and evidence.rough else (phi, 0.0)
        start, gain = np.concatenate([x, begun]), max(gain, chance)
        s = descend(at, slopes, start, bounds, evidence.parts, self.weights, rounds, prior, gain, behind)
        return Fit(named(s.x), s.x[:n], s.loglik, s.z, s.scales, self.low, self.high)

    def _laid(self, spec: Spec, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the residuals of a tangent at deviations x, and its slopes."""
        return self.evidence.tangent(spec, x), self.evidence.slopes(spec, x)

    def _fit(
        self, spec: dict[str, dict[str, float]], z: np.ndarray, J: np.ndarray, start: np.ndarray, iterations: int = 6
    ) -> Fit:
        """Fit the tolerances beside fixed effects to a tangent."""
        widening = self.evidence.widening(spec) if spec else None
        s = self.linear(z, J, iterations=iterations, start=start, widening=widening)
        cost = self.evidence.freedom(spec) if spec else 0.0
        return Fit(spec, s.x, s.loglik - cost, s.z, s.scales, self.low, self.high)

    def jacobian(
        self,
        slots: list[tuple[str, Parameter]],
        phi: np.ndarray,
        z: np.ndarray,
        x: np.ndarray,
        spec: Spec | None = None,
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return sensitivities by finite differences, and how far a step may go."""
        D, spec = np.zeros((len(z), len(phi))), spec or _spec(slots, phi)
        # Contributions to an equation are additive, with or without other effects.
        apart = len(spec) > 1 and not self.evidence.bends and all(adds(self.evidence.effects[n]) for n in spec)
        for k, ((name, p), v) in enumerate(zip(slots, phi, strict=True)):
            moved = self._moved({name: spec[name]} if apart else spec, name, p, x)
            far, room = self._steps.get((*spec, name, p.name), 0.0), min(v - p.lower, p.upper - v)
            h = far * abs(v) if far * abs(v) <= room else 0.0
            D[:, k] = (moved(h) - moved(-h)) / (2.0 * h) if h else moved(_nudge(p, v)) / _nudge(p, v)
        return D, *_reach(slots, phi)

    def _moved(self, spec: Spec, name: str, p: Parameter, x: np.ndarray) -> Callable[[float], np.ndarray]:
        """Return what a change of an effect's parameter changes in the residuals."""
        v = spec[name][p.name]

        def moved(h: float) -> np.ndarray:
            there = {**spec[name], p.name: float(np.clip(v + h, p.lower, p.upper))}
            return self.evidence.change({**spec, name: there}, spec, x)

        return moved

    def _begun(
        self, slots: Sequence[tuple[str, Parameter]], phi: np.ndarray, x: np.ndarray
    ) -> tuple[np.ndarray, float]:
        """Return where to begin a descent, found without slopes where residuals are rough, and what gain is chance."""
        spec = _spec(slots, phi)
        for (name, p), v in zip(slots, phi, strict=True):
            key = (*spec, name, p.name)
            if key not in self._steps:
                self._steps[key] = longer(_nudge(p, v), v, p.lower, p.upper, self._moved(spec, name, p, x))
        if not any(self._steps[*spec, name, p.name] for name, p in slots):
            return phi, 0.0
        J, names = self.evidence.slopes(spec, x), dict(zip(self.evidence.free, map(float, x), strict=True))

        def value(phi: np.ndarray) -> float:
            return self.linear(self.evidence.z(_spec(slots, phi), names) - J @ x, J, start=x).loglik

        return compass(value, phi, np.array([p.lower for _, p in slots]), np.array([p.upper for _, p in slots]))


def _relinearised(x: np.ndarray, solved: Callable[[np.ndarray], Solved]) -> Solved:
    """Return a solution linearised in the tolerances where it ends, starting at deviations x."""
    for _ in range(ROUNDS):
        found = solved(x)
        moved, x = float(np.max(np.abs(found.x - x), initial=0.0)), found.x
        if moved < NEAR:
            break
    return found


def slots_of(effects: Mapping[str, type[Effect]], spec: Spec) -> list[tuple[str, Parameter]]:
    """Return the parameters of a spec's effects, in order."""
    return [(name, p) for name in spec for p in effects[name].parameters]


def _nudge(p: Parameter, v: float) -> float:
    """Return a small change of a parameter that stays within its bounds."""
    if p.factor:
        return 1e-3 * (1.0 + v)
    if p.refines and not v:
        return REFINED * p.upper
    h = 0.01 * abs(v) if v else 1e-3 * (abs(p.nominal) or 0.1 * min(1.0, p.upper))
    h = max(h, 1e-6 * (abs(p.nominal) or p.upper))
    if p.lower < p.upper:  # to a bound from within a thousandth of it
        h = min(h, 0.5 * (p.upper - p.lower))
    return h if v + h <= p.upper else -h


def _reach(slots: Sequence[tuple[str, Parameter]], phi: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return how far down and up one step may take parameters."""
    lower, upper = np.zeros(len(phi)), np.zeros(len(phi))
    for k, (_, p) in enumerate(slots):
        v = phi[k]
        lower[k], upper[k] = p.lower - v, p.upper - v
        if _mixes(p):
            lower[k], upper[k] = max(lower[k], -MIX), min(upper[k], MIX)
        elif p.factor:
            lower[k], upper[k] = max(lower[k], -0.6 * (1.0 + v)), min(upper[k], 1.5 * (1.0 + v))
        elif not p.linear and p.lower >= 0.0:  # a factor, so that a time constant keeps its order of magnitude
            lower[k], upper[k] = max(lower[k], -0.6 * v), min(upper[k], max(1.5 * v, 2.0 * abs(_nudge(p, v))))
        elif not p.linear:
            whole = 0.1 * (p.upper - p.lower)
            lower[k], upper[k] = max(lower[k], -whole), min(upper[k], whole)
    return lower, upper


def _mixes(p: Parameter) -> bool:
    """Return whether a parameter is the share of another form in an effect, from zero on: it has no typical size."""
    return not p.linear and (p.share or (p.unit == "-" and p.nominal == p.lower == 0.0))


def _spec(slots: Sequence[tuple[str, Parameter]], phi: Sequence[float] | np.ndarray) -> dict[str, dict[str, float]]:
    spec: dict[str, dict[str, float]] = {}
    for v, (name, p) in zip(phi, slots, strict=True):
        spec.setdefault(name, {})[p.name] = float(np.clip(v, p.lower, p.upper))
    return spec


def joined(*specs: Mapping[str, Mapping[str, float]]) -> dict[str, dict[str, float]]:
    """Return the effects of several specs together."""
    return {name: dict(values) for spec in specs for name, values in spec.items()}
