"""Whether the value of an effect's parameter can be one."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import ImplausibleParameterError, SimulatorTypeError

if TYPE_CHECKING:
    from .base import Parameter


def checked_value(effect: str, p: Parameter, value: Any) -> float:
    """Return the value of an effect's parameter, once it is known to be a number within its bounds.

    Parameters
    ----------
    effect : str
        Name of the effect, for the message.
    p : Parameter
        The parameter, with its unit and bounds.
    value : float
        What it is to be, in the parameter's unit.

    Raises
    ------
    SimulatorTypeError
        It is no number.
    ImplausibleParameterError
        It is not finite, or outside the bounds.

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
    if not math.isfinite(number) or not p.lower <= number <= p.upper:
        raise ImplausibleParameterError(
            f"{p.name} of the effect {effect} is {number:g} {p.unit}.",
            f"{p.lower:g} to {p.upper:g} {p.unit} ({p.description})",
            "Correct the value; all units are SI.",
        )
    return number
