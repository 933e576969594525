"""A simulator written as equations: rates of states and outputs, as text that is data, not code."""

from __future__ import annotations

import ast
import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np

from ..errors import MissingParameterError, ParameterError
from .function import FunctionSimulator
from .ports import ModelParameter, Port, Values

FUNCTIONS: dict[str, Callable[..., Any]] = {
    "sqrt": np.sqrt, "exp": np.exp, "log": np.log, "sin": np.sin, "cos": np.cos, "tan": np.tan, "atan": np.arctan,
    "tanh": np.tanh, "abs": np.abs, "sign": np.sign, "min": np.minimum, "max": np.maximum,
}  # fmt: skip
"""What an equation may call; angles in rad."""
_CONSTANTS = {"pi": float(np.pi)}
_NODES = (
    ast.Expression, ast.BinOp, ast.UnaryOp, ast.Call, ast.Name, ast.Constant, ast.Load, ast.Add, ast.Sub, ast.Mult,
    ast.Div, ast.Pow, ast.USub, ast.UAdd,
)  # fmt: skip
_RATE = re.compile(r"d\s*([A-Za-z_]\w*)\s*/\s*dt$")
_LONGEST = 2000
_KNOWN = f"numbers, names, + - * / ** ( ) and {', '.join(FUNCTIONS)}"


class EquationSimulator(FunctionSimulator):
    r"""Equations of a system, such as ``dh/dt = v`` and ``dv/dt = -g``, or ``F = A*p``.

    .. math:: \dot x_i = f_i(t, x, u, p), \qquad y_j = h_j(t, x, u, p)

    Only arithmetic and `FUNCTIONS` are allowed, so a file of equations is data: it needs no trust.

    Parameters
    ----------
    equations : mapping of str to str
        Right sides by left side: ``"dh/dt"`` for the state ``h``, ``"F"`` for an output.

    Raises
    ------
    ParameterError
        An equation is invalid, calls an unknown function, or uses a name that is no port, parameter or ``t``.
    MissingParameterError
        A state or output has no equation.

    Examples
    --------
    >>> from pamid.simulators import EquationSimulator, Port
    >>> ports = [Port("h", "state", "m"), Port("v", "state", "m/s")]
    >>> fall = EquationSimulator({"dh/dt": "v", "dv/dt": "-g"}, ports, {"g": 9.81})  # m/s²
    >>> fall.form, fall.states
    ('ode', ('h', 'v'))
    """

    kind: ClassVar[str] = "equations"
    kinds: ClassVar[tuple[str, ...]] = ("equations",)
    executes: ClassVar[bool] = False

    def __init__(
        self,
        equations: Mapping[str, str],
        ports: Sequence[Port],
        parameters: Mapping[str, Any] | None = None,
        effects: Sequence[tuple[str, str, Mapping[str, float]]] = (),
    ) -> None:
        self.equations = {str(left): str(right) for left, right in equations.items()}
        states = [p.name for p in ports if p.kind == "state"]
        outputs = [p.name for p in ports if p.kind == "output"]
        known = {"t", *(parameters or {}), *(p.name for p in ports if p.kind in ("state", "input"))}
        rates, shown = sides(self.equations)
        for names, given, what in ((states, rates, "d{}/dt"), (outputs, shown, "{}")):
            if wrong := sorted(set(names) ^ set(given)):
                left = what.format(wrong[0])
                raise MissingParameterError(
                    f"{left} has {'no equation' if wrong[0] in names else 'no port'}.",
                    "one equation for each state (dNAME/dt) and output",
                    "Add it.",
                )
        rate = formulas(rates, known) if states else None
        show = formulas(shown, known) if outputs else None
        if rate is not None:
            super().__init__(rate, ports, parameters, output=show, form="ode", effects=effects)
        else:
            assert show is not None
            super().__init__(lambda t, u, p: show(t, {}, u, p), ports, parameters, form="algebraic", effects=effects)

    def _call(
        self, what: str, function: Callable[..., Any], arguments: Sequence[tuple[np.ndarray, tuple[str, ...]]],
        t: np.ndarray | None, names: tuple[str, ...],
    ) -> np.ndarray:  # fmt: skip
        """Evaluate equations at all instants at once: they are data, and need no guards of a foreign function."""
        out = np.empty((len(names), arguments[0][0].shape[1]))
        given = [dict(zip(labels, rows, strict=True)) for rows, labels in arguments]
        try:
            with np.errstate(all="ignore"):
                found = function(*(given if t is None else [t, *given]))
                for row, name in zip(out, names, strict=True):
                    row[:] = found[name]
        except (TypeError, ValueError, ArithmeticError):  # such as a root of a negative constant
            return super()._call(what, function, arguments, t, names)
        return out

    @classmethod
    def from_page(
        cls, kind: str, table: Mapping[str, Any], ports: Sequence[Port], parameters: Mapping[str, ModelParameter],
        effects: Sequence[tuple[str, str, Mapping[str, float]]], folder: Path,
    ) -> Self:  # fmt: skip
        """Return the simulator of a simulator file, whose table has one equation per line."""
        if wrong := [k for k, v in table.items() if not isinstance(v, str)]:
            raise ParameterError(f"The equation of {wrong[0]} is {table[wrong[0]]!r}.", "a text", "Quote it.")
        return cls(table, ports, parameters, effects)

    def page_table(self, folder: Path) -> dict[str, Any]:
        """Return the entries of the simulator file's table."""
        return {f'"{left}"': right for left, right in self.equations.items()}


