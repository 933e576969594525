"""A parameter of an effect, and whether a value is valid for it."""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..errors import ImplausibleParameterError, SimulatorTypeError
from ..explained import explained_by

_ABOVE_0 = sys.float_info.min
MOST_PERIODS = 40
"""Most periods of an effect of the position within the range that a log covers, and within a turn."""

SLOW = 0.1
"""Speeds as a share of the largest one at which dry friction is still told from viscous friction."""


@dataclass(frozen=True)
class Parameter:
    """One parameter of an effect.

    Parameters
    ----------
    name : str
        Its name, a Python identifier.
    unit : str
        Its unit, ``"-"`` for a plain number.
    lower, upper : float
        Physical bounds.
    nominal : float
        A typical value.
    description : str
        What it is, in a few words.
    linear : bool, default=False
        Whether the contribution is proportional to it while the other linear parameters are 0; the memory of a path
        does not depend on it.
    essential : bool, default=False
        Whether the effect turns into another one where this parameter reaches a bound, or next to its other linear
        parameters vanishes; a fit that ends there is evidence for that other one.
    unlike : str, default=""
        Another parameter that this one differs from: where all such pairs of an effect are alike it has turned into a
        simpler one.
    simplest : bool, default=False
        Whether the effect has turned into a simpler one where this parameter is at its lower bound: what relaxes at
        once is friction.
    before : bool, default=False
        Whether it says how much of what was before a logged run is unknown: 0 for nothing, 1 for all.
    position : int, default=0
        Power of the position's unit in its own one: ``unit`` is that for a contraction ratio, which has none. A
        coefficient of a velocity has -1, since N s becomes N s/m for a stroke in m; a displacement has 1.
    idle : bool, default=False
        Whether it is a limit: at the upper bound, or beyond what a signal reaches, the effect does nothing.
    idle_below : bool, default=False
        Whether it is a limit that does nothing at the lower bound.
    periods : bool, default=False
        Whether it is 2π over a period of the position: the range of a log decides which can be distinguished.
    spacing : float, default=0
        Least difference of values that a log distinguishes, in ``unit``; 0 where nothing is known.
    each_turn : float, default=0
        Rate, in ``unit``, of one period in a turn, of whose multiples fast ones are; 0 where nothing turns round.
    refines : bool, default=False
        Whether the effect is in its simplest form at 0, where fits begin: what a small share of the upper bound changes
        tells them whether to go on.
    factor : bool, default=False
        Whether 1 plus it multiplies a positive number, which may be wrong by orders of magnitude: steps and intervals
        are those of the logarithm of that factor.
    points : int, default=0
        Points of the grid on which its effect is sought; 0 for as many as it is otherwise divided into.
    neutral : bool, default=False
        Whether it counts from the neutral contraction of a muscle, which other systems do not have.
    symbol : str, default=""
        Its symbol in the equation of the effect.

    Examples
    --------
    >>> from pamid.effects import Parameter
    >>> p = Parameter("stiffness", "N", 0.0, 1e5, 150.0, "force per contraction", linear=True)
    >>> f"{p.name} = {p.nominal:g} {p.unit}, {p.lower:g} to {p.upper:g}"
    'stiffness = 150 N, 0 to 100000'
    """

    name: str
    unit: str
    lower: float
    upper: float
    nominal: float
    description: str
    linear: bool = False
    essential: bool = False
    unlike: str = ""
    simplest: bool = False
    before: bool = False
    position: int = 0
    idle: bool = False
    idle_below: bool = False
    periods: bool = False
    spacing: float = 0.0
    each_turn: float = 0.0
    refines: bool = False
    factor: bool = False
    points: int = 0
    neutral: bool = False
    symbol: str = ""

    def over(self, span: float, speed: float = 0.0, turn: float = 0.0) -> Parameter:
        """Return it within the range that a position over ``span`` resolves: one period of it, to `MOST_PERIODS`.

        Half a period more in the range leaves a quarter of one out of step at either end: a sine between two such
        rates still goes with either. Magnets, teeth and slots of what turns round are as many in each ``turn``. What
        refines a law at low speeds is at most `SLOW` of the largest ``speed``.
        """
        if self.refines and speed > 0.0:
            return replace(self, upper=SLOW * speed)
        if not self.periods or not span > 0.0:
            return self
        once = 2.0 * math.pi / span
        lower, upper = once, MOST_PERIODS * once  # its own bounds count in radians, a position in its unit
        each = 2.0 * math.pi / turn if 0.0 < turn < span else 0.0
        upper = max(upper, MOST_PERIODS * each)
        return replace(
            self, lower=lower, upper=upper, nominal=math.sqrt(lower * upper), spacing=0.5 * once, each_turn=each
        )

    def resolved(self) -> list[float]:
        """Return the rates that a range distinguishes, and beyond its most periods those with whole periods a turn."""
        end = min(self.upper, 2 * MOST_PERIODS * self.spacing) if self.each_turn else self.upper
        fine = np.arange(self.lower, end, self.spacing)
        whole = self.each_turn * np.arange(1, MOST_PERIODS + 1)
        return [*fine.tolist(), *whole[whole >= end].tolist()]

    def of_any_size(self) -> Parameter:
        """Return it with bounds that hold in every system: its sign, and that a positive one is not 0."""
        low = -math.inf if self.lower < 0.0 else _ABOVE_0 if self.lower > 0.0 else 0.0
        return replace(self, lower=low, upper=math.inf)

    def size(self, value: float) -> float:
        """Return how far a value is from no effect, as errors of it are counted."""
        return (1.0 + value) * math.log1p(value) if self.factor else value

    def interval(self, value: float, half: float) -> tuple[float, float]:
        """Return an interval about a value within its bounds, about as wide as twice half."""
        low, high = value - half, value + half
        if self.factor:
            low, high = (np.expm1(np.log1p(value) + d / (1.0 + value)) for d in (-half, min(half, 1e2 * (1.0 + value))))
        return max(self.lower, float(low)), min(self.upper, float(high))

    @property
    def range_words(self) -> str:
        """Its bounds in words, without the unit."""
        if self.lower == _ABOVE_0:
            return "more than 0"
        if math.isinf(self.upper):
            return "any number" if math.isinf(self.lower) else f"at least {self.lower:g}"
        return f"{self.lower:g} to {self.upper:g}"

    @property
    def share(self) -> bool:
        """Whether it is a share from 0 to 1 between two forms of one effect."""
        return (self.unit, self.lower, self.upper) == ("-", 0.0, 1.0)

    @property
    def skew(self) -> bool:
        """Whether it is the difference of an effect between two directions, 0 for none."""
        return (self.unit, self.nominal) == ("-", 0.0) and self.lower == -self.upper and not self.linear


