"""The library linearised on one log: the gain of each effect and each set of them, before any refit."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from ..residuals.protocol import ResidualSource
from ..settings import CLOSE, CLOSE_SHARE, FORM_SMOOTH, GRID, KEPT, MOST_CAUSES, TOLERANCE
from .gauss_newton import Fit, slots_of
from .hypotheses import Hypothesis, Screen, Single, contenders
from .sensitivity import Template, relinearised, templates
from .so_far import in_words
from .subsets import Subset, Subsets
from .worth import Worth


class FirstOrder(Worth):
    """The library about hypotheses of one log."""

    def __init__(
        self,
        evidence: ResidualSource,
        library: Sequence[str],
        progress: Callable[[str], None] | None = None,
        known: Mapping[str, Sequence[Template]] | None = None,
    ) -> None:
        super().__init__(evidence)
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
        found = sorted((about.fit((t,)) for t in list(best.values())[: 4 * KEPT]), key=lambda s: -s.score)
        if not found:
            return []
        gain = max(found[0].score - about.fit(()).score, 0.0)
        reach = CLOSE + (CLOSE_SHARE + self._bent(found[0])) * gain
        return [s for s in found if s.score >= found[0].score - reach][: 2 * KEPT]

    def _bent(self, subset: Subset) -> float:
        """Return the share of its contribution by which a set differs from its first-order model, at most 1."""
        evidence, m = self.evidence, self.evidence.J.shape[1]
        template = self.templates[subset.templates[0]]
        straight = evidence.J @ subset.x[:m] + template.columns @ subset.x[m:]
        deviations = dict(zip(evidence.free, map(float, subset.x[:m]), strict=True))
        self.say(f"run {in_words(template.effect)}")
        there = evidence.z({template.effect: template.starts(subset.x[m:])[0]}, deviations) - evidence.z0
        apart, size = float(np.linalg.norm(there - straight)), float(np.linalg.norm(straight))
        return min(1.0, apart / max(size, 1e-300))

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
        z = evidence.tangent(spec, fit.x)
        m = evidence.J.shape[1]
        fixed, precision = [evidence.slopes(spec, fit.x)], [np.full(m, TOLERANCE)]
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


def closed_share(left: float, room: float) -> float:
    """Return the share of an excess that is gone."""
    return float(np.clip(1.0 - left / room, 0.0, 1.0)) if room > 0 else 0.0


def excess_of(evidence: ResidualSource, z: np.ndarray) -> float:
    """Return the excess of residuals over their noise, over all equations."""
    raw = np.square(evidence.raw(z))
    return sum(max(float(np.sum(raw[part])) - (part.stop - part.start), 0.0) for part in evidence.parts)
