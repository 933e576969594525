"""What a system is: the signals that its log must have, the numbers of its simulator file, and its nominal equation."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Collection, Iterable, Mapping, Sequence
from copy import copy
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, ClassVar, NamedTuple

import numpy as np
import pandas as pd

from ..effects.spec import EffectLike, EffectSpec
from ..errors import (
    EmptyLogError,
    ImplausibleParameterError,
    MappingError,
    MissingColumnError,
    MissingParameterError,
    SimulatorTypeError,
)
from ..explained import explained_fields
from ..face import AnySimulator
from ..files import write_whole
from ..names import REMOVE, refuse_others, require_one_of
from ..signals.unit_names import parse_quantity, unit_name
from ..signals.units import UNITS
from ..simulators.base import Simulator
from ..simulators.ports import ModelParameter, Port
from ..simulators.problem import COUNTS, Problem

FIT = "fit"
"""Instead of a number: it is fitted to the log."""


@explained_fields
class Input(NamedTuple):
    """A signal of a system's log.

    Examples
    --------
    >>> from pamid.systems import Input
    >>> Input("P", "Pa", "pressure in the chamber, absolute").needed
    True
    """

    name: Annotated[str, "Its name in a tidy log."]
    unit: Annotated[str, "SI unit."]
    meaning: Annotated[str, "What it is, for somebody who sees the word for the first time."]
    needed: Annotated[bool, "Whether the system cannot do without."] = True


@explained_fields
class Quantity(NamedTuple):
    """A number of a system's page.

    Examples
    --------
    >>> from pamid.systems import Quantity
    >>> bore = Quantity("bore", "m", 0.002, 0.5, "inner diameter of the cylinder")
    >>> f"{bore.name}: {bore.lower:g} to {bore.upper:g} {bore.unit}"
    'bore: 0.002 to 0.5 m'
    """

    name: Annotated[str, "Its name in the file."]
    unit: Annotated[str, 'SI unit, ``"-"`` for a plain number.']
    lower: Annotated[float, "Plausible range."]
    upper: Annotated[float, "Plausible range."]
    meaning: Annotated[str, "What it is."]
    default: Annotated[float | str | None, "Value where the user gives none; None: it has to be given."] = None
    may_fit: Annotated[bool, 'Whether ``"fit"`` may stand instead of a number.'] = False
    hint: Annotated[str, "What a value out of range probably is."] = ""

    def checked(self, value: Any, kind: str) -> float | str:
        """Return a value of the file, a number in SI, a text such as ``"25 mm"`` or ``"fit"``, in SI or as ``"fit"``;
        raise if it is invalid, with the kind of the system.
        """
        if value == FIT and self.may_fit:
            return FIT
        text = f"{self.lower:g} to {self.upper:g} {self.unit}".removesuffix(" -")
        try:
            number = parse_quantity(value, f"{kind}.{self.name}")
        except MappingError:
            raise SimulatorTypeError(
                f"{kind}.{self.name} is {value!r}.",
                f"a number in {self.unit}, or a text of number and unit",
                "Correct the value.",
            ) from None
        written = unit_name(value.strip(" +-.,0123456789eE")) if isinstance(value, str) else None
        known, own = UNITS.get(written or ""), UNITS.get(self.unit)
        if known is not None and own is not None and known.dimension != own.dimension:
            raise ImplausibleParameterError(
                f"{kind}.{self.name} is {value!r}, a {known.dimension}.", f"a {own.dimension}", "Correct the unit."
            )
        if not self.lower <= number <= self.upper:
            raise ImplausibleParameterError(
                f"{kind}.{self.name} is {number:g} {self.unit}.", text, self.hint or "Correct the value."
            )
        return number


class Choice(NamedTuple):
    """A word of a system's page."""

    name: str
    """Its name in the file."""
    options: tuple[str, ...]
    """What may stand there."""
    meaning: str
    """What it is."""
    default: str
    """Word where the user gives none."""

    def checked(self, value: Any, kind: str) -> str:
        """Return a word of the file; raise if it is not one of the options."""
        require_one_of(value, self.options, f"{kind}.{self.name} is {value!r}.", "Correct the word.")
        return str(value)


