"""Sensitivities of the residuals to every effect of the library, on a grid of the nonlinear parameters."""

import itertools
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...effects import Effect, Parameter
from ..residuals.protocol import ResidualSource, Spec
from ..settings import EXCESS, LEAST_GAIN
from .student_t import loglik, scale

_REACH = 12.0
"""How far, as a factor, the grid of a positive nonlinear parameter reaches to both sides of its typical value."""
POINTS = {1: 6, 2: 4}
"""Points of the grid by the number of nonlinear parameters; more than two get three each."""
PEAKS = 4
"""Periods that compete: a search among sets costs a power of their number, and a sine is not explained by others."""


@dataclass(frozen=True)
class Template:
    """An effect at one point of its grid, linear in its remaining parameters."""

    effect: str
    """Its name."""
    fixed: dict[str, float]
    """Values of the parameters on the grid."""
    linear: tuple[str, ...]
    """The parameters that the columns belong to; empty where the only column is the effect as a whole."""
    columns: np.ndarray
    """Change of the residuals for a unit of each parameter, or for the effect as it stands. Shape (n_windows,
    n_columns)."""
    lower: np.ndarray
    upper: np.ndarray
    """Bounds of the coefficients, shape (n_columns,)."""
    top: float = np.inf
    """Of a limit, where it begins to act: what the signal reaches."""
    kind: type[Effect] | None = None
    """The effect."""
    of: float = 1.0
    """Points of a fine grid for each that was kept since it closes most: noise has as many chances."""
    x: np.ndarray | None = None
    """Deviations of the tolerances about which it is linearised; None for none."""

    @property
    def family(self) -> str:
        """The effect's family; empty without a kind."""
        return self.kind.family if self.kind is not None else ""

    @property
    def root(self) -> str:
        """The law that the effect is, or extends, at its place."""
        return root_of(self.effect, self.kind)

    @property
    def inexact(self) -> bool:
        """Whether the effect has a form that may be inexact."""
        return self.kind is not None and has_form(self.kind)

    def starts(self, x: np.ndarray) -> list[dict[str, float]]:
        """Return all parameters of the effect at fitted coefficients, in one or two interpretations."""
        if self.linear:
            return [{**self.fixed, **{name: float(v) for name, v in zip(self.linear, x, strict=False)}}]
        found = [dict(self.fixed)]
        sizes = [p for p in self.kind.parameters if not p.share] if self.kind is not None else []
        if len(sizes) == 1 and x[0] > 0.0 and not 0.7 <= x[0] <= 1.0 / 0.7 and sizes[0].lower >= 0.0:
            # Part of an effect that vanishes with its only size, or with its inverse, is the effect with part of it;
            # more than all of it is the effect with more.
            [p], share = sizes, float(max(x[0], 0.005))
            found.append({**self.fixed, p.name: min(p.upper, p.lower + (self.fixed[p.name] - p.lower) * share)})
            found.append({**self.fixed, p.name: float(np.clip(self.fixed[p.name] / share, p.lower, p.upper))})
            # Part of a limit's effect is a limit nearer to what the signal reaches.
            if share < 1.0 and p.idle and self.top < np.inf:
                found.append({**self.fixed, p.name: self.top + (self.fixed[p.name] - self.top) * share})
        return found


def templates(evidence: ResidualSource, name: str) -> list[Template]:
    """Return an effect's templates; none if it changes no equation that the log allows."""
    return laid(evidence, name) if evidence.touched([name]) else []


