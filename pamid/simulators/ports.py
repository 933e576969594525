"""Ports of a simulator: inputs, outputs, states, and where forces and losses can act."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Annotated, Any

import numpy as np

from ..errors import ParameterError
from ..explained import explained_fields
from ..names import require_one_of

KINDS = ("input", "output", "state", "joint", "chamber", "parameter")
"""Kinds of ports. A joint joins a position and its velocity, a chamber is where something is stored and may leak."""
RESERVED = ("trajectory", "time")
"""Columns of a log that name its runs and its clock."""


@dataclass(frozen=True)
class Port:
    """A signal of a simulator, or a place where forces or losses act on it.

    Parameters
    ----------
    name : str
        Its name, a Python identifier.
    kind : str
        One of `KINDS`.
    unit : str, default="-"
        Its unit, ``"-"`` for a plain number. For a joint the unit of what acts on it: a torque, a force, a voltage.
    column : str, default=""
        Column of the log that holds it; its own name by default. A state or input without a column is not measured.
    position, velocity : str, default=""
        For a joint: the states that are its position and velocity.
    level : str, default=""
        For a chamber: the state that says how full it is, a pressure, level or amount.
    through : str, default=""
        For a joint or chamber: the input through which forces or flows act on it. Without one they are added to the
        rate of its velocity or level.
    start : float, optional
        For a state: its value at the start of a run where the log does not say, 0 by default; for an input that is not
        logged, the value at which it stands.

    Raises
    ------
    ParameterError
        Invalid name or number.
    UnknownOptionError
        There is no such kind.

    Examples
    --------
    >>> from pamid.simulators import Port
    >>> motor = Port("motor", "joint", "V", position="theta", velocity="omega", through="voltage")
    >>> f"effects at {motor.name} act on {motor.through}, in {motor.unit}"
    'effects at motor act on voltage, in V'
    """

    name: str
    kind: str
    unit: str = "-"
    column: str = ""
    position: str = ""
    velocity: str = ""
    level: str = ""
    through: str = ""
    start: float | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not self.name.isidentifier():
            raise ParameterError(
                f"A port is named {self.name!r}.", "a name of letters, digits and _", "Choose a plain name."
            )
        require_one_of(self.kind, KINDS, f"The port {self.name} is of the kind {self.kind!r}.", "Correct it.")
        if self.kind in ("input", "output", "state") and self.source == RESERVED[0]:
            raise ParameterError(
                f"The port {self.name} is read from the column {self.source!r}, which names the runs.",
                "another column",
                "Give the port another name, or the key 'column'; if the log has a signal of that name, rename it: "
                f"pamid init LOG --signal NAME={RESERVED[0]}.",
            )  # fmt: skip
        if self.kind in ("input", "output", "state") and self.source == RESERVED[1] != self.column:
            raise ParameterError(
                f"The port {self.name} would be read from the column {self.source!r}, the log's clock.",
                "the column of its signal",
                f"Name it with the key 'column' (column = {self.source!r} if it is the clock), or rename the port. In "
                "equations and functions, t is the time.",
            )
        said = 0.0 if self.start is None else self.start
        if isinstance(said, bool) or not isinstance(said, (int, float)) or not math.isfinite(said):
            raise ParameterError(f"start of the port {self.name} is {self.start!r}.", "a number", "Write a number.")

    @property
    def source(self) -> str:
        """Column of the log that holds it."""
        return self.column or self.name

    @property
    def begins(self) -> float:
        """Value at the start of a run, or of an input that is not logged; 0 where none is said."""
        return 0.0 if self.start is None else float(self.start)


@explained_fields
@dataclass(frozen=True)
class ModelParameter:
    """A number of a simulator.

    Raises
    ------
    ParameterError
        A number is invalid, or the tolerance is not between 0 and 10.

    Examples
    --------
    >>> from pamid.simulators import ModelParameter
    >>> ModelParameter(8.4, tolerance=0.1, unit="ohm").unit
    'ohm'
    """

    value: Annotated[float, "Its value."]
    tolerance: Annotated[
        float, "Relative: how well it is known. What a change within it explains is not a gap; 0 holds it fixed."
    ] = 0.0
    unit: Annotated[str, "Its unit."] = "-"

    def __post_init__(self) -> None:
        for name in ("value", "tolerance"):
            number = getattr(self, name)
            if isinstance(number, bool) or not isinstance(number, (int, float, np.floating, np.integer)):
                raise ParameterError(f"The {name} of a parameter is {number!r}.", "a number", "Write a number.")
            if not math.isfinite(number):
                raise ParameterError(f"The {name} of a parameter is {number}.", "a finite number", "Correct it.")
        if not 0.0 <= self.tolerance <= 10.0:
            raise ParameterError(
                f"The tolerance of a parameter is {self.tolerance:g}.", "0 to 10, relative", "10 % is 0.1."
            )


def as_parameters(given: Mapping[str, Any] | None) -> dict[str, ModelParameter]:
    """Return parameters by name from numbers, pairs of value and tolerance, or `ModelParameter`."""
    found = {}
    for name, value in (given or {}).items():
        if isinstance(value, ModelParameter):
            found[str(name)] = value
        elif isinstance(value, (tuple, list)):
            found[str(name)] = ModelParameter(*value)
        else:
            found[str(name)] = ModelParameter(value)
    return found


def merged(own: Sequence[Port], said: Sequence[Port]) -> list[Port]:
    """Return a model's own ports, with overrides and further ones."""
    found = {p.name: p for p in own}
    for port in said:
        if port.name not in found:
            found[port.name] = port
            continue
        if port.kind != found[port.name].kind:
            raise ParameterError(
                f"The port {port.name} is declared as {port.kind}.",
                f"{found[port.name].kind}, as the model has it",
                "Correct its kind.",
            )
        names = ("unit", "column", "position", "velocity", "level", "through", "start")
        plain = Port(port.name, port.kind)
        changes = {n: getattr(port, n) for n in names if getattr(port, n) != getattr(plain, n)}
        found[port.name] = replace(found[port.name], **changes)
    return list(found.values())