def sides(equations: Mapping[str, str]) -> tuple[dict[str, str], dict[str, str]]:
    """Return the right sides of rates, by state, and of outputs."""
    rates: dict[str, str] = {}
    outputs: dict[str, str] = {}
    for left, right in equations.items():
        clean = left.strip()
        if found := _RATE.match(clean):
            rates[found[1]] = right
        elif clean.isidentifier() and clean.isascii():
            outputs[clean] = right
        else:
            raise ParameterError(f"The left side {left[:60]!r} is not valid.", "dNAME/dt or NAME", "Write dx/dt = ...")
    return rates, outputs


def names_in(text: str) -> set[str]:
    """Return the names of an equation's right side other than functions and constants."""
    return {n.id for n in ast.walk(_parsed(text)) if isinstance(n, ast.Name)} - {*FUNCTIONS, *_CONSTANTS}


def _parsed(text: str) -> ast.Expression:
    """Return an equation's right side as a tree of arithmetic only."""
    try:
        if len(text) > _LONGEST:
            raise ValueError(f"it has {len(text)} characters")
        tree = ast.parse(text.strip().replace("^", "**"), mode="eval")
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        raise ParameterError(f"{text[:80]!r} is not an equation ({error}).", _KNOWN, "Correct it.") from None
    for node in ast.walk(tree):
        called = isinstance(node, ast.Call)
        if not isinstance(node, _NODES) or (called and _wrong_call(node)):
            raise ParameterError(f"{text[:80]!r} holds {ast.unparse(node)[:60]!r}.", _KNOWN, "Write it with these.")
        if isinstance(node, ast.Constant):
            if isinstance(node.value, bool) or not isinstance(node.value, (int, float)):
                raise ParameterError(f"{text[:80]!r} holds {node.value!r}.", "numbers", "Write a number.")
            try:
                node.value = float(node.value)  # whole numbers would grow without bound
            except OverflowError:
                raise ParameterError(
                    f"{text[:80]!r} holds a number beyond 1.8e308.", "a number", "Shorten it."
                ) from None
    return tree


def _wrong_call(node: Any) -> bool:
    if not isinstance(node.func, ast.Name) or node.func.id not in FUNCTIONS or node.keywords:
        return True
    return len(node.args) != (2 if node.func.id in ("min", "max") else 1)


def formulas(right: Mapping[str, str], known: set[str]) -> Callable[[Any, Any, Any, Any], dict[str, Any]]:
    """Return a function of t, x, u, p that gives all right sides."""
    codes = []
    for name, text in right.items():
        if unknown := sorted(names_in(text) - known):
            raise ParameterError(
                f"The equation of {name} uses {', '.join(unknown)}.",
                f"states, inputs, parameters or t: {', '.join(sorted(known))}",
                "Give it as a port or parameter, or correct the name.",
            )
        # The tree holds arithmetic and calls of FUNCTIONS alone: nothing else can run.
        tree = _parsed(text)
        try:
            codes.append(compile(tree, f"<{name}>", "eval"))
        except (RecursionError, MemoryError):
            raise ParameterError(
                f"The equation of {name} is nested too deeply: {text[:60]!r}.", "a shorter one", "Simplify it."
            ) from None

    base = {"__builtins__": {}, **FUNCTIONS, **_CONSTANTS}

    def values(t: Any, x: Any, u: Any, p: Any) -> dict[str, Any]:
        own = {**base, "t": t}
        for given in (x, u, p):
            own |= Values.named(given) if isinstance(given, Values) else given
        return {n: eval(code, own) for n, code in zip(right, codes, strict=True)}

    return values
