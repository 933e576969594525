r"""Which sets of effects could explain residuals: subsets scored from products of sensitivities.

The library is linearised once. A set of effects is then a few columns, and what it explains follows from their inner
products with each other, with the residual and with what has a tolerance, equation by equation:

.. math:: \ell(S) = \max_{x, s} -\sum_e w_e \Big[n_e \log s_e + \frac{\|z_e + A_e x\|^2}{2 s_e^2}\Big]
    - \tfrac{1}{2} x^\top \Lambda x, \qquad s_e \ge 1

with the scale s of each equation profiled out, so that a faint effect counts as soon as a strong one is explained.
Sets are grown breadth first: one more effect of all, the best few kept, their grid points chosen again.

References
----------
G. M. Furnival, R. W. Wilson, "Regressions by leaps and bounds", Technometrics 16(4), 1974.
https://doi.org/10.1080/00401706.1974.10489231
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from ..settings import KEPT, OF_ITS_OWN
from .sensitivity import Template
from .student_t import bounded

ROUNDS = 4
"""Rounds of coefficients and scales in turn: from the scales of a set near by they change little."""


@dataclass(frozen=True)
class Subset:
    """A set of effects at grid points, fitted to first order."""

    templates: tuple[int, ...]
    """Places of its templates in the library."""
    x: np.ndarray
    """Coefficients of the fixed columns and of the templates' columns, shape (n_fixed + n_columns,)."""
    loglik: float
    """Approximate log-likelihood."""
    score: float
    """The same less the penalty of its effects."""
    scales: np.ndarray
    """Scale of each equation's residual, shape (n_equations,)."""
    left: np.ndarray
    """Sum of squares of each equation's residual, shape (n_equations,)."""


class _Alike(NamedTuple):
    """Templates with as many columns: their places, that number, and the products of each one's columns."""

    places: np.ndarray
    size: int
    blocks: np.ndarray