class Values(np.ndarray):
    """Numbers by name: an array whose rows also go by name, as items or as attributes.

    Names take precedence over array attributes: ``x.T`` is the port T, if there is one.

    Examples
    --------
    >>> import numpy as np
    >>> from pamid.simulators.ports import Values
    >>> x = Values.of(np.array([0.1, 2.0]), ("angle", "speed"))  # rad, rad/s
    >>> angle, speed = x
    >>> float(x["speed"]) == float(x.speed) == float(x[1]) == float(speed)
    True
    >>> Values.of(np.array([293.0, 350.0]), ("ambient", "T")).T  # K
    np.float64(350.0)
    """

    _names: tuple[str, ...] = ()
    _kind: type[np.ndarray] | None = None

    @classmethod
    def of(cls, rows: np.ndarray, names: Iterable[str], kind: Any = None) -> Values:
        """Return rows under names, each a plain array or of a kind."""
        names = tuple(names)
        out: Values = np.asarray(rows, dtype=float).view(_class_of(names, kind))
        out._names = names
        return out

    def _rows(self) -> np.ndarray:
        plain = np.asarray(self)
        return plain if self._kind is None else plain.view(self._kind)

    def __array_finalize__(self, other: Any) -> None:
        self._names = ()

    @staticmethod
    def named(values: Values) -> dict[str, Any]:
        """Return the rows by name."""
        return dict(zip(values._names, np.asarray(values), strict=True))

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *given: Any, **options: Any) -> Any:
        """Return what is computed of the rows; computed values have no names."""
        found = getattr(ufunc, method)(
            *map(rows_of, given), **{k: tuple(map(rows_of, v)) if k == "out" else v for k, v in options.items()}
        )
        return options["out"][0] if options.get("out") and not isinstance(found, tuple) else found

    def __getitem__(self, key: Any) -> Any:
        if isinstance(key, str):
            if key not in self._names:
                raise KeyError(f"{key}; there are {', '.join(self._names) or 'none'}")
            return self._rows()[self._names.index(key)]
        return self._rows()[key]

    def __getattr__(self, name: str) -> Any:
        names = self.__dict__.get("_names", ())
        if name in names:
            return self._rows()[names.index(name)]
        raise AttributeError(f"no value is named {name!r}; there are {', '.join(names) or 'none'}")

    def __iter__(self) -> Any:
        return iter(self._rows())


def rows_of(value: Any) -> Any:
    """Return values by name as the array that they are; anything else as it is."""
    return value._rows() if isinstance(value, Values) else value


@lru_cache(maxsize=256)
def _class_of(names: tuple[str, ...], kind: Any) -> type[Values]:
    """Return the class whose attributes of these names are rows, even where arrays have such attributes."""
    return type("Values", (Values,), {n: _Row(k) for k, n in enumerate(names)} | {"_kind": kind})


class _Row:
    """A row of values by its name, which a function may set to another value."""

    def __init__(self, k: int) -> None:
        self.k = k

    def __get__(self, values: Any, owner: Any = None) -> Any:
        return values._rows()[self.k]
