"""Which effects explain the residuals: screening, refits, and one more effect as long as it earns its place."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ...effects import all_effects
from ..residuals.protocol import ResidualSource
from .gauss_newton import Fit, Fitter, joined, slots_of
from .occam import occam
from .sensitivity import Template, templates
from .student_t import form_cost, scale, window_weights

SHORT_LIST = 5, 8
"""Effects that are refitted at each stage: at least so many, and at most so many that come close to the best."""
CLOSE = 8.0, 0.2
"""Gain in likelihood below the best that still comes close, in nats and as a share."""
SAME = 0.5
"""Difference in log-likelihood below which two fits of the same effects are one."""
HOPELESS = -2.0
"""Gain at first sight below which a refit is not worth its time."""
MAX_CAUSES = 3
FORM = 0.3
"""How far, as a share, the form of an effect may differ smoothly from the library's over the range of the state."""
INEXACT = 0.015
"""How far, as a share, it may differ otherwise."""
EXACT = 0.003
"""The same for faults of sensors and wrong parameters, whose forms are known."""
TOLERANCE = 3.0
"""Precision of the tolerances as a prior, that of a uniform one: what needs several parameters at their ends is less
likely than what leaves them inside, if both fit as well."""
CROSS = 0.01
"""What an effect may add, as a share, to windows and equations that the library's form does not know of."""
_CONFINED = {"friction", "hysteresis", "load"}
_CONSTITUTIVE = {"force", "flow", "command", "supply", "valve", "torque"}


@dataclass
class Rival:
    """A refitted explanation.

    Parameters
    ----------
    added : str
        The effect that was added at this stage.
    fit : Fit
        Everything refitted with it.
    plain, loose : float
        Its likelihood as it is and with loosened forms, at the softness of its stage.
    left : array, shape (n_equations,)
        Scale of what is left with loosened forms, at its own softness; may be less than 1.
    weights : array, shape (n_windows,)
        What each window counts for at its fit.
    z : array, shape (n_windows,)
        What is left with loosened forms, at its own softness.
    """

    added: str
    fit: Fit
    plain: float
    loose: float
    left: np.ndarray
    weights: np.ndarray
    z: np.ndarray


@dataclass
class Stage:
    """One round of the search: what stood before, and what was tried on top.

    Parameters
    ----------
    before : Rival
        What stood before, at the softness of this stage.
    screened : dict of str to (float, list of dict)
        For each effect of the library the gain in likelihood of its best template, and values to refit it from.
    rivals : list of Rival
        The refitted ones, the best first.
    """

    before: Rival
    screened: dict[str, tuple[float, list[dict[str, float]]]]
    rivals: list[Rival]


