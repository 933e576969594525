"""Hypotheses about a gap compete by their evidence: sets of effects from the linearised library, refitted exactly."""

import itertools
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace

import numpy as np

from ..residuals.protocol import ResidualSource, Spec
from ..settings import CERTAIN, CLASS, CLOSE, CLOSE_SHARE, EXCESS, KEPT, MOST_CAUSES, OF_ITS_OWN
from .first_order import FirstOrder, closed_share, excess_of
from .gauss_newton import joined, slots_of
from .hypotheses import Hypothesis, Outcome, Screen, Single
from .sensitivity import POINTS, Template, adds, grid, has_form, law_of, root_of
from .so_far import INTERRUPTED, causes_so_far, in_words, stopped
from .subsets import Subset, Subsets

NEARBY = 2.0
"""Factor within which the points of a fine grid are tried again: an octave of a resonance."""
ROUNDS = 3
"""Most restarts of the search from a set found at its end."""
LARGE = 4
"""Set size from which sets that differ in one effect are not refitted one by one: each costs a dozen runs."""


class Competition(FirstOrder):
    """The hypotheses about one log; the parameters are those of `FirstOrder`."""

    worse: frozenset[tuple[str, str]] = frozenset()
    """Effects that are ruled out beside none of the better ones that each is paired with."""

    def __init__(
        self,
        evidence: ResidualSource,
        library: Sequence[str],
        progress: Callable[[str], None] | None = None,
        known: Mapping[str, Sequence[Template]] | None = None,
        apart: Mapping[str, Sequence[tuple[str, str]]] | None = None,
        close: Sequence[str] = (),
    ) -> None:
        super().__init__(evidence, library, progress, known)
        self._apart, self._close = apart or {}, close
        self._done: dict[frozenset[str], Hypothesis] = {frozenset(): self.base}
        self.interrupted = False
        self.begin: Spec = {}
        self._told = self.base

    # --- search -------------------------------------------------------------------------------------------------
    def run(self) -> Outcome:
        """Rank sets of effects, from the linearised library to exact refits about the best."""
        return self.refit(self.screen())

    @property
    def notes(self) -> list[str]:
        """Notes on the search."""
        return [INTERRUPTED] if self.interrupted else []

    def enough(self, h: Hypothesis) -> bool:
        """Return whether a hypothesis leaves no more than the noise, to the accuracy of the noise estimate."""
        return bool(np.all(h.left <= self.least))

    @property
    def least(self) -> np.ndarray:
        """What noise may leave of each equation, to the accuracy of its estimate."""
        return np.asarray(1.0 + EXCESS + np.sqrt(2.0 / np.maximum(self._counts, 1)))

    def refit(self, screen: Screen) -> Outcome:
        """Refit sets of effects exactly, improve the best of them, and try replacements of its causes."""
        if screen.about is None:
            return Outcome(self.base, self.base, {})
        try:
            if self.interrupted:
                for subset in screen.contenders[:1]:
                    self._refitted(screen.about, subset, self.base)
                raise KeyboardInterrupt
            best = self._begun(screen.about, [*self._close_somewhere(screen), *screen.contenders])
            best, alternatives = self._settled(best)
        except KeyboardInterrupt as stop:
            stopped(stop)
            self.interrupted = True
            usable = [h for h in self._done.values() if not any(self.degenerate(h.fit, n) for n in h.fit.spec)]
            some = sorted(usable, key=self.comparable)[-KEPT:]
            best = max([*some, self._told], key=self._ranked)
            alternatives = {name: self._in_place(best, name) for name in best.fit.spec}
        return self._outcome(best, screen.singles, alternatives)

    def without(self, worse: Collection[tuple[str, str]], outcome: Outcome) -> Outcome:
        """Return the outcome of the search about the best set that holds no effect without a better one."""
        self.worse |= frozenset(worse)
        best, alternatives = self._settled(max(self._done.values(), key=self._ranked))
        return self._outcome(best, outcome.singles, alternatives)

    def likeliest(self, best: Hypothesis, name: str, among: Callable[[str], bool]) -> list[Hypothesis]:
        """Return the set with the likeliest of some effects, which share an equation with a cause, in its place."""
        about, here = self._about(best, frozenset({name})), set(self.evidence.touched([name]))
        among_them = {k for k in self.usable if k not in best.names and among(k)}
        among_them = {k for k in among_them if here & set(self.evidence.touched([k]))}
        gains = about.gains(about.fit(()))
        for t in np.argsort(-gains, kind="stable"):
            other = self.templates[t].effect
            if gains[t] > 0.0 and other in among_them:
                keep = [k for k in best.fit.spec if k != name]
                done = self._done.get(frozenset({*keep, other}))
                return [done or self._refitted(about, about.fit((int(t),)), best, keep)]
        return []

    def _ruled_out(self, h: Hypothesis) -> bool:
        return any(name in h.names and better not in h.names for name, better in self.worse)

    def _ranked(self, h: Hypothesis) -> tuple[bool, float]:
        """Return the sort key of sets of different size: those that are ruled out come last."""
        distinct, score = super()._ranked(h)
        return (False, -np.inf) if self._ruled_out(h) else (distinct, score)

    def _close_somewhere(self, screen: Screen) -> list[Subset]:
        """Return the effects that may each be the cause in a part of the log, and are no contenders in all of it."""
        if screen.about is None or not (self._close and self.evidence.bends):
            return []
        seen = {self.templates[s.templates[0]].effect for s in screen.contenders if len(s.templates) == 1}
        gains, place = screen.about.gains(screen.about.fit(())), dict[str, int]()
        for t in np.argsort(-gains, kind="stable"):
            place.setdefault(self.templates[t].effect, int(t))
        return [screen.about.fit((place[name],)) for name in self._close if name in place and name not in seen]

    def _begun(self, about: Subsets, contenders: Sequence[Subset]) -> Hypothesis:
        """Refit the sets of effects that may be the best, and return that one."""
        best, nothing = self.base, about.fit(()).score
        if self.begin and self.begin.keys() <= set(self.usable):
            best = max(best, self._refined({k: dict(v) for k, v in self.begin.items()}, best), key=self._ranked)
            self._tell(best)
        tried: list[frozenset[str]] = []
        grown = not self.evidence.bends
        # Where nothing exceeds the noise, effects are small: to first order they are what they are.
        straight = grown or self.enough(self.base)
        for subset in self._promising(about, contenders):
            if len(subset.templates) > 1 and not grown and best.fit.spec:
                best, grown = self._grown(best), True
            larger = len(subset.templates) > max(len(best.fit.spec), 1)
            if larger and self.evidence.bends and self.enough(best):
                break
            names = frozenset(self.templates[t].effect for t in subset.templates)
            if self.evidence.bends and len(names) >= LARGE and any(len(names - other) < 2 for other in tried):
                continue  # one effect more or less, or another in its place, is tried about the best set anyway
            if best is self.base and straight and self._hopeless(about, subset, nothing):
                continue
            # What one effect explains exactly may need several effects to first order.
            first_order = subset.score - nothing - self.further * (len(subset.templates) - 1)
            gain = self._ranked(best)[1] - self.base.score
            alone = self.evidence.bends and len(subset.templates) == 1
            if best is self.base or alone or first_order >= gain - CLOSE - CLOSE_SHARE * gain:
                self.say("refit with " + ", ".join(in_words(self.templates[t].effect) for t in subset.templates))
                behind = -np.inf
                # One size fits badly where each day has its own.
                if alone and best is not self.base and not self._apart:
                    behind = self._far_behind(best)
                trial = self._refitted(about, subset, self.base, behind=behind)
                if alone and trial.plain < self.base.plain:  # it began too far away
                    nearer = self._to_second_order(subset, about)
                    if nearer is not subset:
                        trial = max(trial, self._refitted(about, nearer, self.base), key=self._ranked)
                tried.append(names)
                best = max(best, self._purged(trial), *self._parted(trial, best), key=self._ranked)
                self._tell(best)
        return best

    def _grown(self, best: Hypothesis) -> Hypothesis:
        """Add effects to a set, refitted each time, while the evidence grows."""
        while len(best.fit.spec) < MOST_CAUSES and not self.enough(best):
            larger = self._step(best, None)
            if larger is best:
                break
            best = larger
            self._tell(best)
        return best

    def _parted(self, h: Hypothesis, best: Hypothesis) -> list[Hypothesis]:
        """Return an effect refitted with its own size before and after each border between days."""
        (name, values), *more = h.fit.spec.items() or [("", {})]
        if more or not self.evidence.bends or self.enough(h):
            return []
        behind = self._far_behind(best)
        pairs = [pair for pair in self._apart.get(name, ()) if set(pair) <= set(self.usable)]
        return [self._refined({part: dict(values) for part in pair}, h, behind) for pair in pairs]

    def _settled(self, best: Hypothesis) -> tuple[Hypothesis, dict[str, list[Hypothesis]]]:
        """Return the best set near one, with possible replacements of its causes."""
        for left in reversed(range(ROUNDS)):
            best = self._pruned(self._merged(self._restarted(self._improved(best))))
            if best.fit.spec:
                best = max(best, self.hypothesis(self.fitter.refine(best.fit.spec, near=best.fit.x)), key=self._ranked)
                self._done[best.names] = best
            self._tell(best)
            alternatives = {name: self._alternatives(best, name) for name in best.fit.spec}
            # One in the place of a cause may turn out to be the better one.
            least = self._ranked(best)[1]
            better = max([best, *(h for h in self._done.values() if h.score > least)], key=self._ranked)
            better = self._plainest(better)
            if better is best or not left:
                break
            best = better
        if (certain := self._pruned(best, CERTAIN)) is not best:
            best = certain
            alternatives = {name: self._alternatives(best, name) for name in best.fit.spec}
        return best, alternatives

    def _plainest(self, best: Hypothesis) -> Hypothesis:
        """Return of the sets that are as likely as one, since their forms may be inexact, the one that fits best."""
        own, score = self._ranked(best)
        alike = [h for h in self._done.values() if len(h.names) == len(best.names) and h.plain > best.plain + CLASS]
        return max([best, *(h for h in alike if self._ranked(h) > (own, score - CLASS))], key=lambda h: h.plain)

    def _restarted(self, best: Hypothesis) -> Hypothesis:
        """Return a set refitted from nearby points of the fine grids: between some of them an effect turns its sign."""
        for name, p in slots_of(self.evidence.effects, best.fit.spec):
            if p.points <= POINTS[1]:
                continue
            values, x = best.fit.spec[name], best.fit.x
            for v in grid(self.evidence.reached(p), 1):
                if 1.0 / NEARBY < v / values[p.name] < NEARBY:
                    spec = {**best.fit.spec, name: {**values, p.name: float(v)}}
                    best = max(best, self.hypothesis(self.fitter.refine(spec, near=x)), key=self._ranked)
        self._done[best.names] = best
        return best

    def _tell(self, best: Hypothesis) -> None:
        """Report the best set so far where it has changed."""
        if best is not self._told and best.fit.spec:
            room = excess_of(self.evidence, self.base.fit.z)
            self.say(causes_so_far(list(best.fit.spec), closed_share(excess_of(self.evidence, best.fit.z), room)))
        self._told = best

    def only(self, outcome: Outcome, classes: Mapping[str, Collection[str]]) -> Outcome:
        """Return the outcome for only some effects of the best set."""

        def kept(h: Hypothesis, also: str) -> Hypothesis:
            spec = {k: v for k, v in h.fit.spec.items() if k in classes or k == also}
            return self._refined(spec, h)

        best = kept(outcome.best, "")
        alternatives = {}
        for name, names in classes.items():
            others = ((h, next(iter(h.names - (outcome.best.names - {name})))) for h in outcome.alternatives[name])
            found = [kept(h, other) for h, other in others if other in names and other != name]
            alternatives[name] = sorted([best, *found], key=lambda h: -h.score)
        return self._outcome(best, outcome.singles, alternatives)

    def _outcome(
        self, best: Hypothesis, singles: dict[str, Single], alternatives: dict[str, list[Hypothesis]]
    ) -> Outcome:
        singles = {**singles, **self._exactly(singles)}
        standing = (h for h in self._done.values() if not self._ruled_out(h))
        return Outcome(self.base, best, singles, alternatives, sorted(standing, key=lambda h: -h.score))

    def _exactly(self, singles: Mapping[str, Single]) -> dict[str, Single]:
        """Return the gains of effects refitted alone; first order underestimates large ones."""
        room = excess_of(self.evidence, self.base.fit.z)
        alone = {next(iter(h.names)): h for h in self._done.values() if len(h.names) == 1}
        return {
            name: Single(h.score - self.base.score, closed_share(excess_of(self.evidence, h.fit.z), room))
            for name, h in alone.items()
            if name in singles
        }

    def _refitted(
        self, about: Subsets, subset: Subset, at: Hypothesis, keep: Sequence[str] = (), behind: float = -np.inf
    ) -> Hypothesis:
        """Return a set of effects refitted exactly, on top of those of a hypothesis that are kept."""
        start = self._start(about, subset, at, keep)
        if self.evidence.curved and len(start) > 1:
            # Where tolerances act nonlinearly, a refitted part of the set shows where they go.
            near = max((h for key, h in self._done.items() if key < start.keys()), key=lambda h: h.plain)
            return self._refined({**start, **near.fit.spec}, near, behind)
        return self._refined(start, replace(at, fit=replace(at.fit, x=self._deviations(subset, at))), behind)

    def _deviations(self, subset: Subset, at: Hypothesis) -> np.ndarray:
        """Return the deviations at which an exact refit of a set begins."""
        return subset.x[: self.evidence.J.shape[1]] if self.evidence.bends else at.fit.x

    def _promising(self, about: Subsets, contenders: Sequence[Subset]) -> list[Subset]:
        """Sort candidates by predicted gain at their start, where each fit costs runs."""
        if not self.evidence.bends:
            return list(contenders)
        one = [s for s in contenders if len(s.templates) == 1]
        starts = {id(s): (self._start(about, s, self.base), self._deviations(s, self.base)) for s in one}
        order = {k: self.fitter.promise(*start).loglik for k, start in starts.items()}
        return sorted(one, key=lambda s: -order[id(s)]) + [s for s in contenders if len(s.templates) > 1]

    def _start(
        self, about: Subsets, subset: Subset, at: Hypothesis, keep: Sequence[str] = ()
    ) -> dict[str, dict[str, float]]:
        """Return where an exact refit of a set begins, on top of the effects of a hypothesis that are kept."""
        kept = {name: at.fit.spec[name] for name in keep}
        offset, starts = about.fixed.shape[1], [kept]
        for t in subset.templates:
            template = self.templates[t]
            m = template.columns.shape[1]
            x, offset = subset.x[offset : offset + m], offset + m
            readings = [{template.effect: values} for values in template.starts(x)]
            starts = [joined(s, r) for s in starts for r in readings]
        x0 = at.fit.x
        if len(starts) > 1:
            starts = sorted(starts, key=lambda s: -self.fitter.approximate(s, x0))
        return starts[0]

    def _improved(self, best: Hypothesis, rounds: int = 3) -> Hypothesis:
        """Add an effect, or replace one, as long as the evidence grows."""
        for _ in range(rounds):
            before = best
            if len(best.fit.spec) < MOST_CAUSES:
                best = self._step(best, None)
            if len(best.fit.spec) > 1:
                for name in list(best.fit.spec):
                    best = self._step(best, name) if name in best.fit.spec else best
            if best is before:
                break
        return best

    def _step(self, at: Hypothesis, out: str | None) -> Hypothesis:
        """Return the best of a hypothesis and those with one effect added or replaced."""
        found = [at, *self._neighbours(at, frozenset() if out is None else frozenset({out}), 2, 0.4)]
        best, likeliest = max(found, key=self._ranked), max(found, key=self.comparable)
        if likeliest is not best and not self._ruled_out(likeliest):
            # Some of its effects are redundant beside one that is right: what is left without them may be the best.
            best = max(best, self._purged(likeliest), key=self._ranked)
        return best

    def _neighbours(self, at: Hypothesis, out: frozenset[str], most: int, margin: float = 1.0) -> list[Hypothesis]:
        """Refit the most promising sets with one effect more, some effects taken away first."""
        found = self._tried(at, out, most, margin, self._about(at, out))
        if any(has_form(self.evidence.effects[name]) for name in at.fit.spec if name not in out):
            # What an inexact form needs may also be another law: then it has fewer parameters.
            known = frozenset(name for h in found for name in h.names)
            found += self._tried(at, out, 1, margin, self._about(at, out, inexact=False), known)
        return found

    def _tried(
        self,
        at: Hypothesis,
        out: frozenset[str],
        most: int,
        margin: float,
        about: Subsets,
        known: frozenset[str] = frozenset(),
    ) -> list[Hypothesis]:
        """Refit the most promising sets of `_neighbours`, given some subsets."""
        keep = [name for name in at.fit.spec if name not in out]
        there = set(map(self._root, keep))
        nothing = about.fit(())
        gains = about.gains(nothing)
        place: dict[str, int] = {}
        for t in np.argsort(-gains, kind="stable"):
            place.setdefault(self.templates[t].effect, int(t))
        closest = [*list(place)[: 4 * KEPT], *(name for name in out if name in place)]
        # Gains predicted at the scales of the gap mostly hold as these come down; either may be close enough.
        promised = {name: float(gains[place[name]]) - about.cost[name] for name in closest}
        kept = {name: about.fit((place[name],)).score - nothing.score for name in closest}
        near: set[str] = set()
        for net in (promised, kept):
            own = max((net[name] for name in out if name in net), default=0.0)
            allowed = margin * (CLOSE + CLOSE_SHARE * max(own, 0.0)) if at.fit.spec else 0.0
            near |= {n for n in net if net[n] > own - allowed and self._root(n) not in there} - known - set(at.fit.spec)
        found = []
        for name in sorted(near, key=lambda n: (-kept[n], n))[:most]:
            if self.evidence.bends and frozenset({*keep, name}) in self._done:
                found.append(self._done[frozenset({*keep, name})])
                continue
            self.say(f"refit with {in_words(name)}")
            found.append(self._refitted(about, about.fit((place[name],)), at, keep, self._far_behind(at)))
        return found

    def _root(self, name: str) -> str:
        return root_of(name, self.evidence.effects[name])

    def _far_behind(self, at: Hypothesis) -> float:
        """Return the log-likelihood below which sets are dropped, once linearised at their start, beside another."""
        gain = max(at.score - self.base.score, 0.0)
        return at.fit.loglik - 2.0 * CLOSE - CLOSE_SHARE * gain if self.evidence.bends else -np.inf

    def _purged(self, h: Hypothesis) -> Hypothesis:
        """Remove redundant effects, the larger or the smaller, until all others are distinct."""
        if len(h.fit.spec) < 2:
            return h
        for name in h.fit.spec:
            if self.degenerate(h.fit, name):  # replaced by what it has turned into
                rest = self._refined({k: v for k, v in h.fit.spec.items() if k != name}, h)
                others = [o for o in self._neighbours(h, frozenset({name}), 2) if name not in o.names]
                settled = [o for o in (rest, *others) if not any(self.degenerate(o.fit, n) for n in o.fit.spec)]
                return max((self._purged(o) for o in settled or [rest]), key=self._ranked)
        if min(shares := self._own_shares(h)) >= OF_ITS_OWN:
            return h
        least = {list(h.fit.spec)[int(np.argmin(shares))], self._least_missed(h)}
        rests = ({k: v for k, v in h.fit.spec.items() if k != name} for name in sorted(least))
        # Compared when finished: a poor set may reach distinct effects before a good one does.
        return max((self._purged(self._refined(rest, h)) for rest in rests), key=self._ranked)

    def _least_missed(self, h: Hypothesis) -> str:
        """Return the effect without which the others are distinct and explain most, to first order."""
        D, slots = self.sensitivities(h.fit)
        found = {}
        for out in h.fit.spec:
            kept = np.array([name != out for name, _ in slots])
            fit = replace(h.fit, spec={k: v for k, v in h.fit.spec.items() if k != out})
            own = min(self._shares(fit, D[:, kept], [s for s in slots if s[0] != out]), default=np.inf) >= OF_ITS_OWN
            free = np.full(int(kept.sum()), np.inf)
            z, J = self.evidence.tangent(fit.spec, fit.x), self.evidence.slopes(fit.spec, fit.x)
            found[out] = own, self.fitter.linear(z, J, D[:, kept], -free, free, start=fit.x).loglik
        return max(found, key=lambda name: found[name])

    def _refined(self, spec: dict[str, dict[str, float]], near: Hypothesis, behind: float = -np.inf) -> Hypothesis:
        """Return effects refitted from where they are, each in the better form of its law."""
        best = self._refined_as(spec, near, behind)
        for name in spec:
            for other in (k for k in self.usable if k != name and law_of(k) == law_of(name)):
                rest = {k: v for k, v in best.fit.spec.items() if law_of(k) != law_of(name)}
                start = {p.name: p.nominal for p in self.evidence.effects[other].parameters}
                done = self._done.get(frozenset({*rest, other}))
                best = max(best, done or self._refined_as({**rest, other: start}, best, behind), key=self._ranked)
        return best

    def _refined_as(self, spec: dict[str, dict[str, float]], near: Hypothesis, behind: float = -np.inf) -> Hypothesis:
        """Return effects refitted from where they are, in the forms that they have."""
        found = self.hypothesis(self.fitter.refine(spec, steps=4, gain=1.0, near=near.fit.x, behind=behind))
        if (free := self._unsettled(found.fit.spec)) is not None:
            found = max(found, self.hypothesis(self.fitter.refine(free, near=found.fit.x)), key=lambda h: h.score)
        if found.names not in self._done or found.score > self._done[found.names].score:
            self._done[found.names] = found
        return self._done[found.names]

    def _merged(self, best: Hypothesis) -> Hypothesis:
        """Try to replace two effects of the same equation by one."""
        for pair in itertools.combinations(best.fit.spec, 2):
            if len({self.discrepancy.main_part(best.fit, name) for name in pair}) == 1:
                trial = max([best, *self._neighbours(best, frozenset(pair), 2)], key=self._ranked)
                if trial is not best:
                    return self._merged(trial)
        return best

    def _pruned(self, best: Hypothesis, odds: float = 0.0) -> Hypothesis:
        """Remove effects whose evidence beside the others is below some log odds."""
        while len(best.fit.spec) > 1:
            rests = [{k: v for k, v in best.fit.spec.items() if k != name} for name in best.fit.spec]
            chosen = max((self._refined(rest, best, self._far_behind(best)) for rest in rests), key=self._ranked)
            (own, least), (also, score) = self._ranked(best), self._ranked(chosen)
            if (also, score + odds) <= (own, least):
                break
            best = chosen
        return best

    def _alternatives(self, best: Hypothesis, name: str) -> list[Hypothesis]:
        """Return the best set with one effect replaced by others, the highest score first."""
        self._neighbours(best, frozenset({name}), KEPT)
        others = best.names - {name}
        if (twin := self.evidence.twins.get(name)) in self.usable and twin not in best.names:
            # Effects that commute are equivalent on the log but for initial memory, which cannot decide. A steady force
            # that opposes a motion without reversals is dry friction.
            spec = best.fit.spec
            start = {p.name: spec[name].get(p.name, p.nominal) for p in self.evidence.effects[twin].parameters}
            key = others | {twin}
            near = self._refined_as({**{k: spec[k] for k in others}, twin: start}, best)
            force = adds(self.evidence.effects[twin]) and self.evidence.effects[twin].follows_path()
            if not force or near.plain > best.plain - CLASS:
                self._done[key] = replace(near, score=best.score)
        return self._in_place(best, name)

    def _in_place(self, best: Hypothesis, name: str) -> list[Hypothesis]:
        """Return the refitted sets with one effect of the best set replaced, and that set."""
        others = best.names - {name}
        found = [h for key, h in self._done.items() if others < key and len(key) == len(best.names)]
        # What explains no more than the others do without it takes nobody's place.
        least = self._done.get(others, self.base).score
        found = [h for h in found if h is best or (h.score > least and not self._ruled_out(h))]
        found = [h for h in found if h is best or not any(self.degenerate(h.fit, n) for n in h.fit.spec)]
        return sorted(found, key=lambda h: -h.score)

    def _unsettled(self, spec: Spec) -> dict[str, dict[str, float]] | None:
        """Return effects with half-unknown initial memory; None where none has any, or all have already."""
        out = {name: dict(values) for name, values in spec.items()}
        slots = slots_of(self.evidence.effects, spec)
        settled = [(n, p) for n, p in slots if p.before and spec[n][p.name] == 0.0]
        for name, p in settled:
            out[name][p.name] = 0.5
        return out if settled else None