class Subsets:
    """Sets of effects about a fit."""

    def __init__(
        self,
        z: np.ndarray,
        fixed: np.ndarray,
        lower: np.ndarray,
        upper: np.ndarray,
        precision: np.ndarray,
        library: Sequence[Template],
        cost: Mapping[str, float],
        parts: Sequence[slice],
        weights: np.ndarray,
        share: np.ndarray,
    ) -> None:
        self.library, self.cost = list(library), cost
        self._effects = {t.effect for t in self.library}
        self._root = np.sqrt(weights)
        self.z, self.fixed = z * self._root, fixed * self._root[:, None]
        self.lower, self.upper, self.precision = lower, upper, precision
        self.parts, self.share = parts, share
        self.count = np.array([float(np.sum(weights[p])) for p in parts])
        sizes = [t.columns.shape[1] for t in self.library]
        ends = np.concatenate([[0], np.cumsum(sizes)]).astype(int)
        self.places = [slice(int(a), int(b)) for a, b in pairwise(ends)]
        self.columns = (
            np.column_stack([t.columns for t in self.library]) * self._root[:, None]
            if self.library
            else np.zeros((len(z), 0))
        )
        self._begins, self._lower, self._upper = ends[:-1], [t.lower for t in library], [t.upper for t in library]
        self._alike = [self._kind(np.flatnonzero(np.equal(sizes, n)), n) for n in sorted(set(sizes))]
        self._own = np.array([self.columns[p].T @ self.z[p] for p in parts])
        self._own_fixed = np.array([self.fixed[p].T @ self.z[p] for p in parts])
        self._products: dict[int, np.ndarray] = {}
        self._across = np.array([self.fixed[p].T @ self.columns[p] for p in parts])
        self._inner = np.array([self.fixed[p].T @ self.fixed[p] for p in parts])
        self._bare = self._scales(np.array([float(self.z[p] @ self.z[p]) for p in parts]))
        # Scales from before the fit of tolerances decrease slowly.
        self._bare = self.fit((), rounds=10 * ROUNDS).scales

    def _kind(self, places: np.ndarray, size: int) -> _Alike:
        columns = self._begins[places][:, None] + np.arange(size)
        blocks = np.empty((len(self.parts), len(places), size, size))
        for e, part in enumerate(self.parts):
            A = self.columns[part][:, columns]
            blocks[e] = A.transpose(1, 2, 0) @ A.transpose(1, 0, 2)
        return _Alike(places, size, blocks)

    # --- one set ----------------------------------------------------------------------------------------------
    def fit(self, templates: tuple[int, ...], near: Subset | None = None, rounds: int = ROUNDS) -> Subset:
        """Fit a set of templates and the scales of the equations, starting from those of a nearby set."""
        A = np.column_stack([self.fixed, *(self.columns[:, self.places[t]] for t in templates)])
        lower, upper = self._bounds(templates)
        precision = np.concatenate([self.precision, np.zeros(A.shape[1] - len(self.precision))])
        G = np.array([A[p].T @ A[p] for p in self.parts])
        b = np.array([A[p].T @ self.z[p] for p in self.parts])
        zz = np.array([float(self.z[p] @ self.z[p]) for p in self.parts])
        scales = self._bare if near is None else near.scales
        x, left, loglik = np.zeros(A.shape[1]), zz, -np.inf
        for _ in range(rounds):
            c = self.share / scales**2
            H = np.tensordot(c, G, 1) + np.diag(precision)
            x = bounded(H, -np.tensordot(c, b, 1), lower, upper)
            left = zz + 2.0 * b @ x + np.einsum("i,eij,j->e", x, G, x)
            scales = self._scales(left)
            found = -float(self.share @ (self.count * np.log(scales) + 0.5 * left / scales**2))
            found -= 0.5 * float(precision @ (x * x))
            if abs(found - loglik) < 0.05:
                loglik = found
                break
            loglik = found
        cost = sum(self.cost[self.library[t].effect] for t in templates)
        return Subset(templates, x, loglik, loglik - cost, scales, left)

    def unweighted(self, subset: Subset) -> np.ndarray:
        """Return the residuals after a set, in units of the noise."""
        A = np.column_stack([self.fixed, *(self.columns[:, self.places[t]] for t in subset.templates)])
        return (self.z + A @ subset.x) / np.maximum(self._root, 1e-12)

    def _scales(self, left: np.ndarray) -> np.ndarray:
        return np.sqrt(np.maximum(1.0, left / np.maximum(self.count, 1.0)))

    # --- one more effect --------------------------------------------------------------------------------------
    def gains(self, subset: Subset, only: Sequence[int] | None = None) -> np.ndarray:
        """Return the gain in log-likelihood of each template beside a set; coefficients at their bounds stay there."""
        c = self.share / subset.scales**2
        columns = [k for t in subset.templates for k in range(self.places[t].start, self.places[t].stop)]
        GST = np.tensordot(c, self._across, 1)
        if subset.templates:
            GST = np.concatenate([GST, *(np.tensordot(c, self._with_all(t), 1) for t in subset.templates)])
        m = self.fixed.shape[1]
        G = np.zeros((len(GST), len(GST)))
        G[:m, :m] = np.tensordot(c, self._inner, 1) + np.diag(self.precision)
        G[:, m:] = GST[:, columns]
        G[m:, :m] = GST[:m, columns].T
        slope = np.tensordot(c, self._own, 1) + subset.x @ GST
        fixed = np.tensordot(c, self._own_fixed, 1) + subset.x @ G[:, :m]
        free = self._inside(subset)
        # The scales have moved a little since the coefficients were found, which now move with them.
        still = np.concatenate([fixed, slope[columns]])[free]
        GST, G = GST[free], G[np.ix_(free, free)]
        size = np.sqrt(np.maximum(np.diag(G), 1e-300))
        weighted = GST / size[:, None]
        scaled = G / np.outer(size, size) + 1e-9 * np.eye(len(G))
        projected = np.linalg.solve(scaled, weighted) if len(G) else weighted
        slope = slope - (still / size) @ projected
        out = np.zeros(len(self.library))
        outside: list[tuple[int, np.ndarray, np.ndarray, np.ndarray, np.ndarray]] = []
        for kind in self._alike:
            k = kind.places if only is None else np.intersect1d(kind.places, np.asarray(only, dtype=int))
            if not len(k):
                continue
            columns = self._begins[k][:, None] + np.arange(kind.size)
            own = np.tensordot(c, kind.blocks[:, np.searchsorted(kind.places, k)], 1)
            S = own - weighted[:, columns].transpose(1, 2, 0) @ projected[:, columns].transpose(1, 0, 2)
            outside += self._gained(out, k, S, own, slope[columns])
        # The loss by bounds matters only for those that would be chosen without them.
        for at, S, g, low, high in sorted(outside, key=lambda v: (-out[v[0]], v[0]))[: 8 * KEPT]:
            y = bounded(S, -g, low, high)
            out[at] = max(0.0, -float(g @ y + 0.5 * y @ S @ y))
        return out

    def _gained(
        self, out: np.ndarray, places: np.ndarray, S: np.ndarray, own: np.ndarray, slope: np.ndarray
    ) -> list[tuple[int, np.ndarray, np.ndarray, np.ndarray, np.ndarray]]:
        """Write the gains of templates of one size into an array; return those that leave their bounds."""
        diagonal = np.einsum("kii->ki", own)
        usable = np.einsum("kii->ki", S) > 1e-6 * diagonal
        outside = []
        for mask in np.unique(usable, axis=0):
            if not mask.any():
                continue
            of = np.flatnonzero(np.all(usable == mask, axis=1))
            T = S[of][:, mask][:, :, mask]
            at = np.arange(T.shape[1])
            T[:, at, at] += 1e-9 * diagonal[of][:, mask]
            g = slope[of][:, mask]
            low, high = (np.array([v[k][mask] for k in places[of]]) for v in (self._lower, self._upper))
            if T.shape[1] == 1:
                y = np.clip(-g / T[:, 0], low, high)
            else:
                y = np.linalg.solve(T, -g[..., None])[..., 0]
                left = np.flatnonzero(np.any((y < low) | (y > high), axis=1))
                outside += [(int(places[of[j]]), T[j], g[j], low[j], high[j]) for j in left]
            found = np.sum(g * y, axis=1) + 0.5 * np.einsum("ki,kij,kj->k", y, T, y)
            out[places[of]] = np.maximum(0.0, -found)
        return outside

    def _bounds(self, templates: tuple[int, ...]) -> tuple[np.ndarray, np.ndarray]:
        """Return the bounds of the coefficients of a set."""
        lower = np.concatenate([self.lower, *(self.library[t].lower for t in templates)])
        upper = np.concatenate([self.upper, *(self.library[t].upper for t in templates)])
        return lower, upper

    def _inside(self, subset: Subset) -> np.ndarray:
        """Return which coefficients of a set are within their bounds."""
        lower, upper = self._bounds(subset.templates)
        return np.asarray((subset.x > lower) & (subset.x < upper))

    def _with_all(self, t: int) -> np.ndarray:
        """Return the products of a template's columns with all columns, equation by equation."""
        if t not in self._products:
            mine = self.columns[:, self.places[t]]
            self._products[t] = np.array([mine[p].T @ self.columns[p] for p in self.parts])
        return self._products[t]

    # --- all sets ---------------------------------------------------------------------------------------------
    def grow(self, most: int) -> list[Subset]:
        """Return sets of up to so many effects, the best score first, one for each set of names."""
        first = self.fit(())
        found: dict[frozenset[str], Subset] = {frozenset(): first}
        beam = [first]
        while beam and len(beam[0].templates) < most:
            children: dict[frozenset[str], Subset] = {}
            for parent, t in self._promising(beam):
                child = self.fit((*parent.templates, t), parent)
                if not self._of_its_own(child, parent, first):
                    continue
                names = self._names(child.templates)
                if names not in children or child.score > children[names].score:
                    children[names] = child
            # All pairs are tried; of larger sets the best one of each combination of families.
            ranked = sorted(children.values(), key=lambda s: -s.score)
            ranked = ranked if len(beam[0].templates) == 0 else self._distinct(ranked)[:KEPT]
            # The grid matters for what is refitted, and only the first few are.
            beam = [self._regridded(s) if k < 2 and len(s.templates) > 1 else s for k, s in enumerate(ranked)]
            best = max((s.score for s in found.values()), default=-np.inf)
            for s in beam:
                found[self._names(s.templates)] = s
            # One effect may help only beside another, which is seen a step later.
            if not beam or (max(s.score for s in beam) <= best and len(beam[0].templates) > 1):
                break
        return sorted(found.values(), key=lambda s: -s.score)

    def _of_its_own(self, child: Subset, parent: Subset, first: Subset) -> bool:
        """Return whether a set adds more to another than an inexact form of the other's effects could."""
        if not any(self.library[t].inexact for t in parent.templates):
            return True
        added, there = parent.left - child.left, first.left - parent.left
        return bool(np.any((added > OF_ITS_OWN**2 * there) & (added > 0.3 * np.max(added))))

    def _names(self, templates: tuple[int, ...]) -> frozenset[str]:
        return frozenset(self.library[t].effect for t in templates)

    def _promising(self, beam: Sequence[Subset]) -> list[tuple[Subset, int]]:
        """Return the most promising sets with one effect more, each effect at the grid point that adds most."""
        best: dict[frozenset[str], tuple[float, Subset, int]] = {}
        for parent in [*beam, *self._elsewhere(beam)]:
            gains, names, own = self.gains(parent), self._names(parent.templates), set[str]()
            there = {self.library[t].root for t in parent.templates}  # of two forms of one law, a set has one
            for t in np.argsort(-gains, kind="stable"):
                effect = self.library[t].effect
                if effect in own or self.library[t].root in there:
                    continue
                own.add(effect)
                promised = parent.score + float(gains[t]) - self.cost[effect]
                if names | {effect} not in best or promised > best[names | {effect}][0]:
                    best[names | {effect}] = promised, parent, int(t)
        ranked = sorted(best.values(), key=lambda found: -found[0])
        found = [(parent, t) for _, parent, t in ranked[: len(self._effects) if not beam[0].templates else 2 * KEPT**2]]
        return found + self._both_ways(beam) if len(beam[0].templates) == 1 else found

    def _both_ways(self, singles: Sequence[Subset]) -> list[tuple[Subset, int]]:
        """Return the pairs of the best single effects, from either: tolerances fitted to one may hide the other."""
        best = sorted(singles, key=lambda s: -s.score)[: 2 * KEPT]
        roots = {s.templates[0]: self.library[s.templates[0]].root for s in best}
        return [(s, t) for s in best for t in roots if roots[t] != roots[s.templates[0]]]

    def _elsewhere(self, beam: Sequence[Subset]) -> list[Subset]:
        """Return single effects at other points of their grids: beside others, one may be larger than by itself."""
        singles = {s.templates[0]: s for s in beam if len(s.templates) == 1}
        effects = {self.library[t].effect for t in singles}
        return [
            self.fit((t,), beam[0])
            for t, template in enumerate(self.library)
            if template.effect in effects and t not in singles and not template.linear
        ]

    def _distinct(self, ranked: Sequence[Subset]) -> list[Subset]:
        """Return the best set of each combination of families."""
        best: dict[tuple[str, ...], Subset] = {}
        for s in ranked:
            alike = tuple(sorted(self.library[t].family or self.library[t].effect for t in s.templates))
            best.setdefault(alike, s)
        return list(best.values())

    def _regridded(self, subset: Subset) -> Subset:
        """Return a set with each effect's grid point reselected beside the others."""
        for k, t in enumerate(subset.templates):
            rest = self.fit((*subset.templates[:k], *subset.templates[k + 1 :]), subset, rounds=2)
            same = [i for i, other in enumerate(self.library) if other.effect == self.library[t].effect]
            if len(same) < 2:
                continue
            gains = self.gains(rest, same)
            best = max(same, key=lambda i: gains[i])
            if best != t:
                trial = self.fit((*subset.templates[:k], best, *subset.templates[k + 1 :]), subset)
                if trial.score > subset.score:
                    subset = trial
        return subset
