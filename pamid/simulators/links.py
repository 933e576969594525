"""Pairs of simulator ports between which effects can act: their difference, and the response of each end."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from ..errors import ParameterError, UnknownOptionError
from ..signals.units import UNITS
from .base import Simulator
from .between import Between, ends_of
from .dimensions import unit_powers
from .lever import Lever
from .reciprocity import MOSTLY, SAME, STEP, Mass, Slopes, SomeInstants, factor_of, slopes
from .shares import Shares, scaled_shares
from .structure import JointPort, rate_unit, spread_numbers, why_left_out

_FORCES = ("N", "N m")
FAR = 100.0
"""Steps of a slope over which it is asked how the slope itself changes."""
MOST_STATES = 40
"""Number of states above which only named pairs are used, since finding pairs probes every state."""


class LinkEnd(NamedTuple):
    """One of two ports."""

    port: str
    """Its name."""
    state: str
    """The velocity or level whose rate changes."""
    across: str
    """The position or path of a joint, the level of a chamber."""
    through: str
    """The input that acts there, where a port names one."""
    unit: str
    """Unit of the across variable."""
    domain: str
    """``"motion"``, ``"store"`` or ``"temperature"``."""


@dataclass(frozen=True)
class Link:
    r"""Two ports between which effects act.

    Across them is :math:`\delta = x_1 - r x_2`; f, which acts on the first, acts as :math:`-r f` on the second.
    """

    name: str
    """Both ends as one text."""
    first: LinkEnd
    second: LinkEnd
    """The ends."""
    ratio: float
    """r, in the units of the ports."""
    unit: str
    """Unit of f."""
    shares: Shares | None
    """Change of each end's rate, see `Shares`; None where both ends have inputs that act on them."""
    stiffness: float = 0.0
    damping: float = 0.0
    """Of the simulator's own coupling, f per difference of positions and of velocities; 0 where it has none."""
    typical: tuple[float, float] = (1.0, 1.0)
    """Typical change of the residual at each end by one unit of f: of a rate, or 1 where residuals are forces."""

    @property
    def ends(self) -> tuple[LinkEnd, LinkEnd]:
        """Both ends."""
        return self.first, self.second

    @property
    def domain(self) -> str:
        """Domain of the exchange: motion, storage, or heat."""
        return self.first.domain

    @property
    def lever(self) -> float:
        """The ratio in SI."""
        return self.ratio * factor_of(self.first.unit) / factor_of(self.second.unit)

    @property
    def follows(self) -> dict[str, str]:
        """The signal behind each role of an effect, by the names of `across`."""
        roles = {"position": "across", "velocity": "state"} if self.domain == "motion" else {"pressure": "across"}
        return {role: f"{getattr(self.first, at)} - {getattr(self.second, at)}" for role, at in roles.items()}

    @property
    def sources(self) -> dict[str, tuple[str, str]]:
        """The two signals behind each difference."""
        pairs = [(getattr(self.first, at), getattr(self.second, at)) for at in ("across", "state")]
        return {f"{a} - {b}": (a, b) for a, b in pairs}

    def across(self, found: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Return the missing differences between the ends, from signals by name."""
        here = {n: s for n, s in self.sources.items() if n not in found and s[0] in found and s[1] in found}
        return {name: found[a] - self.ratio * found[b] for name, (a, b) in here.items()}

    def push(
        self, force: Any, simulator: Simulator, at: tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray],
        u: np.ndarray, added: np.ndarray,
    ) -> None:  # fmt: skip
        """Apply a force or flow to both ends: to inputs `u`, or rates `added`, in place."""
        if self.shares is None:
            names = simulator.inputs
            u[names.index(self.first.through)] += force
            u[names.index(self.second.through)] -= self.lever * force
            return
        one, two = self.shares(*at)
        states = simulator.states
        added[states.index(self.first.state)] += one * force
        added[states.index(self.second.state)] -= two * self.lever * force

    def release(
        self, half_width: float, damped: float, simulator: Simulator,
        at: tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray], added: np.ndarray,
    ) -> None:  # fmt: skip
        """Take away from rates what the simulator's own coupling transmits within a play, under parameters as they are.

        Each end gets what it would get if the other one stood nearer by the play, and moved along within it.
        """
        t, x, u, p = at
        rows = {end: [simulator.states.index(n) for n in (end.across, end.state)] for end in self.ends}
        apart = x[rows[self.first]] - self.ratio * x[rows[self.second]]
        within = np.abs(apart[0]) < half_width
        less = np.stack([np.clip(apart[0], -half_width, half_width), np.where(within, (1.0 - damped) * apart[1], 0.0)])
        nearer, along = x.copy(), x.copy()
        nearer[rows[self.second]] += less / self.ratio
        along[rows[self.first]] -= less
        times, n = np.tile(t, 3) if np.ndim(t) else t, x.shape[1]
        rates = simulator.rate(times, np.hstack([x, nearer, along]), np.tile(u, 3), np.tile(p, 3))
        for k, end in enumerate(self.ends, 1):
            row = rows[end][1]
            added[row] += rates[row, k * n : (k + 1) * n] - rates[row, :n]


# --- ends ---------------------------------------------------------------------------------------------------
def ends_in(simulator: Simulator, joints: Sequence[JointPort]) -> list[LinkEnd]:
    """Return the ports of a simulator at which an effect between two can end."""
    declared = {p.name: p for p in simulator.ports if p.kind in ("joint", "chamber")}
    found, moving = [], set()
    for j in joints:
        moving |= {j.position, j.velocity}
        through = declared[j.name].through if j.name in declared else ""
        unit = simulator.port(j.position).unit if j.position else simulator.port(j.velocity).unit.removesuffix("/s")
        found.append(LinkEnd(j.name, j.velocity, j.position or f"{j.name}.path", through, unit or "-", "motion"))
    chambers = {p.level: p for p in declared.values() if p.kind == "chamber"}
    for level in dict.fromkeys((*simulator.states, *chambers)):
        if level not in moving:
            port, unit = chambers.get(level), simulator.port(level).unit
            hot = unit in UNITS and UNITS[unit].dimension == "temperature"
            through = port.through if port else ""
            domain = "temperature" if hot else "store"
            found.append(LinkEnd(port.name if port else level, level, level, through, unit, domain))
    return found


def _named(ends: Sequence[LinkEnd], name: str, simulator: Simulator) -> LinkEnd:
    for end in ends:
        if name in (end.port, end.state, end.across):
            return end
    known = ", ".join(end.port for end in ends) or "there is none"
    for port in simulator.ports:
        if port.name == name and port.kind == "joint":
            raise UnknownOptionError(
                f"{why_left_out(port)} Nothing can act between it and another port.", f"one of {known}",
                "Log one of them, correct the joint, or take the ends away.",
            )  # fmt: skip
    raise UnknownOptionError(
        f"{name!r} is not a joint or chamber of the simulator.", f"one of {known}", "Correct the ends."
    )


# --- pairs --------------------------------------------------------------------------------------------------
def links_of(
    simulator: Simulator, joints: Sequence[JointPort], levers: Sequence[Lever], t: np.ndarray, x: np.ndarray,
    u: np.ndarray,
) -> list[Link]:  # fmt: skip
    """Return the pairs of ports between which effects can act: those that are named, and those that are coupled."""
    ends = ends_in(simulator, joints)
    own = simulator.form == "ode" and simulator.inertia(x[:, :1]) is None
    asked = own and 1 < len(simulator.states) <= MOST_STATES and x.shape[1] > 0
    known = Slopes(simulator, SomeInstants.of(t, x, u)) if asked else None
    said = [*simulator.between]
    for _, where, _ in simulator.effects:
        both = ends_of(where)
        if both and not any({b.first, b.second} == set(both) for b in said):
            said.append(Between(*both))
    dampers = {lever.velocities: lever for lever in levers} if known is not None else {}
    found = [_sized_by(_said(simulator, b, ends, known, dampers), simulator, (t, x, u)) for b in said]
    taken = [{link.first.port, link.second.port} for link in found]
    for a, b in itertools.combinations(ends, 2) if known is not None else ():
        if {a.port, b.port} not in taken and _alike(a, b):
            link = _coupled(known, Between(a.port, b.port), a, b)  # type: ignore[arg-type]
            link = link or _levered(dampers.get((a.state, b.state)), a, b)
            found += [_sized_by(link, simulator, (t, x, u))] if link is not None else []
    return found


def _sized_by(link: Link, simulator: Simulator, at: tuple[np.ndarray, np.ndarray, np.ndarray]) -> Link:
    """Return a pair with the typical change of rates at its ends by one unit of force or flow."""
    if link.shares is None:
        return link
    shares = link.shares(*at, spread_numbers(simulator, len(at[0])))
    one, two = (float(np.median(np.abs(s))) for s in shares)
    return replace(link, typical=(one, two * abs(link.lever)))


def _alike(a: LinkEnd, b: LinkEnd) -> bool:
    """Return whether two ends store the same kind of quantity."""
    kinds = {_dimension(end.unit) for end in (a, b)}
    # An angle in rad is a plain number, as a port is without a unit.
    return a.domain == b.domain and (len(kinds) == 1 or (a.domain == "motion" and {a.unit, b.unit} == {"-", "rad"}))


def _dimension(unit: str) -> Any:
    return UNITS[unit].dimension if unit in UNITS else unit


def _said(
    simulator: Simulator, b: Between, ends: Sequence[LinkEnd], known: Slopes | None,
    levers: Mapping[tuple[str, ...], Lever],
) -> Link:  # fmt: skip
    first, second = (_named(ends, name, simulator) for name in (b.first, b.second))
    if first.domain != second.domain or first == second:
        raise ParameterError(
            f"{b.first} and {b.second} store different quantities ({first.unit} and {second.unit}).",
            "two joints, or two chambers of one kind",
            "Correct the ends.",
        )
    ratio = 1.0 if b.ratio is None else b.ratio
    units = [simulator.port(e.through).unit if e.through else "" for e in (first, second)]
    coupled = _coupled(known, b, first, second) if known is not None else None
    if all(units) and (first.domain != "motion" or set(units) <= set(_FORCES)):
        plain = Link(b.name, first, second, ratio, units[0], None)
        if coupled is None or coupled.shares is None:
            return plain
        # The simulator's own coupling, as an action on the input of the first end.
        size = _in_input(simulator, coupled, known)
        held = coupled.stiffness * size, coupled.damping * size
        return replace(plain, ratio=coupled.ratio, stiffness=held[0], damping=held[1])
    if b.inertia is not None:
        return _by_formula(simulator, b, first, second, ratio, coupled)
    if found := coupled or _levered(levers.get((first.state, second.state)), first, second):
        return found
    raise ParameterError(
        f"It is not known how {b.first} and {b.second} respond to an effect between them.",
        'inertia = ["...", "..."] under [[between]], or an input named with "through" at both ends',
        "Give the mass, inertia or capacity of each end, as a number or a formula of the parameters.",
    )


def _in_input(simulator: Simulator, coupled: Link, known: Slopes | None) -> float:
    """Return one unit of a coupling's force or flow in the unit of the input at its first end."""
    assert known is not None and coupled.shares is not None
    at, row = known.at, simulator.states.index(coupled.first.state)
    moved, k = at.u.copy(), simulator.inputs.index(coupled.first.through)
    p = spread_numbers(simulator, len(at.t))
    moved[k] += 1.0
    push = simulator.rate(at.t, at.x, moved, p)[row] - simulator.rate(at.t, at.x, at.u, p)[row]
    return float(np.median(np.broadcast_to(coupled.shares(at.t, at.x, at.u, p)[0], len(at.t)) / push))


def _by_formula(
    simulator: Simulator, b: Between, first: LinkEnd, second: LinkEnd, ratio: float, coupled: Link | None
) -> Link:  # fmt: skip
    """Return a pair whose simulator file states the inertia of each end."""
    from .equation_model import Formulas

    assert b.inertia is not None
    names = {"t", *simulator.states, *simulator.inputs, *simulator.parameters}
    asked = Formulas(dict(zip(("first", "second"), b.inertia, strict=True)), names)
    factors = [factor_of(e.unit) for e in (first, second)]

    def shares(t: np.ndarray, x: np.ndarray, u: np.ndarray, p: np.ndarray) -> tuple[Any, Any]:
        given = (dict(zip(n, v, strict=True)) for n, v in (
            (simulator.states, x), (simulator.inputs, u), (simulator.parameters, p)
        ))  # fmt: skip
        found = asked(t, *given)
        one, two = (1.0 / (found[k] * f) for k, f in zip(("first", "second"), factors, strict=True))
        return one, two

    link = Link(b.name, first, second, ratio, _flow_unit(simulator, first), shares)
    if coupled is None or coupled.shares is None:
        return link
    p = simulator.numbers
    here = np.zeros((len(simulator.states), 1)), np.zeros((len(simulator.inputs), 1))
    own, given = (float(np.ravel(s(np.zeros(1), *here, p[:, None])[0])[0]) for s in (coupled.shares, shares))
    size = own / given
    return replace(link, ratio=coupled.ratio, stiffness=coupled.stiffness * size, damping=coupled.damping * size)


def _flow_unit(simulator: Simulator, end: LinkEnd) -> str:
    """Return the SI unit of the force or flow at an end."""
    if end.domain == "motion":
        return "N m" if "rad" in unit_powers(end.unit) or end.unit in ("deg", "°") else "N"
    if end.domain == "temperature":
        return "W"
    return "m^3/s" if _dimension(end.unit) in ("pressure", "length") else rate_unit(simulator, end.state)


# --- what the simulator's own coupling says -----------------------------------------------------------------
def _coupled(known: Slopes, b: Between, first: LinkEnd, second: LinkEnd) -> Link | None:
    """Return a pair as the simulator couples it; None where it does not, or where that is ambiguous."""
    return (_moving if first.domain == "motion" else _storing)(known, b, first, second)


def _moving(known: Slopes, b: Between, first: LinkEnd, second: LinkEnd) -> Link | None:
    """Return two joints with a spring or damper between them."""
    rows = []
    for x1, x2 in ((first.across, second.across), (first.state, second.state)):
        here, there = known.of(first.state, x2), known.of(second.state, x1)
        if (here is None) != (there is None):
            return None  # a one-way action is not an element between two ports
        if here is not None and there is not None:
            rows.append((here, there, known.of(first.state, x1), known.of(second.state, x2)))
    weights = [here / there for here, there, _, _ in rows]
    if not rows or not all(known.constant(w) and float(np.median(w)) > 0.0 for w in weights):
        return None
    weight = float(np.median(weights[0]))
    if any(abs(float(np.median(w)) / weight - 1.0) > SAME for w in weights):
        return None
    one_unit, two_unit = factor_of(first.unit), factor_of(second.unit)
    lever = _lever(rows, one_unit / two_unit * b.ratio if b.ratio else None)
    if lever is None:
        return None
    masses = _masses(known, first, second)
    one, two, unit = _sized(known, first, weight, masses)
    values = [0.0, 0.0]
    for k, (x1, x2) in enumerate(((first.across, second.across), (first.state, second.state))):
        here = known.of(first.state, x2)
        if here is not None and known.of(second.state, x1) is not None:
            values[k] = float(np.median(here)) / (lever * one) * one_unit
    ratio = lever * two_unit / one_unit
    shares = _following(masses, (one / one_unit, two / two_unit))
    return Link(b.name, first, second, ratio, unit, shares, values[0], values[1])


def _levered(lever: Lever | None, first: LinkEnd, second: LinkEnd) -> Link | None:
    """Return two joints of a mechanism with a damper between them."""
    if lever is None:
        return None
    rows = [lever.simulator.states.index(end.state) for end in (first, second)]

    def shares(t: np.ndarray, x: np.ndarray, u: np.ndarray, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        one, two = lever.rates(t, x, u, p)[rows]
        return one, -two

    return Link(f"{first.port} and {second.port}", first, second, 1.0, lever.unit, shares)


def _lever(rows: Sequence[Any], said: float | None) -> float | None:
    """Return the ratio of the travels of two ends, from their influence on both rates; None where none fits."""
    here, there, own, other = rows[0]
    low = float(np.median(-here / own)) if own is not None else 0.0
    high = float(np.median(-other / there)) if other is not None else np.inf
    if said is not None:
        return said
    if low < 0.0 and abs(high / low - 1.0) < SAME:
        return low
    if low * (1.0 - SAME) <= 1.0 <= high * (1.0 + SAME):
        return 1.0
    return low if low > 0.0 and abs(high / low - 1.0) < SAME else None


def _storing(known: Slopes, b: Between, first: LinkEnd, second: LinkEnd) -> Link | None:
    """Return two chambers that exchange, or that a piston separates."""
    simulator, at = known.simulator, known.at
    here, there = known.of(first.state, second.state), known.of(second.state, first.state)
    if here is not None and there is not None:
        weight = here / there
        if not known.constant(weight) and (level := known.where_equal(first.state, second.state)) is not None:
            # What flows, such as radiation, may depend on more than the difference; at none it is as reciprocal.
            weight = level
        if not (np.mean((here > 0.0) & (there > 0.0)) > MOSTLY and known.constant(weight)):
            return None
        masses = _masses(known, first, second)
        one, two, unit = _sized(known, first, float(np.median(weight)), masses)
        scaled = one / factor_of(first.unit), two / factor_of(second.unit)
        return Link(b.name, first, second, 1.0, unit, _following(masses, scaled))
    for piston in simulator.states:
        if piston not in (first.state, second.state) and _parts(known, piston, first.state, second.state):
            break
    else:
        return None
    rows = [simulator.states.index(s) for s in (first.state, second.state, piston)]
    mass, gas = known.mass(piston, first.state), _gas(known, first.state, piston)
    factors = [factor_of(first.unit), factor_of(second.unit)]

    def raw(t: np.ndarray, x: np.ndarray, u: np.ndarray, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        J = slopes(simulator, SomeInstants(t, x, u, at.step), rows, p)
        fills = J[rows[:2], 2]
        if gas:  # what a piston displaces counts by its pressure, so that the slope over it is that of a flow
            moved, far = x.copy(), FAR * at.step
            moved[rows[:2]] += far[rows[:2], None]
            fills = slopes(simulator, SomeInstants(t, moved, u, at.step), rows[2:], p)[rows[:2], 0] - fills
            fills = fills / (far[rows[:2]] * factors)[:, None]
        return -fills[0] / J[rows[2], 0], -fills[1] / J[rows[2], 1]

    nominal = spread_numbers(simulator, len(at.t))
    size = 1.0 if mass is not None else 1.0 / float(np.median(raw(at.t, at.x, at.u, nominal)[0])) * factors[0]

    def make(t: np.ndarray, x: np.ndarray, u: np.ndarray, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        one, two = raw(t, x, u, p)
        moved = size if mass is None else size / mass.of(p)
        return one * moved / factors[0], two * moved / factors[1]

    unit = rate_unit(simulator, first.state)
    if mass is not None:
        unit = "Pa m^3/s" if gas else "m^3/s"
    return Link(b.name, first, second, 1.0, unit, scaled_shares(simulator, make))


def _parts(known: Slopes, piston: str, first: str, second: str) -> bool:
    """Return whether a speed fills one chamber and empties the other, with opposite forces of both."""
    found = [known.of(a, b) for a, b in ((first, piston), (second, piston), (piston, first), (piston, second))]
    if any(f is None for f in found):
        return False
    fills, empties, pushes, holds = (f for f in found if f is not None)
    signs = (fills * pushes < 0.0) & (empties * holds < 0.0) & (pushes * holds < 0.0)
    return bool(np.mean(signs) > MOSTLY)


def _gas(known: Slopes, level: str, piston: str) -> bool:
    """Return whether a piston's influence on a pressure grows with the pressure, at a share of the pressure itself."""
    names, at = known.simulator.states, known.at
    i, k = names.index(level), names.index(piston)
    x = at.x.copy()
    x[i] += FAR * STEP * np.max(np.abs(x[i]))
    there = slopes(known.simulator, at._replace(x=x), [k])[i, 0]
    return bool(np.median(np.abs(there / known.J[i, k] - 1.0)) > 10.0 * SAME)


def _masses(known: Slopes, first: LinkEnd, second: LinkEnd) -> tuple[Mass | None, Mass | None]:
    """Return the parameters that are the masses of two ends, by what each does to the other."""

    def of(own: LinkEnd, other: LinkEnd) -> Mass | None:
        found = (known.mass(own.state, by) for by in dict.fromkeys((other.across, other.state)))
        return next((mass for mass in found if mass is not None), None)

    return of(first, second), of(second, first)


def _following(masses: tuple[Mass | None, Mass | None], at_numbers: tuple[float, float]) -> Shares:
    """Return constant shares of two ends, as the masses of the simulator change them."""

    def shares(t: np.ndarray, x: np.ndarray, u: np.ndarray, p: np.ndarray) -> tuple[Any, Any]:
        one, two = (s if m is None else s * m.value / m.of(p) for s, m in zip(at_numbers, masses, strict=True))
        return one, two

    return shares


def _sized(
    known: Slopes, first: LinkEnd, weight: float, masses: tuple[Mass | None, Mass | None]
) -> tuple[float, float, str]:
    """Return both ends' rates, SI, by one unit of force or flow, the first weighted, and that unit."""
    for mass, share in zip(masses, (1.0, weight), strict=True):
        if mass is not None:
            return share / mass.value, share / mass.value / weight, mass.unit
    one = factor_of(first.unit)
    return one, one / weight, rate_unit(known.simulator, first.state)