class Search:
    """The search over a library of effects.

    Parameters
    ----------
    evidence : Evidence
        The log.
    fitter : Fitter
        Its fits.
    library : sequence of str
        Effects that may be named.
    progress : callable, optional
        Called with a text at each step.
    """

    def __init__(
        self,
        evidence: ResidualSource,
        fitter: Fitter,
        library: Sequence[str],
        progress: Callable[[str], None] | None = None,
    ) -> None:
        self.evidence, self.fitter, self.library = evidence, fitter, list(library)
        self.say = progress or (lambda _: None)
        known = all_effects()
        self.templates: dict[str, list[Template]] = {}
        for name in library:
            self.say(f"sensitivity to {name}")
            if found := templates(evidence, known[name]):
                self.templates[name] = found
        self._contributions: dict[str, dict[str, np.ndarray]] = {}
        base = fitter.base()
        self.base = self.rival("", base)
        self.stages: list[Stage] = []
        self._costs: dict[str, float] = {}
        self._done: dict[tuple[str, ...], Stage] = {}

    # --- forms that may differ ------------------------------------------------------------------------------
    def contributions(self, fit: Fit) -> dict[str, np.ndarray]:
        """Return what each effect of a fit adds to the residuals beyond what tolerances take up, in units of noise."""
        key, J = f"{fit.spec!r} {fit.x.tobytes()!r}", self.evidence.J
        if key not in self._contributions:
            whole = self.evidence.tangent(fit.spec, fit.x)
            found = {}
            for name in fit.spec:
                rest = {k: v for k, v in fit.spec.items() if k != name}
                d = whole - self.evidence.tangent(rest, fit.x)
                found[name] = d - J @ np.linalg.lstsq(J, d, rcond=None)[0] if J.shape[1] else d
            self._contributions = {**dict(list(self._contributions.items())[-3:]), key: found}
        return self._contributions[key]

    def loudness(self, d: np.ndarray) -> float:
        """Return how loud a contribution is where it is loudest, in windows as they are."""
        raw = self.evidence.raw(d)
        return max(float(np.sqrt(np.mean(np.square(raw[part])))) for part in self.evidence.parts)

    def softness(self, fit: Fit) -> np.ndarray | None:
        """Return by how much the noise is widened because the forms of a fit's effects are not exact.

        Where an effect acts it may be wrong by `INEXACT` of what it adds there; and what is loud in one equation may
        well whisper in another one.
        """
        variance = np.zeros(len(self.evidence.z0))
        for name, d in self.contributions(fit).items():
            if not has_form(name):
                variance += np.square(EXACT * d)
                continue
            variance += np.square(INEXACT * d) + (cross(name) * self.loudness(d)) ** 2
        return np.sqrt(1.0 + variance) if np.any(variance) else None

    def loosened(self, fit: Fit) -> np.ndarray:
        """Return columns that loosen the form of the effects: each one's contribution times a standardised signal.

        A friction that grows with the pressure or a leak through a sharper orifice is still friction, or a leak. What
        such a variation explains is no evidence for a second cause.
        """
        signals = _signals(self.evidence.state)
        added = [self.evidence.raw(d) for name, d in self.contributions(fit).items() if has_form(name)]
        columns = [d * signal for d in added for signal in signals]
        return self.evidence.white(np.column_stack(columns)) if columns else np.zeros((len(self.evidence.z0), 0))

    def rival(self, added: str, fit: Fit, soft: np.ndarray | None = None) -> Rival:
        """Return a fit with its likelihood under loosened forms."""
        columns = self.loosened(fit)
        k = columns.shape[1]
        bounds = np.full(k, 2 * FORM)
        z = self.evidence.tangent(fit.spec, fit.x)
        prior = np.full(k, FORM**-2)
        unlikely = _unlikely(fit.x)
        widening, wide = self.evidence.widening(fit.spec), self._with_spread(soft, fit)
        plain = self.fitter.linear(z, None, None, None, None, 4, fit.x, wide, widening)
        weights = window_weights(plain, self.evidence.parts, self.fitter.weights)
        if soft is not None:
            weights = weights / np.square(soft)
        likely = plain.loglik - unlikely
        if not k:
            return Rival(added, fit, likely, likely, self.scales(plain.z), weights, plain.z)
        s = self.fitter.linear(z, columns, -bounds, bounds, prior, 4, fit.x, wide, widening)
        scaled = columns if wide is None else columns / wide[:, None]
        loose = s.loglik - form_cost(scaled, s, self.evidence.parts, prior, self.fitter.weights)
        own = self.softness(fit)
        left = s.z if own is None else s.z * (1.0 if soft is None else soft) / own
        return Rival(added, fit, likely, max(likely, loose - unlikely), self.scales(left), weights, left)

    def _with_spread(self, soft: np.ndarray | None, fit: Fit) -> np.ndarray | None:
        """Return a softness with the noise as it is under a fit."""
        spread = self.evidence.spread(fit.spec, fit.x)
        return soft if spread is None else spread if soft is None else soft * spread

    def scales(self, z: np.ndarray) -> np.ndarray:
        """Return the robust scale of each equation's residuals, which may be less than 1."""
        return np.array([_raw_scale(z[part]) for part in self.evidence.parts])

    def prior(self, name: str) -> float:
        """Return the logarithm of the odds with which an effect is expected on this kind of system."""
        return float(self.evidence.prior(name))

    # --- stages ---------------------------------------------------------------------------------------------
    def stage(self, fit: Fit) -> Stage:
        """Try every effect of the library on top of a fit."""
        key = tuple(sorted(fit.spec))
        done = self._done.get(key)
        if done is not None and abs(done.before.fit.loglik - fit.loglik) < SAME:
            return done
        soft = self.softness(fit)
        before = self.rival("", fit, soft)
        z = self.evidence.tangent(fit.spec, fit.x)
        nuisance, wide = self.loosened(fit), self._with_spread(soft, fit)
        k = nuisance.shape[1]
        form, prior = np.full(k, 2 * FORM), np.full(k, FORM**-2)
        screened: dict[str, tuple[float, list[dict[str, float]]]] = {}
        for name, found in self.templates.items():
            if name in fit.spec:
                continue
            for t in found:
                m = t.columns.shape[1]
                s = self.fitter.linear(
                    z,
                    np.column_stack([t.columns, nuisance]),
                    np.concatenate([t.lower, -form]),
                    np.concatenate([t.upper, form]),
                    np.concatenate([np.zeros(m), prior]),
                    4,
                    fit.x,
                    wide,
                    self.evidence.widening(fit.spec),
                )
                found_at = s.loglik - _unlikely(s.x[: self.fitter.n])
                gain = found_at - before.loose - least_penalty(m, self.evidence) + self.prior(name)
                if name not in screened or gain > screened[name][0]:
                    screened[name] = (gain, t.starts(s.x[self.fitter.n : self.fitter.n + m]))
        rivals = []
        for name in _short_list({name: gain for name, (gain, _) in screened.items()}):
            self.say(f"refit with {name}")
            starts = [joined(fit.spec, {name: values}) for values in screened[name][1]]
            spec = max(starts, key=lambda s: self.fitter.glance(s, fit.x)) if len(starts) > 1 else starts[0]
            refined = self.fitter.refine(spec, least=fit.loglik, near=fit.x)
            rivals.append(self.rival(name, refined, soft))
        rivals.sort(key=lambda r: self.gain(before, r), reverse=True)
        self.stages.append(Stage(before, screened, rivals))
        self._done[key] = self.stages[-1]
        return self.stages[-1]

    def gain(self, before: Rival, after: Rival) -> float:
        """Return the gain in likelihood from one explanation to a larger one, less a penalty for what it adds.

        What an effect gains only by bending its form counts half: a form is known roughly, but it is known.
        """
        bent = 0.5 * (after.plain - before.plain) + 0.5 * (after.loose - before.loose)
        cost = self.cost(after, after.plain - before.plain) - self.prior(after.added)
        return min(bent, after.loose - before.loose) - cost if degenerate(after.fit, after.added) is None else -cost

    def cost(self, rival: Rival, gain: float) -> float:
        """Return what the effect that a rival adds costs for its parameters."""
        key = f"{rival.added} {gain:.3f} {rival.fit.spec!r}"
        if key not in self._costs:
            slots = slots_of(rival.fit.spec)
            phi = np.array([rival.fit.spec[name][p.name] for name, p in slots])
            mine = [k for k, (name, _) in enumerate(slots) if name == rival.added]
            if len(mine) > 1:
                z = self.evidence.tangent(rival.fit.spec, rival.fit.x)
                D = self.fitter.jacobian(slots, phi, z, rival.fit.x, mine)[0][:, mine]
            else:
                D = np.zeros((len(self.evidence.z0), len(mine)))
            self._costs[key] = occam(
                D, self.evidence.J, rival.weights, [slots[k][1] for k in mine], [phi[k] for k in mine], gain
            )
        return self._costs[key]