def laid(evidence: ResidualSource, name: str, x: np.ndarray | None = None) -> list[Template]:
    """Return the same at deviations x, by default none, without first checking whether it changes anything."""
    effect = evidence.effects[name]
    linear = [p for p in effect.parameters if p.linear]
    others = [evidence.reached(p) for p in effect.parameters if not p.linear]
    if not linear and len(others) == 1 and others[0].lower < 0.0:
        return _small_change(evidence, name, others[0])
    points = itertools.product(*(grid(p, sum(not q.refines for q in others)) for p in others))
    grids = [{p.name: float(v) for p, v in zip(others, point, strict=True)} for point in points]
    every = len(grids)
    if any(p.spacing for p in others):
        grids = _peaks(evidence, name, grids, linear)
    found = []
    for fixed in grids:
        D = _columns(evidence, name, fixed, linear, x=x)
        bounds = [(p.lower, p.upper) for p in linear] or [(0.0, 2.0)]
        if np.all(np.isfinite(D)) and np.any(D):
            lower, upper = np.array(bounds, dtype=float).T
            top = min((p.upper for p in others if p.idle), default=np.inf)
            names, of = tuple(p.name for p in linear), every / len(grids)
            found.append(Template(name, fixed, names, D, lower, upper, top, effect, of, x))
    return found


def _columns(
    evidence: ResidualSource,
    name: str,
    fixed: Mapping[str, float],
    linear: Sequence[Parameter],
    beside: Spec | None = None,
    roughly: bool = False,
    x: np.ndarray | None = None,
) -> np.ndarray:
    """Return the change by a unit of each linear parameter of an effect, or by the effect as a whole, beside others."""
    spec, x = dict(beside or {}), np.zeros(len(evidence.free)) if x is None else x

    def change(values: Mapping[str, float]) -> np.ndarray:
        return evidence.glance({name: values}) if roughly else evidence.change({**spec, name: values}, spec, x)

    columns = []
    for p in linear:
        alone = {q.name: _unit(p) if q is p else 0.0 for q in linear}
        columns.append(change({**fixed, **alone}) / _unit(p))
    return np.column_stack(columns or [change(dict(fixed))])


def relinearised(evidence: ResidualSource, found: Sequence[Template], spec: Spec) -> list[Template]:
    """Return templates beside given effects: a muscle that cannot push shows where others would push."""
    reach = evidence.reach(spec) if spec else None
    if reach is None:
        return list(found)
    out = []
    for t in found:
        D, effect = t.columns * reach[:, None], evidence.effects[t.effect]
        if not adds(effect) and t.effect not in spec:
            linear = [p for p in effect.parameters if p.name in t.linear]
            D = _columns(evidence, t.effect, t.fixed, linear, spec)
        out.append(replace(t, columns=D) if np.all(np.isfinite(D)) else t)
    return out


_CONSTITUTIVE = {"force", "flow", "command", "supply", "valve", "torque"}


def law_of(name: str) -> str:
    """Return an effect's name without the form of its law, which stands in brackets."""
    return re.sub(r" \([^)]*\)", "", name)


def root_of(name: str, effect: type[Effect] | None) -> str:
    """Return the law that an effect is, or extends, at its place: a set has it once."""
    law, at, place = law_of(name).partition("@")
    return f"{effect.extends if effect is not None and effect.extends else law}{at}{place}"


def has_form(effect: type[Effect]) -> bool:
    """Return whether an effect has a form that may be inexact; a sensor's offset or gain or a wrong length has none."""
    return bool(_CONSTITUTIVE & set(effect.hooks())) or effect.n_states > 0


def adds(effect: type[Effect]) -> bool:
    """Return whether an effect adds to equations and changes nothing that others read."""
    return set(effect.hooks()) <= {"force", "flow", "torque", "valve"}


def grid(p: Parameter, n_nonlinear: int) -> Sequence[float]:
    """Return the grid of a nonlinear parameter."""
    if p.before or p.skew or p.refines:  # an exact fit starts from there
        return [p.nominal]
    if (p.idle or p.idle_below) and not p.points:  # what counts is how far within
        end, inward = (p.lower, 1.0) if p.idle_below else (p.upper, -1.0)
        within = np.geomspace(abs(end - p.nominal) / _REACH, p.upper - p.lower, POINTS[1])
        return np.clip(end + inward * within, p.lower, p.upper).tolist()
    if p.spacing:
        return p.resolved()
    if p.lower < 0.0:
        return np.linspace(p.lower, p.upper, 4, endpoint=False).tolist()
    if p.nominal == 0.0 or p.share:
        return [0.0, p.upper]
    low, high = max(p.lower, p.nominal / _REACH), min(p.upper, p.nominal * _REACH)
    if p.points:
        return np.geomspace(low, high, p.points + 2)[1:-1].tolist()
    points = POINTS.get(n_nonlinear, 3)
    return np.geomspace(low, high, points if high > 3.0 * low or n_nonlinear == 1 else 2).tolist()


