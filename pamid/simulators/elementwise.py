"""Functions of numbers, made functions of arrays: max, min, float, math and matrices go instant by instant."""

from __future__ import annotations

import functools
import math
import operator
from collections.abc import Callable
from types import BuiltinFunctionType, SimpleNamespace
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


def _of_math(made: Callable[[Callable[..., Any]], Callable[..., Any]]) -> dict[int, Any]:
    """Return what takes the place of math and of its functions, by the identity of what it replaces."""
    every = (value for value in vars(math).values() if isinstance(value, BuiltinFunctionType))
    out = {value.__name__: _each(made(value), _AT_ONCE.get(value.__name__)) for value in every}
    by_identity = {id(getattr(math, name)): each for name, each in out.items()}
    return {id(math): SimpleNamespace(**vars(math) | out), **by_identity}


_MATH = {False: _of_math(lambda plain: plain), True: _of_math(_or_nan)}
_BUILT_IN = {
    id(max): _largest(operator.gt, max), id(min): _largest(operator.lt, min), id(float): _Float,
}  # fmt: skip


class _Same:
    """A function known by its identity: an object that is called may have no hash."""

    def __init__(self, function: Callable[..., Any]) -> None:
        self.function = function

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Same) and other.function is self.function

    def __hash__(self) -> int:
        return id(self.function)


def elementwise(function: Callable[..., Any], or_nan: bool = False) -> Callable[..., Any] | None:
    """Return a function that takes arrays where max, min, float, math or numpy's matrices are those of an instant.

    What it uses of its user's modules is taken along. One that sets names outside of it is left alone: None, as where
    it asks for none of these. With `or_nan` functions of math that have no value at some instant are NaN there, unless
    an error is caught.
    """
    return _elementwise(_Same(function), or_nan)


@functools.lru_cache(maxsize=64)
def _elementwise(same: _Same, or_nan: bool) -> Callable[..., Any] | None:
    used = Used(function := same.function)
    if used.keeps_count or (or_nan and any(code.co_exceptiontable for code in used.codes)):
        return None
    instead, of_numpy = _BUILT_IN | _MATH[or_nan], not used.values.keys().isdisjoint(matrices(1))
    if not of_numpy and used.values.keys().isdisjoint(instead):
        return None

    @functools.lru_cache(maxsize=8)
    def made(n: int) -> Callable[..., Any]:
        return used.within({**instead, **(matrices(n) if of_numpy else {})})

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
