r"""Formulas as data: what a law or an effect computes from its signals, recorded once, written in any language.

A law's `coefficients` and an effect's hooks are plain arithmetic on arrays. Called with a `Symbol` in place of each
array they leave the graph of their formula, which `pamid.export` writes as C or as ONNX nodes; a law or effect that
somebody adds is exported without another line, as long as it calculates with the operations below.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable
from functools import partial, reduce
from typing import Any

import numpy as np

from ..errors import ExportError

_OPERATIONS: dict[str, tuple[Callable[..., Any] | None, Any]] = {
    "add": (operator.add, np.add),
    "sub": (operator.sub, np.subtract),
    "mul": (operator.mul, np.multiply),
    "div": (operator.truediv, np.true_divide),
    "neg": (operator.neg, np.negative),
    "abs": (abs, np.absolute),
    "exp": (math.exp, np.exp),
    "log": (math.log, np.log),
    "tanh": (math.tanh, np.tanh),
    "sin": (math.sin, np.sin),
    "sqrt": (math.sqrt, np.sqrt),
    "pow": (operator.pow, np.power),
    "min": (min, np.minimum),
    "max": (max, np.maximum),
    "gt": (None, np.greater),
    "ge": (None, np.greater_equal),
    "lt": (None, np.less),
    "le": (None, np.less_equal),
    "and": (None, np.logical_and),
}
"""Each operation on numbers, where constants are folded, and as numpy calls it."""
_UFUNCS = {ufunc: op for op, (_, ufunc) in _OPERATIONS.items()} | {np.bitwise_and: "and"}


class Symbol(np.lib.mixins.NDArrayOperatorsMixin):
    """A value that is not known yet: a signal, or an expression of signals; operators are those of numpy."""

    __slots__ = ("args", "op")
    __array_priority__ = 100.0

    def __init__(self, op: str, args: tuple[Any, ...]) -> None:
        self.op = op
        self.args = args

    def __array_ufunc__(self, ufunc: Any, method: str, *inputs: Any, **kwargs: Any) -> Any:
        if any(isinstance(v, np.ndarray) and v.ndim for v in inputs):
            return _each(lambda *values: by_ufunc(ufunc, method, values), inputs)
        if not all(isinstance(v, Symbol) for v in kwargs.get("out") or ()):
            raise _unknown(ufunc)
        return by_ufunc(ufunc, method, inputs)

    def __array_function__(self, func: Any, types: Any, args: Any, kwargs: Any) -> Any:
        if func is np.ndim or func is np.shape:
            return 0 if func is np.ndim else ()
        if func is np.stack:
            return Symbols.of(args[0])
        if func is np.where:
            return node("where", *args)
        if func is np.clip:
            return node("min", node("max", args[0], args[1]), args[2])
        if func is np.real:
            return args[0]
        if func is np.interp and not kwargs and len(args) == 3:
            return _interpolated(*args)
        raise ExportError(f"The formula uses numpy.{func.__name__}.", _KNOWN, "Write the formula with these.")

    def __bool__(self) -> bool:
        raise ExportError(
            "The formula decides by the value of a signal.", _KNOWN, "Write the decision with numpy.where."
        )

    def __float__(self) -> float:
        raise ExportError(
            "The formula asks for the number of a signal, as functions of the module math do.", _KNOWN,
            "Use numpy's functions, such as numpy.cos for math.cos.",
        )  # fmt: skip

    __eq__, __ne__, __hash__ = object.__eq__, object.__ne__, object.__hash__

    def __pow__(self, power: Any) -> Symbol:
        if isinstance(power, int) and 0 <= power <= 16:
            return _whole_power(self, power)
        return node("sqrt", self) if power == 0.5 else node("pow", self, power)


class Symbols(np.ndarray):
    """An array of symbols, such as the states of an effect; numpy's operations are recorded elementwise."""

    __array_priority__ = 200.0

    @classmethod
    def of(cls, values: Any) -> Symbols:
        """Return symbols, numbers, or arrays of them, along a first axis."""
        return np.stack([_plain(v) for v in values]).view(cls)

    def __array_ufunc__(self, ufunc: Any, method: str, *inputs: Any, **kwargs: Any) -> Any:
        if method == "reduce" and kwargs.get("axis", 0) in (0, (0,)):
            return reduce(ufunc, list(inputs[0]))
        return _each(lambda *values: by_ufunc(ufunc, method, values), inputs)


def _plain(value: Any) -> np.ndarray:
    return np.asarray(value, dtype=object).view(np.ndarray)


def _each(operation: Callable[..., Any], operands: tuple[Any, ...]) -> Any:
    arrays = np.broadcast_arrays(*map(_plain, operands))
    out = np.empty(arrays[0].shape, dtype=object)
    for place in np.ndindex(out.shape):
        out[place] = operation(*(a[place] for a in arrays))
    return out.view(Symbols) if out.ndim else out[()]


