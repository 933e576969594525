"""Whether a log is in the units that its simulator expects, by the errors under other units."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from itertools import product
from typing import NamedTuple

import numpy as np
import pandas as pd

from ..bench.parameters import BenchParameters
from ..signals.units import UNITS
from .allowed import allowed_equations, residuals
from .log import BenchLog, columns_of
from .run import MUSCLES

_MOST = 4_000  # rows that are looked at
_OFF = 0.1
"""Share of the signal below which an error is not one of units: the mildest mistake, gauge for absolute pressure, is an
atmosphere in at most ten."""
_TIMES = 3.0
"""How many times smaller each other unit has to make the errors: units that are mistaken for each other are a factor of
4.4 apart and more, and an atmosphere is three times the offset of any sensor that works."""
_FAULT = 5.0
"""Factor that no fault of a sensor or valve reaches, nor a wrong number of a simulator."""
_TOLD_BY: tuple[tuple[str, set[str], set[str]], ...] = (
    ("F", {"force"}, set()), ("u", {"valve"}, {"flow"}), ("u", {"gas_valve"}, set()),
    ("mdot", {"flow", "valve"}, set()), ("mdot", {"flow"}, set()),
)  # fmt: skip
"""Columns that a factor may be missing from, the equations that are then off, and one that has to agree."""
_SMALL = 0.01  # share of the signal below which no simulator is better than another
_SCALES_OF_MEASURED = {"force": "F", "flow": "mdot", "valve": "mdot"}
_SCALES_OF_MODELLED = {"valve": "u", "gas_valve": "u"}


class _Reading(NamedTuple):
    """One way to read a column: SI value = `factor` · value + `offset`."""

    looks: str = ""
    factor: float = 1.0
    offset: float = 0.0

    @property
    def price(self) -> float:
        """What it has to earn, in logarithms of errors."""
        return float(np.log(_TIMES)) if self.looks else 0.0


_AS_IT_IS = _Reading()
_DEGREE = UNITS["deg"].factor
_TURNED = _Reading("a signal of the opposite sign", -1.0)
_READINGS = {
    "q": (_Reading("degrees", _DEGREE), _Reading("rad that were taken for degrees", 1.0 / _DEGREE), _TURNED),
    "F": (*(_Reading(name, UNITS[name].factor) for name in ("kN", "kgf", "lbf", "mN")), _TURNED),
    "mdot": (
        *(_Reading(n, UNITS[n].factor) for n in ("g/s", "mg/s", "kg/h", "g/min", "L/min ANR", "NL/min")),
        _TURNED,
    ),
    "u": (
        *(_Reading(f"volts of a valve for {full:g} V", 1.0 / full) for full in (5.0, 10.0)),
        _Reading("percent", 0.01),
    ),
}
_WIRINGS: tuple[tuple[dict[str, tuple[str, float]], str], ...] = (
    *(({f"{c}1": (f"{c}2", 1.0), f"{c}2": (f"{c}1", 1.0)}, "each other's") for c in ("u", "F", "P", "mdot")),
    *(({f"u{k}": (f"u{k}", -1.0) for k in some}, _TURNED.looks) for some in ((1, 2), (1,), (2,))),
    ({"u1": ("u2", -1.0), "u2": ("u1", -1.0)}, "each other's with the opposite sign"),
)
"""Columns that were mixed up: from which column each is read, and with which sign. What a valve lets through with the
opposite command is no multiple of what it lets through."""
"""How channels are mistaken for others; of the pressures it is the reference."""

Readings = dict[str, _Reading]
"""How columns are read; a column that is not in it is read as it is."""


class _Products(NamedTuple):
    """Sums over the windows of one equation and muscle: squares of both sides, and their product."""

    measured: float
    modelled: float
    both: float

    def error(self, measured: float = 1.0, modelled: float = 1.0) -> float:
        """Return the error as a share of the signal, its sides multiplied by factors."""
        y, x = measured**2 * self.measured, modelled**2 * self.modelled
        left = max(y + x - 2 * measured * modelled * self.both, 0.0)
        return float(np.sqrt(left / max(y, x))) if max(y, x) > 0 and np.isfinite(left) else 1.0


Key = tuple[str, int]
"""Equation and muscle; muscle 0 is both together."""


class _Choice(NamedTuple):
    """Readings of columns, what errors they leave, and what that is worth: the less the better."""

    cost: float
    readings: Readings
    errors: dict[Key, float]

    def and_(self, other: _Choice) -> _Choice:
        """Return two choices about different columns together."""
        return _Choice(self.cost + other.cost, self.readings | other.readings, self.errors | other.errors)


def unit_doubts(
    log: pd.DataFrame | BenchLog, params: BenchParameters, equations: Sequence[str] | None = None
) -> list[str]:
    r"""Say which columns of a log the simulator would explain in another unit, or with another reference or sign.

    The error of an equation :math:`y = \hat y` is taken as a share of its signal,
    :math:`e = \mathrm{rms}(y - \hat y)/\max(\mathrm{rms}(y), \mathrm{rms}(\hat y))`, in the log as it is and with every
    combination of the units that are often mistaken for SI. The combination with the least product of errors counts, if
    each column that it reads in another way reduces that product by a factor of three.

    Parameters
    ----------
    log : DataFrame
        Log of the bench, see `pamid.equations.residuals`.
    params : BenchParameters
        The simulator.
    equations : sequence of str, optional
        Names of the equations to look at; all that the log allows by default.

    Returns
    -------
    list of str
        A sentence for each doubt; empty where the simulator roughly agrees with the log, or no other unit helps.

    Examples
    --------
    >>> from pamid.bench import BenchParameters, simulate, sine
    >>> from pamid.equations import unit_doubts
    >>> bench = BenchParameters.for_muscle("B")
    >>> log = simulate(bench, [sine(4, 15, 400)], seed=0)
    >>> unit_doubts(log, bench)
    []
    >>> unit_doubts(log.assign(F1=log["F1"] / 9.80665), bench)[0][:19]
    'F1 looks like kgf: '
    """
    log = BenchLog.of(log)
    allowed, _ = allowed_equations(log, equations)
    names = [name for name in allowed if name != "joint" or "force" not in allowed]
    part = log.whole(_MOST)
    as_is = _sums(part, params, names)
    before = {key: s.error() for key, s in as_is.items()}
    if max(before.values(), default=0.0) < _OFF:
        return []
    best = min(_choices(part, params, names, as_is), key=lambda choice: choice.cost)
    alike: dict[tuple[str, _Reading], list[str]] = defaultdict(list)
    for column, reading in best.readings.items():
        alike[column.rstrip("12"), reading].append(column)
    found = []
    for (channel, reading), columns in alike.items():
        keys = [key for key in best.errors if channel in allowed[key[0]].channels]
        key = min(keys, key=lambda key: best.errors[key] / max(before[key], 1e-300))
        found.append(
            f"{' and '.join(columns)} {'looks' if len(columns) == 1 else 'look'} like {reading.looks}: "
            f"{'so' if len(alike) == 1 else 'with all of these so'} read, the error of the {key[0]} equation is "
            f"{100 * best.errors[key]:.3g} % of its signal instead of {100 * before[key]:.3g} %. "
            "Correct the mapping of the log, or the simulator."
        )
    return found or [*_of_no_known_unit(as_is)]


def _of_no_known_unit(sums: Mapping[Key, _Products]) -> Iterator[str]:
    """Yield the column of a muscle whose values times one factor make all its equations that are off agree."""
    for muscle in MUSCLES:
        own = {equation: s for (equation, of), s in sums.items() if of == muscle}
        off = {equation for equation, s in own.items() if s.error() >= 1.0 - 1.0 / _FAULT}  # as such a factor leaves
        for channel, equations, beside in _TOLD_BY:
            if off != equations or not beside <= own.keys():
                continue
            modelled = channel == "u"
            wrong = [own[e] for e in off]
            factors = [s.both / max(s.modelled if modelled else s.measured, 1e-300) for s in wrong]
            factor, column = float(np.median(factors)), f"{channel}{muscle}"
            name = max(off, key=lambda e: own[e].error())
            left = max(s.error(*((1.0, factor) if modelled else (factor, 1.0))) for s in wrong)
            if factor > 0.0 and not 1 / _FAULT < factor < _FAULT and max(left, _SMALL) * _TIMES < own[name].error():
                yield (
                    f"{column} may be in another unit, as counts of a converter are: times {factor:.3g}, the error of "
                    f"the {name} equation is {100 * left:.3g} % of its signal instead of {100 * own[name].error():.3g} "
                    f"%. If so: pamid init --signal '{column}=COLUMN*{factor:.3g}'; else correct the simulator."
                )
                break


def _choices(
    part: BenchLog, params: BenchParameters, names: list[str], as_is: Mapping[Key, _Products]
) -> Iterator[_Choice]:
    """Yield the best readings of all columns for each reading of the angle and of the pressures."""
    ambient = params.gas.atmospheric_pressure
    twice = "absolute pressure to which the ambient pressure was added once more"
    references = [_AS_IT_IS]
    if any(name != "joint" for name in names):
        references += [_Reading("gauge pressure", 1.0, ambient), _Reading(twice, 1.0, -ambient)]
    for wiring, looks in _WIRINGS:
        if set(wiring) <= set(part.table.columns):
            rewired = part.read_as({column: sign * part.table[source] for column, (source, sign) in wiring.items()})
            left = {key: s.error() for key, s in _sums(rewired, params, names).items()}
            reading = _Reading(looks)
            yield _Choice(_cost(left) + reading.price, dict.fromkeys(wiring, reading), left)
    for angle in (_AS_IT_IS, *_READINGS["q"]):
        sums = {}
        for reference in references:
            readings = {c: r for c, r in (("q", angle), *((c, reference) for c in columns_of("P"))) if r.looks}
            sums[reference] = _sums(_read(part, readings), params, names) if readings else as_is
        first, second = ([(r, _of_muscle(sums[r], muscle, r)) for r in references] for muscle in MUSCLES)
        for (one, choice), (other, further) in product(first, second):
            together = sums[one] if one == other else as_is  # what mixes both muscles was seen with both alike
            errors = {key: s.error() for key, s in together.items() if key[1] == 0}
            turned = {"q": angle} if angle.looks else {}
            yield _Choice(_cost(errors) + angle.price, turned, errors).and_(choice).and_(further)


def _read(log: BenchLog, readings: Readings) -> BenchLog:
    table = log.table
    return log.read_as({c: r.factor * table[c] + r.offset for c, r in readings.items() if c in table.columns})


def _sums(log: BenchLog, params: BenchParameters, names: list[str]) -> dict[Key, _Products]:
    """Return the sums of equations over the windows of a log."""
    sums: dict[Key, np.ndarray] = defaultdict(lambda: np.zeros(3))
    with np.errstate(all="ignore"):  # a wrong reading may lead far from what the laws are made for
        for _, name, r in residuals(log, params, names, noise=False):
            for k, muscle in enumerate(MUSCLES if r.value.shape[1] == len(MUSCLES) else (0,)):
                measured = r.measured[:, k]
                modelled = measured - r.value[:, k]
                sums[name, muscle] += [measured @ measured, modelled @ modelled, measured @ modelled]
    return {key: _Products(*map(float, s)) for key, s in sums.items()}


def _of_muscle(sums: Mapping[Key, _Products], muscle: int, reference: _Reading) -> _Choice:
    """Return the best readings of a muscle's force, flow and command, its pressure being read in one way."""
    own = {key: s for key, s in sums.items() if key[1] == muscle}
    best = _Choice(reference.price, {f"P{muscle}": reference} if reference.looks else {}, {})
    scales = (_SCALES_OF_MEASURED, _SCALES_OF_MODELLED)
    for equations, channels in ((("force",), ("F",)), (("flow", "valve", "gas_valve"), ("mdot", "u"))):
        here = {key: s for key, s in own.items() if key[0] in equations}
        found = []
        for chosen in product(*((_AS_IT_IS, *_READINGS[channel]) for channel in channels)):
            factors = dict(zip(channels, chosen, strict=True))
            errors = {
                key: s.error(*(factors[of[key[0]]].factor if key[0] in of else 1.0 for of in scales))
                for key, s in here.items()
            }
            readings = {f"{channel}{muscle}": r for channel, r in factors.items() if r.looks}
            found.append(_Choice(_cost(errors) + sum(r.price for r in chosen), readings, errors))
        best = best.and_(min(found, key=lambda choice: choice.cost))
    return best


def _cost(errors: Mapping[Key, float]) -> float:
    return float(sum(np.log(max(error, _SMALL)) for error in errors.values()))
