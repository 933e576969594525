"""Functions of numbers, made functions of arrays: max, min, float, math and matrices go instant by instant."""

from __future__ import annotations

import builtins
import functools
import math
import operator
from collections.abc import Callable
from types import BuiltinFunctionType, FunctionType, MethodType, SimpleNamespace
from typing import Any

import numpy as np

from .branches import Instants
from .matrices import AtEachInstant, matrices
from .ports import Values
from .rebound import Used


def _largest(better: Callable[[Any, Any], Any], plain: Callable[..., Any]) -> Callable[..., Any]:
    """Return max or min, whichever comparison says, that takes arrays among its arguments."""

    @functools.wraps(plain)
    def of(*given: Any, **options: Any) -> Any:
        some = given if len(given) > 1 else tuple(*given)
        if options or not any(np.ndim(one) for one in some):
            return plain(some, **options)
        best = some[0]
        for one in some[1:]:  # of numbers that are neither, Python keeps the first, too
            best = np.where(better(one, best), one, best)
        return best

    return of


def has_no_value(error: BaseException | None) -> bool:
    """Return whether an error says, in the words of `math`, that a formula has no value at the given numbers."""
    words = isinstance(error, ValueError) and str(error).startswith(("math domain error", "expected a "))
    return words or isinstance(error, ArithmeticError)


def _or_nan(plain: Callable[..., Any]) -> Callable[..., Any]:
    """Return a function of numbers that has the value NaN where it has none."""

    @functools.wraps(plain)
    def of(*numbers: Any) -> Any:
        try:
            return plain(*numbers)
        except (ValueError, ArithmeticError) as error:
            if not has_no_value(error):
                raise
            return np.nan

    return of


def _each(plain: Callable[..., Any], at_once: np.ufunc | None = None) -> Callable[..., Any]:
    """Return a function of numbers that takes arrays among its arguments; at once where all values are finite."""

    @functools.wraps(plain)
    def of(*given: Any, **options: Any) -> Any:
        if options or not any(isinstance(one, np.ndarray) and one.ndim for one in given):
            return plain(*given, **options)
        many = np.broadcast_arrays(*given)
        kind = Instants if any(isinstance(one, Instants) for one in given) else np.ndarray
        if at_once is not None and len(given) == at_once.nin:
            with np.errstate(all="ignore"):
                found = at_once(*many)
            if np.isfinite(found).all():
                return found.view(kind)
        # Of what has no value, or an endless one, math says what it is.
        each = [plain(*numbers) for numbers in zip(*(one.ravel().tolist() for one in many), strict=True)]
        return np.array(each).reshape(many[0].shape).view(kind)

    return of


class _Numbers(type):
    """The type of a type of which plain numbers are instances."""

    def __instancecheck__(cls, value: Any) -> bool:
        return isinstance(value, float)


class _Float(float, metaclass=_Numbers):
    """Conversion to a number, or to as many."""

    def __new__(cls, *given: Any) -> Any:
        """Return the number, or the array of numbers."""
        many = len(given) == 1 and isinstance(given[0], np.ndarray) and given[0].ndim
        return given[0].astype(float) if many else float(*given)


_ALIKE = ["sqrt", "exp", "expm1", "log", "log1p", "log2", "log10", "sin", "cos", "tan", "sinh", "cosh", "tanh"]
_INVERSE = ["sin", "cos", "tan", "sinh", "cosh", "tanh", "tan2"]
_AT_ONCE: dict[str, np.ufunc] = {
    **{name: getattr(np, name) for name in [*_ALIKE, "fabs", "hypot", "copysign"]},
    **{f"a{name}": getattr(np, f"arc{name}") for name in _INVERSE},
}
"""Functions of math that numpy has with the same values."""


def _of_math(made: Callable[[Callable[..., Any]], Callable[..., Any]]) -> dict[Any, Any]:
    """Return what takes the place of math and of its functions."""
    every = (value for value in vars(math).values() if isinstance(value, BuiltinFunctionType))
    out = {value: _each(made(value), _AT_ONCE.get(value.__name__)) for value in every}
    return {math: SimpleNamespace(**vars(math) | {value.__name__: each for value, each in out.items()}), **out}


_MATH = {False: _of_math(lambda plain: plain), True: _of_math(_or_nan)}
_BUILT_IN = {
    "max": _largest(operator.gt, builtins.max), "min": _largest(operator.lt, builtins.min), "float": _Float,
}  # fmt: skip


@functools.lru_cache(maxsize=64)
def elementwise(function: Callable[..., Any], or_nan: bool = False) -> Callable[..., Any] | None:
    """Return a function that takes arrays where max, min, float, math or numpy's matrices are those of an instant.

    What it uses of its module is taken along. One that sets names of its module is left alone: None, as where it asks
    for none of these. With `or_nan` functions of math that have no value at some instant are NaN there, unless an
    error is caught.
    """
    known = FunctionType, MethodType
    asked_for = function if isinstance(function, known) else getattr(function, "__call__", None)  # noqa: B004 - its own
    if not isinstance(asked_for, known) or not isinstance(getattr(asked_for, "__func__", asked_for), FunctionType):
        return None
    used = Used(asked_for)
    if used.keeps_count or (or_nan and any(code.co_exceptiontable for code in used.codes)):
        return None
    found: dict[str, Any] = {name: value for name, value in _BUILT_IN.items() if name not in used.around}
    for name, value in used.around.items():
        if value is math or (isinstance(value, BuiltinFunctionType) and value in _MATH[or_nan]):
            found[name] = _MATH[or_nan][value]
    replaced, asked = set(matrices(1)), used.names
    of_numpy = {name for name in asked & set(used.around) if id(used.around[name]) in replaced}
    if not (of_numpy or asked & set(found)):
        return None

    @functools.lru_cache(maxsize=8)
    def made(n: int) -> Callable[..., Any]:
        instead = matrices(n) if of_numpy else {}
        return used.within({**found, **{name: instead[id(used.around[name])] for name in of_numpy}})

    if not of_numpy:
        return made(0)

    @functools.wraps(function)
    def at_instants(*given: Any) -> Any:
        return made(np.shape(given[-1])[-1])(*map(_at_instants, given))

    return at_instants


def _at_instants(given: Any) -> Any:
    """Return what a function is given, so that it knows which axis is the instants."""
    if isinstance(given, Values):
        return Values.of(given, Values.named(given), AtEachInstant)
    return np.asarray(given).view(AtEachInstant)