@explained_by(Parameter)
def parameter(unit: str, lower: float, upper: float, nominal: float, description: str, **properties: Any) -> Any:
    """Return a parameter as an attribute of the class of its effect, from which it takes its name.

    Parameters
    ----------
    **properties : bool or float or str
        Further properties of a `Parameter`, such as ``linear=True``.

    Returns
    -------
    Parameter
        The parameter, for a type checker a value of it: that is what instances have.

    Examples
    --------
    >>> from pamid.effects import Effect, parameter
    >>> class Pin(Effect):
    ...     friction = parameter("N m", 0.0, 10.0, 0.1, "torque of the bearing", linear=True)
    >>> Pin.parameters[0].name, Pin(friction=0.2).friction
    ('friction', 0.2)
    """
    return Parameter("", unit, lower, upper, nominal, description, **properties)


def checked_value(effect: str, p: Parameter, value: Any, units: str = "all units are SI") -> float:
    """Return the value of an effect's parameter; raise unless it is a finite number within its bounds.

    Examples
    --------
    >>> from pamid.effects import Parameter
    >>> from pamid.effects.values import checked_value
    >>> checked_value("leakage", Parameter("conductance", "m^3/(s Pa)", 0.0, 1e-6, 1e-10, "of the leak"), 2e-10)
    2e-10
    """
    if isinstance(value, bool) or not isinstance(value, (int, float, np.integer, np.floating)):
        raise SimulatorTypeError(
            f"{p.name} of the effect {effect} is {value!r}.", f"a number in {p.unit}", "Write a plain number."
        )
    number = float(value)
    if math.isfinite(number) and (inside := min(max(number, p.lower), p.upper)) != number:
        # A search in logarithms ends beside a bound by what is rounded.
        number = inside if abs(inside - number) <= 1e-12 * abs(number) else number
    unit = "" if p.unit == "-" else f" {p.unit}"
    if not math.isfinite(number * number) or not p.lower <= number <= p.upper:
        raise ImplausibleParameterError(
            f"{p.name} of the effect {effect} is {number:g}{unit}.",
            f"{p.range_words}{unit} ({p.description})",
            f"Correct the value; {units}.",
        )
    return number