class System(Simulator, ABC):
    """One equation of a system: the measured side and the nominal model's prediction.

    Parameters
    ----------
    effects : sequence of (str, dict), default=()
        Effects that the nominal equation gets: names, with all their parameters in the units of the system.
    tolerance : mapping of str to float, optional
        How well numbers are known, relative: what a change within it explains is not a gap.
    **values : float or str
        Numbers by name, see `quantities`; those with a default may be left out.

    Attributes
    ----------
    values : dict of str to float or str
        The numbers in SI, ``"fit"`` where one is fitted to the log.
    effects : tuple of (str, dict)
        The effects.

    Raises
    ------
    MissingParameterError, UnknownParameterError, ImplausibleParameterError
        A number is missing, unknown, or out of its range.

    Examples
    --------
    >>> from pamid.systems.cylinder import Cylinder
    >>> Cylinder.kind, [i.name for i in Cylinder.signals][:2]
    ('cylinder', ['x', 'P'])
    """

    form = "algebraic"
    states_equation = True
    executes = False
    title: ClassVar[str]
    """What it is, in one line."""
    signals: ClassVar[tuple[Input, ...]]
    """Signals of its log, beside ``trajectory`` and ``time``."""
    targets: ClassVar[tuple[str, ...]]
    """Those that its equation predicts: its outputs; the others are inputs."""
    one_of: ClassVar[tuple[tuple[str, ...], ...]] = ()
    """Groups of inputs of which it needs one each."""
    quantities: ClassVar[tuple[Quantity, ...]]
    """Numbers of its simulator file."""
    choices: ClassVar[tuple[Choice, ...]] = ()
    """Words of its simulator file."""
    law: ClassVar[str]
    """Nominal equation, in words of the signals."""
    sense: str | int = "auto"
    library = "actuator"

    def __init__(
        self, *, effects: Sequence[EffectLike] = (), tolerance: Mapping[str, float] | None = None, **values: Any
    ) -> None:
        entries: list[Quantity | Choice] = [*self.quantities, *self.choices]
        known = [q.name for q in entries]
        refuse_others(values, known, f"[{self.kind}] has", f"only {', '.join(known) or 'nothing'}", REMOVE, spelt=repr)
        if lacking := [q.name for q in self.quantities if q.default is None and q.name not in values]:
            raise MissingParameterError(
                f"[{self.kind}] lacks {', '.join(lacking)}.",
                ", ".join(f"{q.name} ({q.meaning}, {q.unit})" for q in self.quantities if q.name in lacking),
                "Add what is missing.",
            )
        self._given = {q.name: q.checked(values.get(q.name, q.default), self.kind) for q in entries}
        super().__init__(
            [Port(s.name, "output" if s.name in self.targets else "input", s.unit.split(",")[0]) for s in self.signals]
        )
        sure = tolerance or {}
        self.parameters = {
            q.name: ModelParameter(v, sure.get(q.name, 0.0), q.unit)
            for q in self.quantities
            if not isinstance(v := self._given[q.name], str)
        }
        refuse_others(sure, self.parameters, "[tolerance] has", "given numbers", REMOVE, spelt=repr)
        self.effects = tuple(EffectSpec.of(entry, in_units=True) for entry in effects)

    @classmethod
    def own(cls, signals: Collection[str]) -> list[str]:
        """Return the numbers that only the owner of a system knows, where its log has some signals."""
        return [q.name for q in cls.quantities if q.default is None]

    @property
    def values(self) -> dict[str, float | str]:
        """Numbers in SI and words, as given or as a fit has changed them."""
        return self._given | {name: p.value for name, p in self.parameters.items()}

    def own_numbers(self) -> dict[str, ModelParameter]:
        """Return the numbers of the page, zero where they are fitted to the log."""
        return {q.name: ModelParameter(0.0, unit=q.unit) for q in self.quantities} | self.parameters

    def plausible(self, name: str) -> tuple[float, float]:
        """Return the plausible range of a number."""
        return next((q.lower, q.upper) for q in self.quantities if q.name == name)

    def identity(self) -> dict[str, Any]:
        """Return the identity of the system: kind, numbers and effects, as plain data."""
        return {
            "name": self.kind,
            "kind": self.kind,
            "numbers": self.values,
            "tolerance": self.tolerance,
            "effects": [[spec.name, dict(spec.values)] for spec in self.effects],
        }

    def number(self, name: str) -> float:
        """Return a number that is given."""
        return float(self.values[name])

    def with_(
        self,
        parameters: Mapping[str, Any] | None = None,
        effects: Sequence[Any] | None = None,
        between: Sequence[Any] | None = None,
    ) -> System:
        """Return the system with other numbers and words, or other effects."""
        both: list[Quantity | Choice] = [*self.quantities, *self.choices]
        entries = {q.name: q for q in both}
        refuse_others(parameters or {}, entries, f"[{self.kind}] has no", remedy="Correct it.")
        given = {name: entries[name].checked(value, self.kind) for name, value in (parameters or {}).items()}
        out, own = copy(self), self.own_numbers()
        out._given = self._given | given
        out.parameters = self.parameters | {
            name: replace(own[name], value=value)
            for name, value in given.items()
            if name in own and not isinstance(value, str)
        }
        if effects is not None:
            out.effects = tuple(EffectSpec.of(entry, in_units=True) for entry in effects)
        return out

    def require(self, log: pd.DataFrame) -> None:
        """Raise a `MissingColumnError` if a log lacks a signal that the system needs."""
        lacking = [i for i in self.signals if i.needed and i.name not in log.columns]
        if lacking:
            has = ", ".join(str(c) for c in log.columns[:20])
            raise MissingColumnError(
                f"The log lacks {', '.join(f'{i.name} ({i.meaning})' for i in lacking)}; it has {has}.",
                f"the signals of a {self.kind}: {', '.join(i.name for i in self.signals if i.needed)}",
                "Map your columns to these names ('pamid init' writes the mapping).",
            )

    @property
    def units(self) -> dict[str, str]:
        """Units of target, position and pressure, as `pamid.estimators.GapDiagnoser` takes them; empty for SI."""
        return {}

    own_ports = AnySimulator.own_ports
    write_corrected = AnySimulator.write_corrected

    def where(self, log: pd.DataFrame, rows: np.ndarray) -> pd.DataFrame:
        """Return a log in which only some rows count."""
        return log.assign(**{COUNTS: rows})

    def counting(self, logs: Mapping[str, pd.DataFrame], rows: np.ndarray) -> dict[str, pd.DataFrame]:
        """Return a log in which only some rows count; raise for several."""
        return {n: self.where(log, rows) for n, log in logs.items()} if len(logs) == 1 else super().counting(logs, rows)

    def pieces(self, logs: Iterable[pd.DataFrame]) -> list[pd.DataFrame]:
        """Return a log as a whole, since some numbers may be fitted to it."""
        return [pd.concat(logs, ignore_index=True)]

    def spoken(self, log: pd.DataFrame, columns: Mapping[str, str]) -> dict[str, str]:
        """Return the names in its equation of the state that effects read."""
        read = self.problem(log).X
        return {k: column for k, column in columns.items() if column in read}

    def fitted_to(self, logs: Mapping[str, pd.DataFrame]) -> Simulator:
        """Return it with the numbers that are fitted to logs, shared by all of them."""
        runs = (log.assign(trajectory=[f"{name}: {run}" for run in log["trajectory"]]) for name, log in logs.items())
        return self.problem(self.pieces(runs)[0]).fitted or self

    def unit_of(self, columns: Collection[str]) -> str:
        """Return the unit of the target on a log with some columns."""
        return self.units.get("target", "N")

    def corrected(self, effects: Sequence[EffectLike], sense: int, unit: str) -> System:
        """Return the system with further effects, which act in a sense, 1 or -1, on a target in a unit."""
        return self.with_(effects=[*self.effects, *effects])

    def to_toml(self, path: str | Path) -> None:
        """Write the simulator file of the system, whole or not at all."""
        from ..gap.residuals.units import Units

        units, text = Units(**self.units), self.text(self.values)
        if self.tolerance:
            text += "\n".join(["", "[tolerance]", *(f"{name} = {x:g}" for name, x in self.tolerance.items()), ""])
        for spec in self.effects:
            text += "\n".join(["", *spec.lines(units.of), ""])
        write_whole(Path(path), text)

    @classmethod
    def text(cls, values: Mapping[str, Any], assumed: Collection[str] = ()) -> str:
        """Return the commented simulator file of such a system, with numbers in SI; `assumed` ones are marked."""
        lines = [
            f"# Simulator: {cls.title}.",
            f"# Nominal equation: {cls.law}",
            '# SI units; text with a unit, such as "25 mm", is accepted, too. Pressures are absolute.',
            f'kind = "{cls.kind}"',
            "",
            f"[{cls.kind}]",
        ]
        for q in cls.quantities:
            value = values.get(q.name, q.default)
            shown = f'"{FIT}"' if value == FIT else f"{float(value):g}" if value is not None else '"?"'
            unit = f"{q.unit}: " if q.unit != "-" else ""
            fit = '; "fit": fitted to the log' if q.may_fit else ""
            mark = "  ASSUMED: replace it by yours" if q.name in assumed else ""
            lines.append(f"{q.name} = {shown}  # {unit}{q.meaning}{fit}{mark}")
        lines += [
            f'{c.name} = "{values.get(c.name, c.default)}"  # {c.meaning}: {", ".join(c.options)}' for c in cls.choices
        ]
        return "\n".join(lines) + "\n"

    def problem(self, log: pd.DataFrame) -> Problem:
        """Return the measured and the modelled side, its effects included, and the signals that effects may follow.

        Rows with missing values are left out; a column `pamid.simulators.problem.COUNTS` says which rows count. A log
        without a row raises an `EmptyLogError`.
        """
        known = log[["time", *(s.name for s in self.signals if s.name in log.columns)]].notna().all(axis=1).to_numpy()
        share, log = known.mean() if len(known) else 1.0, log[known].reset_index(drop=True)
        if log.empty:
            raise EmptyLogError(
                f"No row holds all signals of a {self.kind} that the log has columns for.",
                "rows in which each of them was read",
                "Run 'pamid check' to see which column is empty, and leave it out.",
            )
        problem = self.nominal_problem(log)
        if share < 1.0:
            problem.notes.append(f"{100 * (1 - share):.1f} % of the rows have a missing value and are left out.")
        if COUNTS in log.columns:
            counts = log[COUNTS].to_numpy(dtype=bool, na_value=True)
            problem.notes.append(f"Only rows that meet the condition are used: {100 * counts.mean():.0f} % of all.")
            problem = problem._replace(counts=counts[problem.X.index])
        if not self.effects:
            return problem
        from .correction import WithEffects

        sense = self.sense if isinstance(self.sense, int) else 1
        return problem._replace(nominal=WithEffects(problem, self.effects, sense))

    def doubts(self, log: pd.DataFrame) -> list[str]:
        """Return doubts about units and pressure reference, from force, pressure and size of a log."""
        from .reference import doubts

        return doubts(log, self)

    @abstractmethod
    def nominal_problem(self, log: pd.DataFrame) -> Problem:
        """Return the measured side, the modelled one without effects, and the signals that effects may follow."""


def with_rates(log: pd.DataFrame, columns: Mapping[str, str]) -> pd.DataFrame:
    """Return time and signals with their rates, taken within each run."""
    from ..signals import differentiate

    X = log[["time", *columns]].copy()
    for signal, rate in columns.items():
        parts = []
        for _, run in log.groupby("trajectory", sort=False):
            y, t = run[signal].to_numpy(dtype=float), run["time"].to_numpy(dtype=float)
            parts.append(differentiate(y, t, warn=False)[1] if len(run) > 10 else np.zeros(len(run)))
        X[rate] = np.concatenate(parts)
    return X
