"""Which columns of a log are the ports of a simulator: one joint assignment, checked against the samples."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..signals.headers import read_header
from ..signals.unit_names import unit_name
from ..signals.units import UNITS
from .base import Simulator
from .likeness import (
    EXACT,
    NAME,
    ORDER,
    Column,
    Names,
    Place,
    columns_of,
    dimension,
    is_named,
    letters,
    places_of,
    role_score,
)
from .motion import follows, is_rate_of, led_by, rate_between
from .ports import Port
from .words import EITHER, FAINT, roles_of, tokens

_LEAST = 1.2
"""Score that a pair needs: more than a role or a unit alone."""
_LEAD = 0.3
"""Least lead over the best unused column for a choice."""
_SLACK = 0.05
"""Share of its range by which a joint may be driven against its stop, or read beyond it."""

_SAME = 0.7
"""Correlation below which a guessed rate does not belong to its position."""
_ROWS = 20_000
"""Rows by which columns are compared all with all."""
_USUAL = {"angle": 2.0 * math.pi, "length": 10.0, "voltage": 1e3, "current": 1e3, "temperature": 3e3}
"""What quantities without a unit and a range seldom exceed in SI: a turn; counts and degrees do."""
_MOVES, _RATES = frozenset(("angle", "length")), frozenset(("angular rate", "speed"))
_FAR = math.log(1.5)
"""Logarithm of the factor up to which a rate is in the nearest unit: the nearest two, deg/s and rpm, are 6 apart."""


@dataclass(frozen=True)
class Match:
    """A column matched to a port."""

    port: str
    column: str
    """Their names."""
    unit: str = ""
    """Unit of the column as `pamid.signals.UNITS` names it; empty where values are used as they are."""
    named: bool = False
    """Whether the column is named like the port: nothing is guessed."""
    why: str = ""
    """Reason for a guessed column or unit."""


def matches(
    simulator: Simulator, ports: Sequence[Port], frame: Mapping[str, np.ndarray], t: np.ndarray,
    given: Mapping[str, tuple[str, str]] | None = None,
) -> tuple[list[Match], dict[str, str]]:  # fmt: skip
    """Return the columns that ports probably are."""
    search = _Matcher(simulator, ports, frame, t, given or {})
    pairs = search.assigned(search.assigned({}))
    while more := search.in_order(pairs):  # what is matched may leave one choice for others
        pairs |= more
    return search.told(pairs)


class _Matcher:
    """Ports, columns, and knowledge about both."""

    def __init__(
        self, simulator: Simulator, ports: Sequence[Port], frame: Mapping[str, np.ndarray], t: np.ndarray,
        given: Mapping[str, tuple[str, str]],
    ) -> None:  # fmt: skip
        self.given = given
        self.ranges, self.driven = simulator.ranges(), simulator.driven()
        self.places, telling = places_of(ports, set(self.driven))
        self.columns = columns_of(list(frame), telling)
        if simulator.form == "run":  # whose states are where it begins: hardly a log has a column for that
            named = [any(is_named(place, c) for c in self.columns) for place in self.places]
            self.places = [p for p, its in zip(self.places, named, strict=True) if its or p.port.kind != "state"]
        self.frame, self.t = frame, t
        self.left_over: set[str] = set()
        self.columns = self._by_motion()
        self.names = Names(self.places, self.columns)
        joints = [p for p in simulator.ports if p.kind == "joint"]
        self.place_under = {p.velocity: p.position for p in joints if p.velocity}
        self.supposed_under = {} if joints else _only_pair(self.places)
        position_of = {p.name: p.position for p in joints if p.position}
        self.moved_by = {p.through: p.position for p in joints if p.through and p.position}
        self.moved_by |= {drive: position_of[joint] for drive, joint in self.driven.items() if joint in position_of}
        ranks = [self._ranks(column) for column in self.columns]
        self.base = np.array(
            [[self._score(p, c, r) for c, r in zip(self.columns, ranks, strict=True)] for p in self.places]
        ).reshape(len(self.places), len(self.columns))

    def _by_motion(self) -> list[Column]:
        """Return the columns, those with ambiguous names or none identified by their samples."""
        t, frame = self.t[:_ROWS], {name: x[:_ROWS] for name, x in self.frame.items()}
        rates = is_rate_of(t, frame)
        under = set(rates.values())
        open_ = {c.name for c in self.columns if not c.dimensions or (set(tokens(c.name)) & EITHER and not c.certain)}
        moving = [c for c in self.columns if c.dimensions & _MOVES or (c.name in open_ and c.name not in rates)]
        leads = led_by({c.name: frame[c.name] for c in moving})
        said: dict[str, tuple[frozenset[str], bool]] = {}
        for c in self.columns:
            dims = c.dimensions
            if c.name in open_:
                told = c.name in under or leads.get(c.name) in under or c.name in leads.values()
                dims = _RATES if c.name in rates else _MOVES if told else dims
            said[c.name] = (dims, c.name in leads and not (c.commanded or c.measured or c.name in rates))
        found = []
        for c in self.columns:  # of a series all or none
            family = [said[o.name] for o in self.columns if o.series == c.series != ""] or [said[c.name]]
            dims, ahead = Counter(d for d, _ in family).most_common(1)[0][0], sum(a for _, a in family)
            wanted = c.name in open_ and bool(c.dimensions) and dims == _MOVES
            faint = dims == _RATES and roles_of(w for w in tokens(c.name) if w not in FAINT) != roles_of(tokens(c.name))
            found.append(replace(
                c, dimensions=dims if c.name in open_ else c.dimensions, leads=2 * ahead > len(family),
                commanded=(c.commanded or wanted) and not faint,
            ))  # fmt: skip
        return found

    # --- scores ---------------------------------------------------------------------------------------------
    def _ranks(self, column: Column) -> dict[str, bool]:
        """Return for each port of a numbered series whether its position matches the column's; empty for others."""
        if not column.series:
            return {}
        series = sorted({c.number for c in self.columns if c.series == column.series})
        if len(series) < 2:
            return {}
        nearest = max((role_score(p, column) for p in self.places), default=-math.inf)
        alike = [p.port.name for p in self.places if role_score(p, column) == nearest > -math.inf]
        if len(alike) != len(series):
            return {}
        return {name: k == series.index(column.number) for k, name in enumerate(alike)}

    def _score(self, place: Place, column: Column, ranks: Mapping[str, bool]) -> float:
        taken = {name for name, _ in self.given.values()}
        if place.port.name in self.given or column.name in taken:
            return 2.0 * EXACT if self.given.get(place.port.name, ("",))[0] == column.name else -math.inf
        if is_named(place, column):
            if self._clashes(place, column):
                return -math.inf
            return EXACT + (0.5 if column.name == place.port.name else 0.0)
        score = role_score(place, column)
        if score == -math.inf:
            return score
        likeness = self.names.score(place, column)
        if place.port.name in ranks:  # a joint's bare name is its position's as it is its rate's
            return score + (max(ORDER, NAME * likeness) if ranks[place.port.name] else -ORDER)
        return score + NAME * likeness if likeness > 0.2 else min(score, _LEAST - 0.01)

    def _clashes(self, place: Place, column: Column) -> bool:
        """Return whether a column named like a port has the unit of another quantity."""
        other = column.certain and place.dimension and column.dimension != place.dimension
        apart = read_header(column.name).bracketed or letters(column.name) != letters(place.port.name)
        return bool(other) and apart and is_named(place, column)

    def _moved(self, pairs: Mapping[str, str]) -> np.ndarray:
        """Return the score of each pair by the samples, given the known pairs."""
        out = np.zeros_like(self.base)
        over = {position: velocity for velocity, position in self.place_under.items()}
        for k, place in enumerate(self.places):
            name = place.port.name
            position, velocity = pairs.get(self.place_under.get(name, "")), pairs.get(over.get(name, ""))
            actual = pairs.get(self.moved_by.get(name, ""))
            for j, column in enumerate(self.columns):
                if position and position != column.name:
                    out[k, j] += _sign(self._rate(position, column.name)[0])
                if velocity and velocity != column.name:
                    out[k, j] += _sign(self._rate(column.name, velocity)[0])
                if actual and actual != column.name and place.dimensions & _MOVES:
                    r = follows(self.frame[column.name], self.frame[actual])
                    out[k, j] += 0.0 if math.isnan(r) else r if r > 0.0 else 2.0 * r
        return out

    def _rate(self, position: str, velocity: str) -> tuple[float, float]:
        return rate_between(self.t, self.frame[position], self.frame[velocity])

    # --- assignment -----------------------------------------------------------------------------------------
    def assigned(self, known: Mapping[str, str]) -> dict[str, str]:
        """Return the pairs with the highest total score, given the known pairs."""
        from scipy.optimize import linear_sum_assignment

        if not self.base.size:
            return {}
        score = self.base + self._moved(known) if known else self.base
        usable = np.where(np.isfinite(score) & (score >= _LEAST), score, 0.0)
        rows, cols = linear_sum_assignment(-usable)
        pairs = {int(r): int(c) for r, c in zip(rows, cols, strict=True) if usable[r, c] > 0.0}
        left = sorted(set(range(len(self.columns))) - set(pairs.values()))
        open_ = sorted(set(range(len(self.places))) - set(pairs))
        self.rivals: dict[str, str] = {}
        for r, c in list(pairs.items()):
            if usable[r, c] >= EXACT:
                continue
            names = [self.places[k].port.name for k in [r, *open_] if usable[k, c] > usable[r, c] - _LEAD]
            near = [j for j in left if usable[r, j] > usable[r, c] - _LEAD]
            if near:
                self.rivals[names[0]] = f"it may be {self.columns[c].name} or {self.columns[near[0]].name}"
            elif len(names) > 1:
                self.rivals |= dict.fromkeys(names, f"{self.columns[c].name} may be {' or '.join(names)}")
            if near or len(names) > 1:
                del pairs[r]
        return {self.places[r].port.name: self.columns[c].name for r, c in pairs.items()}

    def in_order(self, pairs: Mapping[str, str]) -> dict[str, str]:
        """Match the unmatched of a kind in order, where both sides have equal numbers."""
        found: dict[str, str] = {}
        free = [c for c in self.columns if c.name not in pairs.values()]
        left = [p for p in self.places if p.port.name not in pairs and p.port.name not in self.rivals and p.dimensions]
        for kind in dict.fromkeys((p.commanded, p.dimensions) for p in sorted(left, key=lambda p: p.commanded)):
            ports = [p for p in left if (p.commanded, p.dimensions) == kind]
            columns = [c for c in free if c.name not in found.values() and self._may_be(ports[0], c)]
            said = [c for c in columns if c.commanded] if kind[0] else []
            said = said or [c for c in columns if (c.dimensions or c.symbols | {c.dimension}) & kind[1]]
            unsaid = not kind[0] and any(
                (True, kind[1]) == (p.commanded, p.dimensions) and p.port.start is None for p in left
            )
            if len(ports) == len(said) and not (unsaid and not any(c.measured for c in said)):
                found |= {p.port.name: c.name for p, c in zip(ports, said, strict=True)}
        open_ = [p for p in self.places if p.commanded and p.port.name not in {**pairs, **found, **self.rivals}]
        rest = [c for c in free if c.name not in found.values()]
        if len(open_) == 1 == len(rest) and role_score(open_[0], rest[0]) > -math.inf:
            found[open_[0].port.name] = rest[0].name
        found = found or self._by_unit(pairs)
        self.left_over |= set(found)
        return found

    def _by_unit(self, pairs: Mapping[str, str]) -> dict[str, str]:
        """Match the only port left over of a dimension with the only column whose last letter is a unit of it."""
        known = {**pairs, **self.rivals}
        places = [p for p in self.places if p.port.name not in known and p.dimension and p.port.start is None]
        free = [c for c in self.columns if c.name not in pairs.values() and c.unit[:1].isupper()]  # an m may be a motor
        found = {}
        for dim in dict.fromkeys(p.dimension for p in places):
            ports = [p for p in places if p.dimension == dim]
            said = [replace(c, dimensions=frozenset((dim,))) for c in free if c.dimension == dim]
            if len(ports) == 1 == len(said) and role_score(ports[0], said[0]) > -math.inf:
                found[ports[0].port.name] = said[0].name
        return found

    def _may_be(self, place: Place, column: Column) -> bool:
        """Return whether nothing forbids a pair; what acted may be measured where no output is of its quantity."""
        if role_score(place, column) > -math.inf:
            return True
        alone = not any(p.dimensions & place.dimensions for p in self.places if not p.commanded)
        return (
            alone and place.commanded and column.measured and role_score(place, replace(column, measured=False)) > 0.0
        )

    # --- units ----------------------------------------------------------------------------------------------
    def told(self, pairs: Mapping[str, str]) -> tuple[list[Match], dict[str, str]]:
        """Return the pairs with units, and doubts."""
        by_port = {p.port.name: p for p in self.places}
        by_column = {c.name: c for c in self.columns}
        doubts = dict(self.rivals)
        for place in self.places:
            if clash := [c for c in self.columns if place.port.name not in pairs and self._clashes(place, c)]:
                doubts[place.port.name] = f"{clash[0].name} is in {clash[0].unit}, the port in {place.port.unit}"
        degrees = self._in_degrees(pairs, by_port, by_column)
        found: list[Match] = []
        rates = {**self.place_under, **self.supposed_under}
        for port, name in sorted(pairs.items(), key=lambda pair: pair[0] in rates or by_port[pair[0]].commanded):
            # positions first
            place, column = by_port[port], by_column[name]
            match = Match(port, name, named=is_named(place, column))
            if port in self.given:
                found.append(replace(match, unit=self.given[port][1] or _own(place)))
                continue
            if (one := self._with_unit(match, place, column, degrees, {m.port: m for m in found}, doubts)) is not None:
                found.append(one)
        order = list(by_port)
        new = [m for m in found if m.port not in self.given]
        return sorted(new, key=lambda m: order.index(m.port)), doubts

    def _in_a_list(self, name: str) -> bool:
        """Return whether a column is an element of a list whose elements have names, such as a joint's."""
        stem = name.partition("[")[0]
        return name != stem and sum(c.name.startswith(f"{stem}[") for c in self.columns) > 1

    def _with_unit(
        self, match: Match, place: Place, column: Column, degrees: Mapping[str, str], known: Mapping[str, Match],
        doubts: dict[str, str],
    ) -> Match | None:  # fmt: skip
        header = read_header(column.name)
        own = not header.bracketed and letters(column.name) == letters(place.port.name)  # the port's name ends so, too
        stated = column.unit if column.dimension == place.dimension and not own else ""
        under = known.get(self.place_under.get(place.port.name, ""))
        below = known.get(self.supposed_under.get(place.port.name, ""))
        if below is not None and not stated:  # only the samples show that one is the other's derivative, no joint does
            unit, why = self._unit_of_rate(below, column, place, "")
            if unit is not None and self._rate(below.column, column.name)[0] > 0.9:
                return replace(match, unit=unit, why="" if match.named and unit == _own(place) else why)
        if under is not None and place.dimension in ("angular rate", "speed"):
            unit, why = self._unit_of_rate(under, column, place, stated)
            if unit is None and not match.named and self._rate(under.column, column.name)[0] < _SAME:
                return None
            if unit is None:
                doubts[match.port] = why
                return replace(match, unit=stated or _own(place), named=bool(match.named and stated), why=why)
            if unit != stated and stated:
                doubts[match.port] = why
            return replace(match, unit=stated or unit, why="" if match.named and unit == _own(place) else why)
        driven = known.get(self.moved_by.get(match.port, ""))
        if driven is not None and {place.dimension} <= _RATES and not stated:
            unit, _ = self._unit_of_rate(driven, column, place, "")
            if unit is not None:
                why = f"its name; in {unit}, since {driven.column} follows it in this unit"
                return replace(match, unit=unit, why="" if match.named and unit == _own(place) else why)
        basis = "assigned in order from the columns left over" if match.port in self.left_over else "its name"
        if stated:
            return replace(match, unit=stated, why="" if match.named else f"{basis}; in {stated}, as its header says")
        if match.port in degrees:
            return replace(match, unit="deg", why=degrees[match.port])
        unread = header.unread if place.port.unit not in ("-", header.unread) else ""
        if unread and not self._in_a_list(column.name):
            doubts[match.port] = f"{unread} is not a known unit: say which it is"
        beyond = self._beyond(match.port, column, 1.0) if place.dimension else ""
        if beyond:
            doubts[match.port] = f"{beyond}: say its unit"
            return replace(match, unit=_own(place), why=beyond)
        if place.dimension and match.port not in self.ranges and (far := self._far(column, place)):
            return replace(match, unit=_own(place), why=far)
        if own and column.unit and column.dimension == place.dimension and column.unit != _own(place):
            return replace(match, unit=_own(place), why=f"in {place.port.unit}, though its name may say {column.unit}")
        what = f", read in {place.port.unit}" if place.dimension else ""
        return replace(match, unit=_own(place) if column.unit else "", why="" if match.named else f"{basis}{what}")

    def _in_degrees(
        self, pairs: Mapping[str, str], places: Mapping[str, Place], columns: Mapping[str, Column]
    ) -> dict[str, str]:
        """Return why the angles without a unit are degrees: a log has one unit for all; empty where they are not."""
        angles = {
            p: c
            for p, c in pairs.items()
            if places[p].dimension == "angle" and columns[c].dimension != "angle" and p not in self.given
        }
        beyond = {p: text for p, c in angles.items() if (text := self._beyond(p, columns[c], 1.0))} or {
            p: f"{c} exceeds one turn"  # a servo is seldom told to
            for p, c in angles.items()
            if places[p].commanded and p not in self.ranges and self._far(columns[c], places[p])
        }
        still = [p for p, c in angles.items() if self._beyond(p, columns[c], UNITS["deg"].factor)]
        if not beyond or len(still) >= len(beyond):
            return {}
        like = f"degrees, like {angles[next(iter(beyond))]}"
        return {p: f"degrees, since {beyond[p]}" if p in beyond else like for p in angles}

    def _beyond(self, port: str, column: Column, factor: float) -> str:
        """Return how a column leaves the range of a port; empty where it does not or the range is unknown."""
        if port not in self.ranges:
            return ""
        low, high = self.ranges[port]
        x = self.frame[column.name]
        x = factor * x[np.isfinite(x)]
        slack = _SLACK * (high - low)
        if not len(x) or (x.min() >= low - slack and x.max() <= high + slack):
            return ""
        return f"{column.name} goes from {x.min():.4g} to {x.max():.4g}, {port} only from {low:.4g} to {high:.4g}"

    def _far(self, column: Column, place: Place) -> str:
        """Return that a column without a unit is larger than such quantities usually are; empty where it is not."""
        x = self.frame[column.name]
        most = float(np.max(np.abs(x[np.isfinite(x)]), initial=0.0))
        usual = _USUAL.get(place.dimension, math.inf)
        return f"read in {place.port.unit}, though it reaches {most:.3g}: say its unit" if most > usual else ""

    def _unit_of_rate(self, under: Match, column: Column, place: Place, stated: str) -> tuple[str | None, str]:
        """Return the unit under which a rate is the derivative of its position, or None, and the finding."""
        r, slope = self._rate(under.column, column.name)
        if math.isnan(r):
            return stated or _own(place), f"its name, read in {stated or place.port.unit}"
        position = UNITS[under.unit].factor if under.unit in UNITS else 1.0
        factor = position * slope
        if r < _SAME:
            return None, f"{column.name} is not the derivative of {under.column} (correlation {r:.2g})"
        units = [u for u, unit in UNITS.items() if unit.dimension == place.dimension and unit.factor > 0.0]
        near = min(
            units, key=lambda u: (round(abs(math.log(UNITS[u].factor / factor)), 2), u != stated, u != _own(place))
        )
        off = abs(math.log(UNITS[near].factor / factor))
        if off > _FAR:
            return None, f"{column.name} is {1.0 / factor:.3g} times the derivative of {under.column}"
        times = f"{UNITS[near].factor / factor:.3g} times " if off > _SLACK else ""
        text = f"{times}the derivative of {under.column} in {near}"
        return near, f"{text}, though its name says {stated}" if stated and UNITS[near].factor != UNITS[
            stated
        ].factor else text


def _only_pair(places: Sequence[Place]) -> dict[str, str]:
    """Return the only rate of a simulator with its only position, where there is one of each."""
    found = {}
    for position, rate in (("angle", "angular rate"), ("length", "speed")):
        below = [p.port.name for p in places if p.dimension == position and not p.commanded]
        above = [p.port.name for p in places if p.dimension == rate and not p.commanded]
        if len(below) == 1 == len(above):
            found[above[0]] = below[0]
    return found


def _own(place: Place) -> str:
    """Return the unit of a port as `pamid.signals.UNITS` names it; empty where it is unknown."""
    return (unit_name(place.port.unit) or "") if dimension(place.port.unit) else ""


def _sign(r: float) -> float:
    """Return the score of a rate's correlation with the change of a position."""
    return 0.0 if math.isnan(r) else 2.0 * r if r > 0.0 else 0.0 if r > -0.5 else r
