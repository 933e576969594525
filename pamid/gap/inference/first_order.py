"""What sets of effects are worth on one log, with inexact forms and sizes that compare, exactly and to first order."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy.optimize import minimize_scalar

from ...effects import Parameter
from ..residuals.protocol import ResidualSource, Spec
from ..settings import CLOSE, CLOSE_SHARE, FORM_SMOOTH, FORM_TIMES, GRID, KEPT, MOST_CAUSES, OF_ITS_OWN, TOLERANCE
from .discrepancy import Discrepancy
from .gauss_newton import Fit, Fitter, slots_of
from .hypotheses import Hypothesis, Screen, Single, contenders, degenerate
from .occam import occam
from .sensitivity import Template, relinearised, templates
from .so_far import in_words
from .student_t import form_cost, scale, window_weights
from .subsets import Subset, Subsets


class FirstOrder:
    """The library about hypotheses of one log, and what sets of its effects are worth there."""

    def __init__(
        self,
        evidence: ResidualSource,
        library: Sequence[str],
        progress: Callable[[str], None] | None = None,
        known: Mapping[str, Sequence[Template]] | None = None,
    ) -> None:
        self.evidence, self.fitter, self.discrepancy = evidence, Fitter(evidence), Discrepancy(evidence)
        runs = (evidence.time[evidence.run == run] for run in np.unique(evidence.run))
        self._longest = max((float(np.ptp(times)) for times in runs), default=0.0)
        self._jacobians: dict[str, np.ndarray] = {}
        self.base = self.hypothesis(self.fitter.base())
        self.library, self.say = list(library), progress or (lambda _: None)
        self.templates: list[Template] = []
        for k, name in enumerate(library):
            if known is None or name not in known:
                self.say(f"sensitivity to {in_words(name)}, {k + 1} of {len(library)}")
                self.templates += templates(evidence, name)
            else:
                self.templates += known[name]
        self.further = float(np.log(max(len(self.usable), 1)))

    @property
    def usable(self) -> list[str]:
        """The effects that change something on this log."""
        return list(dict.fromkeys(t.effect for t in self.templates))

    @property
    def _laid_about(self) -> np.ndarray:
        """The deviations about which the library is linearised."""
        x = np.zeros(self.evidence.J.shape[1])
        known = next((t.x for t in self.templates if t.x is not None), x)
        x[: len(known)] = known  # steps of an integrator may have come after them
        return x

    def screen(self, most: int = MOST_CAUSES) -> Screen:
        """Score every set of effects to first order, and return those that are worth an exact refit."""
        if not self.templates:
            return Screen(None, {}, [])
        about = self._about(self.base)
        found = contenders(about.grow(most), about.fit(()).score)
        if self.evidence.bends:
            found = [*self._close_singles(about), *(s for s in found if len(s.templates) > 1)]
        return Screen(about, self._singles(about), found)

    def about_nothing(self, library: Sequence[Template]) -> Subsets:
        """Return the subsets of another library, about no effect."""
        return self._about(self.base, library=library)

    def alone(self) -> dict[str, Single]:
        """Return the gain of each effect alone."""
        return self._singles(self._about(self.base)) if self.templates else {}

    def _close_singles(self, about: Subsets) -> list[Subset]:
        """Return the effects that may each be the cause, to first order."""
        gains = about.gains(about.fit(()))
        best: dict[str, int] = {}
        for t in np.argsort(-gains, kind="stable"):
            if gains[t] > 0.0:
                best.setdefault(self.templates[t].effect, int(t))
        nothing = about.fit(()).score
        found = sorted((about.fit((t,)) for t in list(best.values())[: 4 * KEPT]), key=lambda s: -s.score)
        # Along a run in which it holds nothing, what it does where it holds does not show.
        effects = self.evidence.effects
        holding = [t for name, t in best.items() if effects[name].holds and not effects[name].extends]
        holding = holding[:KEPT] if self.evidence.simulates else []
        if not found:
            return []
        gain = max(found[0].score - nothing, 0.0)
        least = found[0].score - CLOSE - (CLOSE_SHARE + self._bent(found[0])) * gain
        if not self.evidence.simulates:  # where each takes a run of the simulator, a refit that fails shows it, too
            found = sorted((self._curved(s, about) for s in found), key=lambda s: -s.score)
        close = [s for s in found if s.score >= least][: 2 * KEPT]
        known = {s.templates for s in close}
        return close + [about.fit((t,)) for t in holding if (t,) not in known]

    def _curved(self, subset: Subset, about: Subsets) -> Subset:
        """Return an effect at the size that explains most to second order, if that is more."""
        bent = self._to_second_order(subset, about)
        return bent if bent.score > subset.score else subset

    def _to_second_order(self, subset: Subset, about: Subsets) -> Subset:
        """Return an effect at the size that explains most to second order: a run at its own shows how far it bends."""
        template, m = self.templates[subset.templates[0]], self.evidence.J.shape[1]
        if not template.linear:
            return subset
        evidence, J, x, phi = self.evidence, self.evidence.J, subset.x[:m], subset.x[m:]
        straight, there = template.columns @ phi, self._there(subset) - J @ x
        if np.linalg.norm(there - straight) < CLOSE_SHARE * np.linalg.norm(straight):
            return subset
        spec = {template.effect: template.starts(phi)[0]}
        spread, widening = evidence.spread(spec, x), evidence.widening(spec)
        price = self.fitter.linear(evidence.z0, J).loglik - about.fit(()).score + about.cost[template.effect]
        ends = np.where(phi > 0.0, template.upper, template.lower)[phi != 0.0] / phi[phi != 0.0]

        def missed(size: float) -> float:
            soft, wider = (None if v is None else 1.0 + size * (v - 1.0) for v in (spread, widening))
            z = evidence.z0 + size * straight + size * size * (there - straight)
            return price - self.fitter.linear(z, J, soft=soft, widening=wider).loglik

        least = minimize_scalar(missed, bounds=(0.0, min([2.0, *ends])), method="bounded", options={"maxiter": 8})
        return replace(subset, score=-least.fun, x=np.append(x, least.x * phi))

    def _bent(self, subset: Subset) -> float:
        """Return the share of its contribution by which a set differs from its first-order model, at most 1."""
        evidence, m = self.evidence, self.evidence.J.shape[1]
        straight = evidence.J @ subset.x[:m] + self.templates[subset.templates[0]].columns @ subset.x[m:]
        apart, size = float(np.linalg.norm(self._there(subset) - straight)), float(np.linalg.norm(straight))
        return min(1.0, apart / max(size, 1e-300))

    def _there(self, subset: Subset) -> np.ndarray:
        """Return what an effect changes at the size and deviations that it has to first order."""
        evidence, m = self.evidence, self.evidence.J.shape[1]
        template = self.templates[subset.templates[0]]
        deviations = dict(zip(evidence.free, map(float, subset.x[:m]), strict=True))
        self.say(f"run {in_words(template.effect)}")
        return evidence.z({template.effect: template.starts(subset.x[m:])[0]}, deviations) - evidence.z0

    def _hopeless(self, about: Subsets, subset: Subset, nothing: float) -> bool:
        """Return whether a set explains too little to be a gap, between the points of its grid, too."""
        price = sum(about.cost[self.templates[t].effect] for t in subset.templates)
        return (subset.score - nothing + price) / GRID - price <= self.evidence.least_gain

    def _singles(self, about: Subsets) -> dict[str, Single]:
        """Return the gain of each effect alone."""
        start = about.fit(())
        gains = about.gains(start)
        found: dict[str, Single] = {}
        room = excess_of(self.evidence, about.unweighted(start))
        for t in np.argsort(-gains, kind="stable"):
            name = self.templates[t].effect
            if name not in found:
                left = excess_of(self.evidence, about.unweighted(about.fit((int(t),)))) if gains[t] > 0 else room
                found[name] = Single(float(gains[t]) - about.cost[name], closed_share(left, room))
        return found

    def _about(
        self,
        h: Hypothesis,
        without: frozenset[str] = frozenset(),
        inexact: bool = True,
        library: Sequence[Template] | None = None,
    ) -> Subsets:
        """Return the subsets of a library about a hypothesis, some of its effects taken out, forms exact or not."""
        evidence, fit = self.evidence, h.fit
        spec = {k: v for k, v in fit.spec.items() if k not in without}
        # Tolerances may compensate nearly all that an effect changes: both have to be linearised about one point.
        x = fit.x if spec or not evidence.simulates else self._laid_about
        z = evidence.tangent(spec, x)
        m = evidence.J.shape[1]
        fixed, precision = [evidence.slopes(spec, x)], [np.full(m, TOLERANCE)]
        lower, upper = [self.fitter.low], [self.fitter.high]
        if spec:
            slots = slots_of(evidence.effects, spec)
            phi = np.array([spec[name][p.name] for name, p in slots])
            D, low, high = self.fitter.jacobian(slots, phi, z, fit.x)
            smooth = self.discrepancy.columns(Fit(spec, fit.x, fit.loglik, z, fit.scales, fit.low, fit.high))
            smooth = smooth if inexact else smooth[:, :0]
            fixed += [D, smooth]
            bound = np.full(smooth.shape[1], 2.0 * FORM_SMOOTH)
            lower, upper = [*lower, low, -bound], [*upper, high, bound]
            precision += [np.zeros(D.shape[1]), np.full(smooth.shape[1], FORM_SMOOTH**-2)]
        n = len(evidence.z0)
        cost = {
            name: 0.5 * float(np.log(max(n, 2))) - evidence.prior(name) + (self.further if self.chosen(spec) else 0.0)
            for name in self.usable
        }
        weights = h.weights.copy()
        for i, part in enumerate(evidence.parts):
            # The scale of each equation is refitted for every set; only each window's own weight remains.
            weights[part] *= h.fit.scales[i] ** 2 / max(float(self.fitter.weights[i]), 1e-12)
        return Subsets(
            z,
            np.column_stack(fixed),
            np.concatenate(lower),
            np.concatenate(upper),
            np.concatenate(precision),
            relinearised(evidence, self.templates if library is None else library, spec),
            cost,
            evidence.parts,
            weights,
            self.fitter.weights,
        )

    # --- worth -------------------------------------------------------------------------------------------------
    def hypothesis(self, fit: Fit) -> Hypothesis:
        """Return a fit with its evidence."""
        evidence = self.evidence
        z, J = evidence.tangent(fit.spec, fit.x), evidence.slopes(fit.spec, fit.x)
        spread, widening = evidence.spread(fit.spec, fit.x), evidence.widening(fit.spec)
        plain = self.fitter.linear(z, J, start=fit.x, soft=spread, widening=widening)
        best, width, wider = plain, None, widening
        value = plain.loglik
        if fit.spec:
            columns = self.discrepancy.columns(fit)
            k = columns.shape[1]
            precision = np.full(k, FORM_SMOOTH**-2)
            for times in FORM_TIMES:
                trial = self.discrepancy.width(fit, times) if times else None
                both = widening if trial is None else trial if widening is None else trial * widening
                ends = np.full(k, -2.0 * FORM_SMOOTH), np.full(k, 2.0 * FORM_SMOOTH)
                s = self.fitter.linear(z, J, columns, *ends, precision, start=fit.x, soft=spread, widening=both)
                total = (1.0 if spread is None else spread) * (1.0 if both is None else both)
                scaled = columns / np.broadcast_to(total, len(z))[:, None]
                loose = s.loglik - form_cost(scaled, s, evidence.parts, precision, self.fitter.weights)
                if loose > value:
                    best, width, wider, value = s, trial, both, loose
        weights = window_weights(best, evidence.parts, self.fitter.weights)
        if width is not None:
            weights = weights / np.square(width)
        score = value - evidence.freedom(fit.spec) - self._unlikely(fit) - sum(self._price(fit, weights).values())
        left = self._scales(best.z)
        filters = any(evidence.effects[name].filters_readings() for name in fit.spec)
        if spread is not None and not evidence.exact and filters:
            # What widens the noise of a window has its price already: to be below that is no gain.
            score -= self._below_noise(left if wider is None else self._scales(best.z * wider))
        filtered = evidence.filtered(fit.spec, self.base.z) if fit.spec else None
        if filtered is not None:
            score -= self._by_filtering(filtered if spread is None else filtered / spread)
        return Hypothesis(fit, score, plain.loglik, left, best.z, weights)

    def _scales(self, z: np.ndarray) -> np.ndarray:
        """Return the scale of residuals in each equation, which may be less than 1."""
        return np.array([scale(z[part], 0.0) for part in self.evidence.parts])

    def _below_noise(self, left: np.ndarray) -> float:
        """Return the gain in nats of residuals below their noise: undoing a fault filters the noise, too."""
        quiet = np.log(np.minimum(self.base.left, 1.0) / np.maximum(left, 1e-12))
        return float(self._counts * self.fitter.weights @ np.maximum(quiet, 0.0))

    def _by_filtering(self, filtered: np.ndarray) -> float:
        """Return the gain in nats by filtering what is left without any effect as undoing a fault filters noise."""
        left = np.array([scale(filtered[part]) for part in self.evidence.parts])
        return float(self._counts * self.fitter.weights @ np.log(np.maximum(self.base.left / left, 1.0)))

    @property
    def _counts(self) -> np.ndarray:
        """Windows of each equation."""
        return np.array([part.stop - part.start for part in self.evidence.parts])

    def _unlikely(self, fit: Fit) -> float:
        """Return the penalty of deviations within the tolerances."""
        x = fit.x + self.evidence.about
        return 0.5 * TOLERANCE * float(x @ x)

    def _price(self, fit: Fit, weights: np.ndarray) -> dict[str, float]:
        """Return the penalty of each effect's parameters in a fit, less its prior."""
        if not fit.spec:
            return {}
        D, slots = self.sensitivities(fit)
        found = {}
        for name, d in self.discrepancy.contributions(fit).items():
            mine = [k for k, (n, _) in enumerate(slots) if n == name]
            gain = 0.5 * float(weights @ np.square(d))
            parameters = [slots[k][1] for k in mine]
            values = [fit.spec[name][p.name] for p in parameters]
            price = occam(D[:, mine], self.evidence.slopes(fit.spec, fit.x), weights, parameters, values, gain)
            found[name] = price - self.evidence.prior(name)
        return found

    def _ranked(self, h: Hypothesis) -> tuple[bool, float]:
        """Return the sort key of sets of different size: whether each effect is distinct, then the score."""
        own = not any(self.degenerate(h.fit, name) for name in h.fit.spec)
        own = own and all(share >= OF_ITS_OWN for share in self._own_shares(h))
        return own, self.comparable(h) - self._crowded(h)

    def comparable(self, h: Hypothesis) -> float:
        """Return the score that sets of different size are compared by."""
        return h.score - self.further * max(len(self.chosen(h.fit.spec)) - 1, 0)

    def chosen(self, spec: Spec) -> list[str]:
        """Return the effects of a set that were chosen among many: readings may show others by themselves."""
        return [name for name in spec if self.evidence.prior(name) <= 0.0]

    def _crowded(self, h: Hypothesis) -> float:
        """Return the nats that effects beyond the first need in an equation: a share of their gain there."""
        if len(h.fit.spec) < 2 or not self.evidence.exact:
            return 0.0
        count = np.bincount([self.discrepancy.main_part(h.fit, name) for name in h.fit.spec], minlength=len(h.left))
        return OF_ITS_OWN * float(np.maximum(count - 1, 0) @ self._gained(h))

    def _gained(self, h: Hypothesis) -> np.ndarray:
        """Return the gain of a set in each equation, in nats."""
        gain = self._counts * self.fitter.weights * np.log(np.maximum(self.base.left, 1.0) / np.maximum(h.left, 1.0))
        return np.asarray(np.maximum(gain, 0.0))

    def gain_about(self, h: Hypothesis, name: str) -> float:
        """Return the nats that a set explains in the equations which one of its effects changes."""
        touched = self.evidence.touched([name])
        gained, gain = self._gained(h), max(h.score - self.base.score, 0.0)
        mine = np.array([equation in touched for equation in self.evidence.equations])
        return gain * float(gained[mine].sum() / gained.sum()) if gained.sum() > 0.0 else gain

    def degenerate(self, fit: Fit, name: str) -> bool:
        """Return whether an effect of a fit has turned into another one on this log."""
        return name in fit.spec and degenerate(self.evidence.effects[name](**fit.spec[name]), self._longest)

    def _own_shares(self, h: Hypothesis) -> list[float]:
        if h.own is None:
            h.own = self._shares(h.fit, *self.sensitivities(h.fit)) if len(h.fit.spec) > 1 else []
        return h.own

    def _shares(self, fit: Fit, D: np.ndarray, slots: list[tuple[str, Parameter]]) -> list[float]:
        """Return the size of each effect relative to the discrepancy of the others, given their sensitivities."""
        if len(fit.spec) < 2:
            return []
        others = {name: np.array([n != name for n, _ in slots]) for name in fit.spec}
        gap = self.base.fit.z
        return [self.discrepancy.own_share(fit, name, D[:, rest], gap) for name, rest in others.items()]

    def sensitivities(self, fit: Fit) -> tuple[np.ndarray, list[tuple[str, Parameter]]]:
        """Return the sensitivities to all parameters of a fit's effects, and whose they are."""
        key = f"{fit.spec!r} {fit.x.tobytes()!r}"
        if key not in self._jacobians:
            slots = slots_of(self.evidence.effects, fit.spec)
            phi = np.array([fit.spec[name][p.name] for name, p in slots])
            D = self.fitter.jacobian(slots, phi, self.evidence.tangent(fit.spec, fit.x), fit.x)[0]
            self._jacobians = {**dict(list(self._jacobians.items())[-7:]), key: D}
        return self._jacobians[key], slots_of(self.evidence.effects, fit.spec)


def closed_share(left: float, room: float) -> float:
    """Return the share of an excess that is gone."""
    return float(np.clip(1.0 - left / room, 0.0, 1.0)) if room > 0 else 0.0


def excess_of(evidence: ResidualSource, z: np.ndarray) -> float:
    """Return the excess of residuals over their noise, over all equations."""
    raw = np.square(evidence.raw(z))
    return sum(max(float(np.sum(raw[part])) - (part.stop - part.start), 0.0) for part in evidence.parts)
