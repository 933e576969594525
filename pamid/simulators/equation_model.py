"""A simulator written as equations: rates of states and outputs, as text that is data, not code."""

from __future__ import annotations

import ast
import math
import re
from collections.abc import Callable, Mapping, Sequence
from itertools import repeat
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
_PLAIN: dict[str, Callable[..., float]] = {
    "sqrt": math.sqrt, "exp": math.exp, "log": math.log, "sin": math.sin, "cos": math.cos, "tan": math.tan,
    "atan": math.atan, "tanh": math.tanh, "abs": abs, "sign": lambda v: float((v > 0.0) - (v < 0.0)) if v == v else v,
    "min": lambda a, b: a if a < b or a != a else b, "max": lambda a, b: a if a > b or a != a else b,
    "**": math.pow,
}  # fmt: skip
"""The same for plain numbers; some raise an error where arrays hold NaN."""
FEW = 8
"""Instants up to which plain numbers are faster than arrays: a simulation asks for a few runs at each step."""
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
        rate = self._rates = Formulas({name: rates[name] for name in states}, known) if states else None
        show = Formulas(shown, known) if outputs else None
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
                    row[:] = np.nan if np.iscomplexobj(found[name]) else found[name]
        except (TypeError, ValueError, ArithmeticError):  # such as a root of a negative constant
            return super()._call(what, function, arguments, t, names)
        return out

    def rate(self, t: np.ndarray, x: np.ndarray, u: np.ndarray, p: np.ndarray) -> np.ndarray:
        """Return the rates of the states, shape (n_states, n)."""
        if x.shape[1] <= FEW and self._rates is not None and self._rates.plain is not None:
            given = [(x, self.states), (u, self.inputs), (p, tuple(self.parameters))]
            try:
                return np.array(self._rates.one_by_one(t, given)).reshape(-1, len(x)).T
            except (TypeError, ValueError, ArithmeticError):  # not finite at some instant
                pass
        return super().rate(t, x, u, p)

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
        return dict(self.equations)


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
    return {n.id for n in ast.walk(tree_of(text)) if isinstance(n, ast.Name)} - {*FUNCTIONS, *_CONSTANTS}


def tree_of(text: str) -> ast.Expression:
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
            raise ParameterError(f"{text[:80]!r} holds {ast.unparse(node)[:60]!r}.", _KNOWN, "Use only these.")
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


class Formulas:
    """Right sides of equations, as a function of t, x, u, p that gives all of them by name."""

    def __init__(self, right: Mapping[str, str], known: set[str]) -> None:
        trees = {}
        for name, text in right.items():
            if unknown := sorted(names_in(text) - known):
                raise ParameterError(
                    f"The equation of {name} uses {', '.join(unknown)}.",
                    f"states, inputs, parameters or t: {', '.join(sorted(known))}",
                    "Give it as a port or parameter, or correct the name.",
                )
            trees[name] = tree_of(text)
        self._used = sorted(known & {name for text in right.values() for name in names_in(text)})
        # The trees hold arithmetic and calls of FUNCTIONS alone: nothing else can run.
        self._codes = {name: _compiled(name, tree) for name, tree in trees.items()}
        self._base = {"__builtins__": {}, **FUNCTIONS, **_CONSTANTS}
        self.plain = _of_numbers(self._used, list(trees.values()))

    def __call__(self, t: Any, x: Any, u: Any, p: Any) -> dict[str, Any]:
        """Return the right sides by name."""
        own = {**self._base, "t": t}
        for given in (x, u, p):
            own |= Values.named(given) if isinstance(given, Values) else given
        return {name: eval(code, own) for name, code in self._codes.items()}

    def one_by_one(
        self, t: np.ndarray, arguments: Sequence[tuple[np.ndarray, tuple[str, ...]]]
    ) -> list[tuple[float, ...]]:
        """Return the right sides at one instant after the other, as plain numbers."""
        assert self.plain is not None
        n = arguments[0][0].shape[1]
        rows = {"t": t.tolist() if np.ndim(t) else [t] * n}
        for values, labels in arguments:
            rows |= zip(labels, values.tolist(), strict=True)
        points = zip(*(rows[name] for name in self._used), strict=True) if self._used else repeat((), n)
        return [self.plain(*point) for point in points]


def _of_numbers(names: Sequence[str], trees: Sequence[ast.Expression]) -> Callable[..., tuple[float, ...]] | None:
    """Return a function of plain numbers that gives all right sides; None where they are nested too deeply for one."""
    given = ast.arguments([], [ast.arg(name) for name in names], kw_defaults=[], kwonlyargs=[], defaults=[])
    try:
        every = ast.Tuple([_Powers().visit(tree.body) for tree in trees], ast.Load())
        code = compile(ast.fix_missing_locations(ast.Expression(ast.Lambda(given, every))), "<all>", "eval")
    except (RecursionError, MemoryError):
        return None
    found: Callable[..., tuple[float, ...]] = eval(code, {"__builtins__": {}, **_PLAIN, **_CONSTANTS})
    return found


class _Powers(ast.NodeTransformer):
    """Powers as calls: of plain numbers Python's own may be complex."""

    def visit_BinOp(self, node: ast.BinOp) -> ast.AST:
        """Return a power as a call."""
        self.generic_visit(node)
        if not isinstance(node.op, ast.Pow):
            return node
        return ast.Call(ast.Name("**", ast.Load()), [node.left, node.right], [])


def _compiled(name: str, tree: ast.Expression) -> Any:
    try:
        return compile(tree, f"<{name}>", "eval")
    except (RecursionError, MemoryError):
        raise ParameterError(f"The equation of {name} is nested too deeply.", "a shorter one", "Simplify it.") from None