def has_form(name: str) -> bool:
    """Tell whether an effect has a form that may be bent; a sensor's offset or gain or a wrong length has none."""
    effect = all_effects()[name]
    return bool(_CONSTITUTIVE & set(effect.hooks())) or effect.n_states > 0


def cross(name: str) -> float:
    """Return what an effect may add, as a share, to equations that the library's form does not know of.

    What changes a muscle's shape is felt in force and volume alike, and the abrupt flow of a valve in the gas; friction
    stays where it is.
    """
    return 0.0 if all_effects()[name].family in _CONFINED else CROSS


def degenerate(fit: Fit, name: str) -> str | None:
    """Return the parameter at whose bound an effect of a fit has turned into another one; None if it has not."""
    if name not in fit.spec:
        return None
    values, parameters = fit.spec[name], all_effects()[name].parameters
    for p in parameters:
        if not p.essential:
            continue
        value = values[p.name]
        if p.linear:
            others = max(abs(values[q.name]) for q in parameters if q.linear and q.unit == p.unit and q is not p)
            if abs(value) < 0.1 * others:
                return p.name
        # A lower bound far below what is typical stands for zero, the ideal form of the same effect.
        elif value >= 0.98 * p.upper or (p.lower > 0.02 * p.nominal and value <= 1.02 * p.lower):
            return p.name
    return None


def _short_list(gains: dict[str, float]) -> list[str]:
    """Return the effects to refit, the best first."""
    names = sorted(gains, key=lambda n: -gains[n])
    if not names:
        return []
    best = gains[names[0]]
    hopeful = [n for n in names if gains[n] > HOPELESS] or names[:1]
    close = [n for n in hopeful if gains[n] > best - CLOSE[0] - CLOSE[1] * max(best, 0.0)]
    return hopeful[: int(np.clip(len(close), *SHORT_LIST))]


def _unlikely(x: np.ndarray) -> float:
    """Return what deviations of the parameters cost, a logarithm of probability."""
    return 0.5 * TOLERANCE * float(x @ x)


def _raw_scale(z: np.ndarray) -> float:
    """Return the robust scale of residuals, which may be less than one."""
    return scale(z, 0.0)


def least_penalty(k: int, evidence: ResidualSource) -> float:
    """Return what k parameters of one effect cost at first sight: Schwarz's price, once; others may bend little."""
    return 0.5 * float(np.log(max(len(evidence.z0), 2))) + 1.5 * (k - 1)


def _signals(state: dict[str, np.ndarray]) -> list[np.ndarray]:
    """Return signals of the state between about −1 and 1; zero where a window has none."""
    found = []
    for x in (state["P"], state["eps"], np.abs(state["deps"]), np.abs(state["u"])):
        if np.all(np.isnan(x)):
            continue
        low, mid, high = np.nanquantile(x, (0.05, 0.5, 0.95))
        found.append(np.nan_to_num((x - mid) / max(high - low, 1e-12)).clip(-2.0, 2.0))
    return found
