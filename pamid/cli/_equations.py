"""A simulator file for somebody's own equations, with the mapping of the log that they are compared with."""

import re
from collections.abc import Mapping

from ..errors import MissingColumnError, ParameterError, UnitError
from ..signals.headers import read_header
from ..signals.unit_names import find_unit, parse_quantity, unit_name
from ..signals.units import SI_UNITS, UNITS, dimension_of
from ..simulators import EquationSimulator, ModelParameter, Port, Simulator, page_text
from ..simulators.equation_model import names_in, sides
from ..simulators.equation_units import completed
from ..simulators.written_units import in_si
from ..systems.base import Input
from ..systems.draft import Draft, composed_unit

_TOLERANCE = re.compile(r"(?P<value>.*?)\s*(?:\+-|±)\s*(?P<percent>[\d.]+)\s*%$")

_NUMBER = re.compile(r"\s*(?P<value>[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(?P<unit>.*)$")


def split_equations(texts: list[str]) -> dict[str, str]:
    """Return right sides by left sides of the ``--equation`` options."""
    found: dict[str, str] = {}
    for text in texts:
        left, equals, right = text.partition("=")
        if not equals or not left.strip() or not right.strip():
            raise ParameterError(
                f"--equation got {text[:60]!r}.", "LEFT = RIGHT", "Write for instance --equation 'dh/dt = v'."
            )
        found[" ".join(left.split())] = " ".join(right.split())
    return found


def declare_equations(draft: Draft, equations: Mapping[str, str], numbers: Mapping[str, str]) -> None:
    """Give a draft the signals of equations: states, outputs, and what right sides name beside numbers."""
    rates, outputs = sides(equations)
    named = set().union(*(names_in(text) for text in equations.values())) - {"t"}
    if surplus := sorted(set(numbers) - named - set(rates)):
        raise ParameterError(
            f"--set gives {', '.join(surplus)}, which no equation names.",
            f"names that the equations use: {', '.join(sorted(named))}",
            "Remove it, or name it in an equation.",
        )  # fmt: skip
    draft.in_si = True
    inputs = sorted(named - set(rates) - set(numbers))
    draft.ports = (
        *(Input(name, "", "state", needed=False) for name in rates),
        *(Input(name, "", "output") for name in outputs),
        *(Input(name, "", "input") for name in inputs),
    )


def settle_equations(draft: Draft, equations: Mapping[str, str], numbers: Mapping[str, str]) -> Simulator:
    """Give a draft the columns of its signals and the simulator file of equations; return what it says."""
    rates, outputs = sides(equations)
    starts = {name: text for name, text in numbers.items() if name in rates}
    numbers = {name: text for name, text in numbers.items() if name not in rates}
    columns = {str(g.column) for g in draft.guesses} if draft.table.named else set()
    given = {g.signal for g in draft.guesses if g.why == "given"}
    for port in draft.ports:
        if port.name in columns - given:  # a column of that very name
            draft.assign(port.name, port.name)
    draft.settle()
    if lacking := [p for p in draft.lacking() if p.name != "time"]:
        first = lacking[0].name
        raise MissingColumnError(
            f"{', '.join(f'{p.name} ({p.meaning})' for p in lacking)}: in the equations, but neither a column "
            f"nor a number; the log has {', '.join(str(g.column) for g in draft.guesses[:12])}.",
            "a column for each input and output, and a number for each parameter",
            f"Add --signal {first}=COLUMN:UNIT, or --set {first}='VALUE UNIT'.",
        )
    if not any(draft.of(name) for name in (*rates, *outputs)):
        raise MissingColumnError(
            f"The log measures none of {', '.join((*rates, *outputs))}.", "at least one of them",
            f"Add --signal {next(iter((*rates, *outputs)))}=COLUMN:UNIT.",
        )  # fmt: skip
    units = {port.name: _unit_of(draft, port.name) for port in draft.ports}
    units = completed(units, rates, outputs.values())
    draft.ports = tuple(port._replace(unit=units[port.name]) for port in draft.ports)
    simulator = _simulator(draft, equations, numbers, starts)
    note = "[parameters]  # tolerance: how well each is known, 0.1 is 10 %; 0: fixed"
    draft.page = page_text(simulator).replace("[parameters]", note)
    return simulator


def _simulator(
    draft: Draft, equations: Mapping[str, str], numbers: Mapping[str, str], starts: Mapping[str, str]
) -> Simulator:
    """Return the simulator of equations; a number of a state is where it starts."""
    given = {name: _number(name, text) for name, text in starts.items()}
    ports = [
        Port(p.name, p.meaning, p.unit or (given[p.name].unit if p.name in given else "-"),
             start=given[p.name].value if p.name in given else None)
        for p in draft.ports
    ]  # fmt: skip
    return EquationSimulator(equations, ports, {name: _number(name, text) for name, text in numbers.items()})


def _unit_of(draft: Draft, name: str) -> str:
    """Return the SI unit of a signal's column, or the unit that its own name in the equations ends in."""
    column = draft.of(name)
    if column is not None and column.column == name and not column.unit and (unit := read_header(name).unit):
        return unit if read_header(name).clear or unit in SI_UNITS.values() else ""
    if column is not None and column.unit:
        return SI_UNITS[find_unit(column.unit).dimension]
    made = in_si(composed_unit(column.column)) if column is not None else None
    return made[1] if made is not None and column is not None and made[0] == column.scale else ""


def _number(name: str, text: str) -> ModelParameter:
    """Read a number with its unit and, behind ±, its relative tolerance: ``"9.81 m/s2 ± 1 %"``."""
    found = _TOLERANCE.match(text)
    value, tolerance = (found["value"], float(found["percent"]) / 100.0) if found else (text, 0.0)
    number = _NUMBER.match(value)
    unit = number["unit"].strip() if number else ""
    if unit == "C":
        raise UnitError(
            f"--set {name} is in C, which may mean degrees Celsius or coulombs.", "°C, or A s",
            "Write which of them it is.",
        )  # fmt: skip
    if number and unit not in UNITS and (made := in_si(unit)):
        return ModelParameter(float(number["value"]) * made[0], tolerance, made[1])
    known = unit_name(unit) if unit else None
    return ModelParameter(
        parse_quantity(value, None if dimension_of(name) else name),
        tolerance,
        SI_UNITS[UNITS[known].dimension] if known else "-",
    )