def _unit(p: Parameter) -> float:
    return p.nominal if p.nominal else 0.01 * p.upper


def _small_change(evidence: ResidualSource, name: str, p: Parameter) -> list[Template]:
    """Return the template of a parameter that changes the equations themselves, to first order."""
    h = 0.1 * p.nominal if p.nominal else 0.01 * p.upper
    D = evidence.change({name: {p.name: h}}, {}, np.zeros(len(evidence.free))) / h
    if not np.any(D):
        return []
    bounds = np.array([p.lower]), np.array([p.upper])
    near = Template(name, {}, (p.name,), D[:, None], *bounds, kind=evidence.effects[name])
    return [near, *(_far(evidence, name, p, D) if p.factor else ())]


def _far(evidence: ResidualSource, name: str, p: Parameter, D: np.ndarray) -> list[Template]:
    """Return the likeliest template of a factor of e or more, by simulation until the likelihood levels off."""
    none = np.zeros(len(evidence.free))
    Q = np.linalg.qr(evidence.J)[0] if evidence.J.shape[1] else np.zeros((len(D), 0))
    own, left = D - Q @ (Q.T @ D), evidence.z0 - Q @ (Q.T @ evidence.z0)
    if all(scale(left[part], 0.0) <= 1.0 + EXCESS for part in evidence.parts):
        return []  # it takes runs of a simulator, and there is nothing to explain
    wanted = -float(own @ evidence.z0) / max(float(own @ own), 1e-300)
    if 1.0 < math.e * (1.0 + wanted) < math.e**2:
        return []

    def likelihood(z: np.ndarray) -> float:
        return loglik(z - Q @ (Q.T @ z), evidence.parts, evidence.weights)[0]

    best, rise, found = likelihood(evidence.z0), 0.0, []
    for power in itertools.count(1):
        value = math.expm1(math.copysign(power, wanted))
        if not p.lower < value < p.upper:
            break
        z = evidence.tangent({name: {p.name: value}}, none)
        if not np.all(np.isfinite(z)) or not (now := likelihood(z)) > best + min(rise, LEAST_GAIN):
            break
        best, rise, found = now, now - best, [Template(name, {p.name: value}, (), (z - evidence.z0)[:, None],
                                     np.zeros(1), np.full(1, 2.0), kind=evidence.effects[name])]  # fmt: skip
    return found


def _peaks(
    evidence: ResidualSource, name: str, grids: list[dict[str, float]], linear: Sequence[Parameter]
) -> list[dict[str, float]]:
    """Return the points of a fine grid at which an effect closes more than at their neighbours, the best of them."""
    if len(grids) <= PEAKS:
        return grids
    Q = np.linalg.qr(evidence.J)[0] if evidence.J.shape[1] else np.zeros((len(evidence.z0), 0))
    left = evidence.z0 - Q @ (Q.T @ evidence.z0)
    gains = np.full(len(grids), -np.inf)
    for k, fixed in enumerate(grids):
        columns = _columns(evidence, name, fixed, linear, roughly=True)
        if np.all(np.isfinite(columns)) and np.any(columns):
            columns = columns - Q @ (Q.T @ columns)
            gains[k] = float(np.sum((np.linalg.qr(columns)[0].T @ left) ** 2))
    around = np.pad(gains, 1, constant_values=-np.inf)
    highest = np.flatnonzero((gains >= around[:-2]) & (gains >= around[2:]) & (gains > -np.inf))
    return [grids[k] for k in sorted(highest[np.argsort(-gains[highest])][:PEAKS])]