def by_ufunc(ufunc: Any, method: str, inputs: tuple[Any, ...]) -> Symbol:
    """Apply an elementwise function of numpy to symbols and numbers."""
    if method == "__call__" and ufunc.__name__ in _MADE:
        return _MADE[ufunc.__name__](*map(as_symbol, inputs))
    if method != "__call__" or ufunc not in _UFUNCS:
        raise _unknown(ufunc)
    return node(_UFUNCS[ufunc], *inputs)


def _unknown(ufunc: Any) -> ExportError:
    return ExportError(f"The formula uses numpy.{ufunc.__name__}.", _KNOWN, "Write the formula with these.")


def _log1p(x: Symbol) -> Symbol:
    """Return log(1 + x) with the rounding of 1 + x compensated, which keeps its digits near 0."""
    whole = 1.0 + x
    rest = whole - 1.0
    safe = node("where", abs(rest) > 0.0, rest, 1.0)
    return node("where", abs(rest) > 0.0, node("log", whole) * (x / safe), x)


_MADE: dict[str, Callable[..., Symbol]] = {
    "clip": lambda x, low, high: node("min", node("max", x, low), high),
    "square": lambda x: x * x,
    "sign": lambda x: node("where", x > 0.0, 1.0, node("where", x < 0.0, -1.0, 0.0)),
    "expm1": lambda x: node("tanh", 0.5 * x) * (node("exp", x) + 1.0),  # keeps its digits near 0
    "log1p": _log1p,
    "copysign": lambda size, of: node("where", of < 0.0, -abs(size), abs(size)),
    "positive": lambda x: x,
    "cos": lambda x: node("sin", x + 0.5 * math.pi),
    "tan": lambda x: node("sin", x) / node("sin", x + 0.5 * math.pi),
    "sinh": lambda x: 0.5 * (node("exp", x) - node("exp", -x)),
    "cosh": lambda x: 0.5 * (node("exp", x) + node("exp", -x)),
    "hypot": lambda x, y: node("sqrt", x * x + y * y),
}


def _whole_power(base: Symbol, power: int) -> Symbol:
    """Multiply a symbol with itself, by squares."""
    if power < 2:
        return base if power else as_symbol(1.0)
    half = _whole_power(base, power // 2)
    return half * half * base if power % 2 else half * half


def _interpolated(x: Symbol, knots: Any, values: Any) -> Symbol:
    """Return a curve of straight pieces, constant beyond its ends."""
    at, y = np.asarray(knots, dtype=float).tolist(), np.asarray(values, dtype=float).tolist()
    total = as_symbol(y[0])
    for low, high, first, last in zip(at, at[1:], y, y[1:], strict=False):
        total = total + (last - first) / (high - low) * (node("min", node("max", x, low), high) - low)
    return total


_KNOWN = (
    "numpy's arithmetic, abs, sign, exp, log, sin, cos, tan, sinh, cosh, tanh, hypot, sqrt, power, minimum, maximum, "
    "clip, interp, where and comparisons"
)


def symbol(name: str) -> Symbol:
    """Return the symbol of an input."""
    return Symbol("input", (name,))


def as_symbol(value: Any) -> Symbol:
    """Return a symbol for a value that may be a number."""
    if isinstance(value, Symbol):
        return value
    if np.ndim(value) != 0:
        raise ExportError(
            f"The formula holds an array of shape {np.shape(value)}.", "numbers and signals", "Write it by numbers."
        )
    return Symbol("const", (float(value),))


def node(op: str, *operands: Any) -> Any:
    """Return an operation on symbols (elementwise on arrays), with constants folded and zeros and ones removed."""
    if any(isinstance(a, np.ndarray) and a.ndim for a in operands):
        return _each(partial(node, op), operands)
    args = tuple(as_symbol(a) for a in operands)
    known = [a.args[0] if a.op == "const" else None for a in args]
    fold, _ = _OPERATIONS.get(op, (None, None))
    if fold is not None and None not in known:
        return as_symbol(fold(*known))
    if op == "mul":
        if 0.0 in known:
            return as_symbol(0.0)
        if 1.0 in known:
            return args[1 - known.index(1.0)]
    if op == "add" and 0.0 in known:
        return args[1 - known.index(0.0)]
    if op in ("sub", "div") and known[1] == (0.0 if op == "sub" else 1.0):
        return args[0]
    if op == "div" and known[0] == 0.0:
        return as_symbol(0.0)
    if op == "where" and args[1].op == args[2].op == "const" and args[1].args == args[2].args:
        return args[1]
    return Symbol(op, args)


def in_order(roots: list[Symbol]) -> list[Symbol]:
    """Return all nodes under some roots, each once, operands before their users."""
    seen: set[int] = set()
    out: list[Symbol] = []

    def visit(s: Symbol) -> None:
        if id(s) in seen:
            return
        seen.add(id(s))
        for a in s.args:
            if isinstance(a, Symbol):
                visit(a)
        out.append(s)

    for root in roots:
        visit(root)
    return out
