"""A simulator that is a Python function: an algebraic model, the rates of its states, or whole runs."""

from __future__ import annotations

import contextlib
import functools
import importlib
import importlib.util
import inspect
import itertools
import os
import sys
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence, Sized
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np

from ..errors import (
    PamidError,
    ParameterError,
    ShapeError,
    SimulatorNotFoundError,
    SimulatorRunError,
    UnknownOptionError,
)
from .base import Simulator
from .branches import Branches, Instants, ManyWaysError, Parting, by_branches
from .elementwise import elementwise, has_no_value
from .ports import ModelParameter, Port, Values

_WORTH = 8
"""Instants in a part from which asking for them at once is faster than one by one."""
_FORMS = ("ode", "algebraic", "run")


class FunctionSimulator(Simulator):
    r"""A function with ports.

    .. math:: \dot x = f(t, x, u, p) \quad\text{or}\quad y = g(u, p) \quad\text{or}\quad y(t) = s(u, p, x_0)

    Parameters
    ----------
    function : callable
        ``f(t, x, u, p)`` returns the rates of the states; ``g(u, p)`` (or ``g(t, u, p)``) the outputs at an instant;
        ``s(u, p, x0)`` the outputs of a whole run, with the times as ``u["time"]``, the last. x, u and p are read by
        name (``x["angle"]``, ``x.angle``) or by position (``x[0]``). It returns numbers in the order of the ports, or a
        mapping by name.
    output : callable, optional
        ``h(t, x, u, p)`` for a function of rates: what the output ports show.
    form : {"ode", "algebraic", "run"}, optional
        Which of the three it is; by default inferred from its arguments.
    source : str, default=""
        Where it was imported from, for its simulator file.

    Raises
    ------
    UnknownOptionError
        Unknown form.

    Examples
    --------
    >>> from pamid.simulators import FunctionSimulator, Port
    >>> ports = [Port("P", "input", "Pa"), Port("F", "output", "N")]
    >>> piston = FunctionSimulator(lambda u, p: {"F": u.P * p.area}, ports, {"area": (5e-4, 0.02, "m^2")})
    >>> piston.form
    'algebraic'
    """

    kind: ClassVar[str] = "function"
    kinds: ClassVar[tuple[str, ...]] = ("function", *_FORMS)

    def __init__(
        self,
        function: Callable[..., Any],
        ports: Sequence[Port],
        parameters: Mapping[str, Any] | None = None,
        *,
        output: Callable[..., Any] | None = None,
        form: str | None = None,
        effects: Sequence[tuple[str, str, Mapping[str, float]]] = (),
        source: str = "",
    ) -> None:
        super().__init__(ports, parameters, effects)
        self.function, self.output_function, self.source = function, output, source
        self._arguments = _arguments(function)
        self.form = form or _form_of(self._arguments, bool(self.states))
        if self.form not in _FORMS:
            raise UnknownOptionError(f"form is {form!r}.", f"one of {', '.join(_FORMS)}", "Correct it.")
        if self.form == "run" and "time" in self.inputs:
            raise ParameterError(
                f"An input is named 'time', but {_name(function)} is given the times of a run as u['time'].",
                "another name for the input",
                "Rename it, and name the log's column with its key 'column'.",
            )
        self._fast: dict[str, bool] = {}
        self._answered: set[str] = set()
        self._branches: dict[str, Branches] = {}
        self._each: dict[str, Callable[..., Any]] = {}
        """Functions that are asked at many instants in place of those that take one alone."""
        self.output_source, self.folder = "", Path()

    @classmethod
    def from_page(
        cls, kind: str, table: Mapping[str, Any], ports: Sequence[Port], parameters: Mapping[str, ModelParameter],
        effects: Sequence[tuple[str, str, Mapping[str, float]]], folder: Path,
    ) -> Self:  # fmt: skip
        """Return the simulator of a file; its table has ``function``, and optionally ``output`` and ``form``."""
        source = cls.text_of(table, "function", ("output", "form"))
        shown = cls.text_of({"output": table["output"]}, "output") if "output" in table else ""
        out = cls(
            load_function(source, folder),
            ports,
            parameters,
            output=load_function(shown, folder) if shown else None,
            form=table.get("form", kind if kind in _FORMS else None),
            effects=effects,
            source=source,
        )
        out.output_source, out.folder = shown, folder
        return out

    def page_table(self, folder: Path) -> dict[str, Any]:
        """Return the entries of the simulator file's table."""
        found = {"function": written_source(self.source or _source_of(self.function), self.folder, folder)}
        if self.output_function is not None:
            found["output"] = written_source(
                self.output_source or _source_of(self.output_function), self.folder, folder
            )
        return {**found, "form": self.form}

    def _call(
        self, what: str, function: Callable[..., Any], arguments: Sequence[tuple[np.ndarray, tuple[str, ...]]],
        t: np.ndarray | None, names: tuple[str, ...],
    ) -> np.ndarray:  # fmt: skip
        """Evaluate a function at many instants at once where it allows that, else one by one."""
        n = arguments[0][0].shape[1]

        def at(k: Any, function: Callable[..., Any] = function) -> np.ndarray:
            some, when = [(rows[:, k], labels) for rows, labels in arguments], None if t is None else t[k]
            if np.ndim(k):
                out = np.empty((len(names), len(k)))
                by_branches(functools.partial(_fill, out, names, function, when, some), len(k), len(k))
                return out
            one = functools.partial(_silently, function, when, some)
            return np.asarray(self._defined(what, names, one, function))

        if n == 0:
            return np.zeros((len(names), 0))
        fast = self._fast.get(what)
        if fast is None and n > 1:
            fast = self._fast[what] = _agrees(at, at, n, len(names))
            each = None if fast else elementwise(function)
            if each is not None and _agrees(at, functools.partial(at, function=each), n, len(names)):
                fast = self._fast[what] = True
                self._each[what] = each
            elif each is not None:  # what a function keeps of its last call is a number again
                with contextlib.suppress(PamidError):
                    at(0)
        if fast and (what not in self._branches or n > _WORTH * (self._branches[what].fewest - 1)):
            answer = self._for_all(what, names, function, t, arguments)
            if answer is not None:
                return answer
        out = np.empty((len(names), n))
        times, columns = [()] * n if t is None else [(one,) for one in t], [np.array(rows.T) for rows, _ in arguments]
        labels = [given for _, given in arguments]
        for k in range(n):
            given = [Values.of(rows[k], some) for rows, some in zip(columns, labels, strict=True)]
            one = functools.partial(ask_function, function, *times[k], *given)
            out[:, k] = self._defined(what, names, one, function)
        return out

    def _for_all(
        self, what: str, names: tuple[str, ...], function: Callable[..., Any], t: np.ndarray | None,
        arguments: Sequence[tuple[np.ndarray, tuple[str, ...]]],
    ) -> np.ndarray | None:  # fmt: skip
        """Return a function's numbers at all instants, asked at once; None where that fails at some of them."""
        out = np.empty((len(names), n := arguments[0][0].shape[1]))

        def asked(function: Callable[..., Any]) -> np.ndarray | None:
            filled = functools.partial(_fill, out, names, function, t, arguments)
            try:
                self._branches.setdefault(what, Branches()).ask(filled, n, max(n // _WORTH, 2))
            except ManyWaysError:
                return None
            return out

        try:
            return asked(self._each.get(what, function))
        except SimulatorRunError as error:
            no_value, anew = has_no_value(error.__cause__), what in self._each
            if isinstance(error.__cause__, TypeError) or (anew and not no_value):
                self._fast[what] = False  # a branch that was not asked before takes one instant at a time
                return None
            if not no_value:
                raise
            self.undefined, each = str(error.found), elementwise(function, or_nan=True)
            return None if each is None else asked(each)

    def _defined(
        self, what: str, names: tuple[str, ...], asked: Callable[[], Any], function: Callable[..., Any],
    ) -> np.ndarray | Sequence[float]:  # fmt: skip
        """Return a function's numbers at an instant; NaN where `math` raises there, but not everywhere."""
        try:
            answer = _in_order(asked(), names)
        except SimulatorRunError as error:
            if what not in self._answered or not has_no_value(error.__cause__):
                raise
            self.undefined = str(error.found)
            return np.full(len(names), np.nan)
        self._answered.add(what)
        plain = type(answer) in (list, tuple) and all(type(one) in (float, np.float64) for one in answer)
        return answer if plain and len(answer) == len(names) else _numbers(answer, names, function)

    @property
    def at_once(self) -> bool:
        """Whether a call for many instants takes hardly longer than one for a few."""
        return self._fast.get("rate", True)

    def rate(self, t: np.ndarray, x: np.ndarray, u: np.ndarray, p: np.ndarray) -> np.ndarray:
        """Return the rates of the states, shape (n_states, n)."""
        given = [(x, self.states), (u, self.inputs), (p, tuple(self.parameters))]
        return self._call("rate", self.function, given, t, self.states)

    def output(self, t: np.ndarray, x: np.ndarray, u: np.ndarray, p: np.ndarray) -> np.ndarray:
        """Return the outputs, shape (n_outputs, n)."""
        if self.form == "algebraic":
            timed = len(self._arguments) > 2
            given = [(u, self.inputs), (p, tuple(self.parameters))]
            return self._call("output", self.function, given, t if timed else None, self.outputs)
        if self.output_function is None:
            return np.zeros((0, x.shape[1]))
        given = [(x, self.states), (u, self.inputs), (p, tuple(self.parameters))]
        return self._call("output", self.output_function, given, t, self.outputs)

    def run(self, t: np.ndarray, u: np.ndarray, p: np.ndarray, x0: np.ndarray) -> np.ndarray:
        """Return the outputs of a whole run, shape (n_outputs, n)."""
        given = Values.of(np.vstack([u, t[None]]), (*self.inputs, "time"))
        own = Values.of(np.array(p), self.parameters), Values.of(np.array(x0), self.states)
        answer = ask_function(self.function, given, *own)
        out = _rows(answer, self.outputs, self.function)
        if out.shape != (len(self.outputs), len(t)):
            raise ShapeError(
                f"{_name(self.function)} returned {out.shape} for a run of {len(t)} samples.",
                f"{len(self.outputs)} outputs of {len(t)} samples each",
                "Return the outputs at the times u['time'].",
            )
        return out


def load_function(source: str, folder: Path | None = None) -> Callable[..., Any]:
    """Import a function, which runs the code of its module."""
    module, colon, name = source.rpartition(":")
    if not colon or not module or not name:
        raise ParameterError(f"The function is {source!r}.", "'module:function' or 'file.py:function'", "Correct it.")
    try:
        with contextlib.redirect_stdout(sys.stderr), warnings.catch_warnings(), np.errstate():
            by_path = module.endswith(".py")
            loaded = _load_file(Path(folder or ".") / module) if by_path else _load_module(module, folder)
    except (SimulatorNotFoundError, ParameterError, KeyboardInterrupt):
        raise
    except BaseException as error:
        raise ParameterError(
            f"{module} cannot be imported: {type(error).__name__}: {_said(error)}.",
            "a module without errors",
            "Correct it.",
        ) from error
    found = getattr(loaded, name, None)
    if found is None:
        raise SimulatorNotFoundError(
            f"{module} has no {name!r}.", "the name of a function in it", "Correct the name after the colon."
        )
    if not callable(found):
        raise ParameterError(
            f"{source} is not a function.", "the name of a function", "Correct the name after the colon."
        )
    return found


def ask_function(function: Callable[..., Any], *given: Any, returns: str = "numbers") -> Any:
    """Call a user's function: its errors are reported as its own, and its printout stays out of the results."""
    out, sys.stdout = sys.stdout, sys.stderr
    try:
        with warnings.catch_warnings(), np.errstate(all="ignore"):  # a function may set both, for pamid too
            return function(*given)
    except (PamidError, MemoryError, KeyboardInterrupt, Parting):
        raise
    except BaseException as error:  # a function may raise a class of its own below it
        trace = error.__traceback__.tb_next if error.__traceback__ else None
        line = f" in line {trace.tb_lineno}" if trace is not None else ""
        raise SimulatorRunError(
            f"{_name(function)} raised {type(error).__name__}{line}: {_said(error)}.",
            f"a function of {len(given) or 'no'} arguments that returns {returns}",
            "Correct the function.",
        ) from error
    finally:
        sys.stdout = out


def _said(error: BaseException) -> str:
    """Return the text of a foreign error; creating it may fail as well."""
    try:
        return str(error)[:200]
    except Exception:
        return "its message cannot be shown"


def _silently(function: Callable[..., Any], t: Any, arguments: Sequence[tuple[np.ndarray, tuple[str, ...]]]) -> Any:
    """Call a user's function with numbers by name; non-finite values are checked later."""
    kind = Instants if arguments[0][0].ndim > 1 else None
    # Copies: a function may keep or overwrite what it is given.
    given = [Values.of(np.array(rows), labels, kind) for rows, labels in arguments]
    when = None if t is None else np.array(t) if kind is None else np.array(t).view(kind)
    return ask_function(function, *given) if when is None else ask_function(function, when[()], *given)


def _fill(
    out: np.ndarray, names: tuple[str, ...], function: Callable[..., Any], t: np.ndarray | None,
    arguments: Sequence[tuple[np.ndarray, tuple[str, ...]]], rows: Any,
) -> None:  # fmt: skip
    """Write a user's answer for some instants."""
    some = [(given[:, rows] if given.ndim > 1 else given, labels) for given, labels in arguments]
    answer = _in_order(_silently(function, None if t is None else t[rows], some), names)
    if type(answer) in (list, tuple) and len(answer) == len(names):
        with contextlib.suppress(TypeError, ValueError):  # reported below
            for row, values in zip(out, answer, strict=True):
                row[rows] = _real(values)
            return
    found = _rows(answer, names, function)
    out[:, rows] = np.broadcast_to(found if found.ndim > 1 else found[:, None], (len(names), some[0][0].shape[1]))


def written_source(source: str, home: Path, folder: Path) -> str:
    """Return where code was imported from, a file relative to another folder."""
    if not source:
        raise ParameterError(
            "The simulator was made from an object that cannot be imported by name.",
            "a function of a module",
            "Define it in a file, outside of other functions.",
        )
    module, _, name = source.rpartition(":")
    if module.endswith(".py"):
        module = Path(os.path.relpath((home / module).resolve(), folder.resolve())).as_posix()
    return f"{module}:{name}"


def _source_of(function: Callable[..., Any]) -> str:
    """Return the name by which a function can be imported; empty where there is none."""
    module, name = getattr(function, "__module__", ""), getattr(function, "__qualname__", "")
    importable = module and module != "__main__" and name and "<" not in name
    return f"{module}:{name}" if importable else ""


def _load_file(path: Path) -> Any:
    if not path.is_file():
        raise SimulatorNotFoundError(f"{path} does not exist.", "a Python file", "Check the path.")
    spec = importlib.util.spec_from_file_location(f"pamid_simulator_{path.stem}", path)
    if spec is None or spec.loader is None:
        raise SimulatorNotFoundError(f"{path} is not a Python file.", "a file that ends in .py", "Check the path.")
    sys.modules[spec.name] = module = importlib.util.module_from_spec(spec)  # a dataclass looks its module up there
    with _on_path(path.parent):
        spec.loader.exec_module(module)
    return module


def _load_module(name: str, folder: Path | None) -> Any:
    try:
        with _on_path(folder):
            return importlib.import_module(name)
    except ModuleNotFoundError as error:
        if error.name and name.startswith(error.name):
            raise SimulatorNotFoundError(
                f"There is no module {name!r}.",
                "a module on the path, or a file beside the simulator file",
                "Check the name.",
            ) from None
        raise


@contextlib.contextmanager
def _on_path(folder: Path | None) -> Iterator[None]:
    """Put a folder on the path for a while, so that modules import those beside them, as scripts do."""
    added = [] if folder is None else [str(folder)]
    sys.path[:0] = added
    try:
        yield
    finally:
        for one in added:
            sys.path.remove(one)


def _arguments(function: Callable[..., Any]) -> list[str]:
    try:
        return [
            p.name
            for p in inspect.signature(function).parameters.values()
            if p.kind in (p.POSITIONAL_ONLY, p.POSITIONAL_OR_KEYWORD) and p.default is p.empty
        ]
    except (TypeError, ValueError):
        return []


def _form_of(arguments: list[str], has_states: bool) -> str:
    if len(arguments) == 4 or (has_states and len(arguments) != 3):
        return "ode"
    return "run" if len(arguments) == 3 and arguments[0] not in ("t", "time") else "algebraic"


def _name(function: Callable[..., Any]) -> str:
    return getattr(function, "__name__", type(function).__name__)


def _in_order(answer: Any, names: tuple[str, ...]) -> Any:
    """Return what a function returned by name in the order of names; anything else as it is."""
    return [answer[n] for n in names] if type(answer) is dict and all(n in answer for n in names) else answer


def _numbers(answer: Any, names: tuple[str, ...], function: Callable[..., Any]) -> np.ndarray:
    """Return what a function returned at one instant."""
    found = _rows(answer, names, function)
    if found.size != len(names):
        raise ShapeError(
            f"{_name(function)} returned {found.size} values.",
            f"{len(names)}: {', '.join(names)}",
            "Return one number for each.",
        )
    return found.reshape(len(names))


def _rows(answer: Any, names: tuple[str, ...], function: Callable[..., Any]) -> np.ndarray:
    """Return what a function returned as rows in the order of names."""
    if isinstance(answer, Mapping):
        if lacking := [n for n in names if n not in answer]:
            raise ShapeError(
                f"{_name(function)} returned {', '.join(map(str, answer)) or 'nothing'}.",
                f"also {', '.join(lacking)}",
                "Return every port by name.",
            )
        answer = [answer[n] for n in names]
    one = len(names) == 1 and np.ndim(answer) in (0, 1) and not (np.ndim(answer) and len(answer) == 1)

    @functools.wraps(function)
    def taken() -> list[Any]:  # a function that yields its values runs only now
        return list(itertools.islice(answer, len(names) + 1))

    rows = ask_function(taken) if not one and np.iterable(answer) else [answer]
    if len(rows) != len(names):
        raise ShapeError(
            f"{_name(function)} returned {_count(answer, rows, names)} values.",
            f"{len(names)}: {', '.join(names)}",
            "Return all, in order.",
        )
    try:
        return np.stack(np.broadcast_arrays(*map(_real, rows)))
    except (TypeError, ValueError, OverflowError) as error:
        raise ShapeError(
            f"{_name(function)} did not return plain numbers ({error}).", "numbers", "Correct it."
        ) from None


def _real(values: Any) -> np.ndarray:
    """Return real numbers, NaN where masked; raise for text, None and imaginary parts, which numpy would take."""
    x = np.ma.filled(values.astype(float), np.nan) if isinstance(values, np.ma.MaskedArray) else np.asarray(values)
    if x.dtype.kind == "c" and not x.imag.any():
        x = x.real
    if x.dtype.kind == "O":
        wrong = [v for v in x.flat if v is None or isinstance(v, (str, bytes, complex))]
    else:
        wrong = [] if x.dtype.kind in "biuf" else list(x.flat[:1])
    if wrong:
        raise TypeError(f"{str(wrong[0])[:40]!r} is not a real number")
    return x.astype(float, copy=False)


def _count(answer: Any, rows: list[Any], names: tuple[str, ...]) -> str:
    if np.ndim(answer) > 0 and isinstance(answer, Sized):
        return str(len(answer))
    return f"more than {len(names)}" if len(rows) > len(names) else str(len(rows))


def _agrees(at: Callable[[Any], np.ndarray], at_many: Callable[[Any], np.ndarray], n: int, rows: int) -> bool:
    """Return whether a function gives the same for many instants at once as one by one."""
    some = np.unique(np.linspace(0, n - 1, min(n, 5)).astype(int))
    single = np.stack([at(k).reshape(rows) for k in some], axis=1)
    try:
        many = at_many(some)
    except (
        TypeError,
        ValueError,
        AttributeError,
        LookupError,
        ArithmeticError,
        PamidError,
    ):  # a branch on a number, math.sin ...: it is then called one instant at a time
        return False
    if many.ndim == 1:
        many = np.repeat(many[:, None], len(some), axis=1)
    return many.shape == single.shape and bool(np.allclose(many, single, rtol=1e-9, atol=0.0, equal_nan=True))
