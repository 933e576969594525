"""Read and write simulator files: TOML in, a checked `BenchParameters` out, and back."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from ..errors import (
    MissingParameterError,
    OversizedSimulatorError,
    SimulatorFileError,
    SimulatorNotFoundError,
    SimulatorSyntaxError,
    SimulatorTypeError,
    UnknownParameterError,
)
from ..files import write_whole
from ..toml_files import TomlErrors, read_toml, toml_value

if TYPE_CHECKING:
    from .parameters import BenchParameters

ERRORS = TomlErrors(SimulatorNotFoundError, OversizedSimulatorError, SimulatorSyntaxError)

T = TypeVar("T", bound="BenchParameters")


def _table(cls: type, name: str, raw: Any) -> Any:
    if not isinstance(raw, dict):
        raise SimulatorTypeError(f"{name} is {raw!r}.", "a table", f"Write [{name}] with one parameter a line.")
    known = [f.name for f in dataclasses.fields(cls)]
    if extra := sorted(set(raw) - set(known)):
        raise UnknownParameterError(
            f"[{name}] has {', '.join(map(repr, extra))}.", f"only {', '.join(known)}", "Remove or correct the name."
        )
    if missing := [key for key in known if key not in raw]:
        raise MissingParameterError(
            f"[{name}] lacks {', '.join(missing)}.", f"all of {', '.join(known)}", "Add what is missing."
        )
    return cls(**raw)


def read_simulator_file(cls: type[T], path: Path) -> T:
    """Read the file at ``path`` into ``cls``, naming the file in every error."""
    from ..effects.spec import specs_of
    from .parameters import TABLES

    raw = read_toml(path, "a simulator file", ERRORS)
    try:
        if raw.get("kind") == "bench":
            del raw["kind"]
        known = [*TABLES, "tolerance", "effects"]
        if extra := sorted(set(raw) - set(known)):
            raise UnknownParameterError(
                f"There is {', '.join(map(repr, extra))}.", f"only {', '.join(known)}", "Remove or correct the name."
            )
        if missing := [name for name in TABLES if name not in raw]:
            raise MissingParameterError(
                f"The tables {', '.join(missing)} are missing.", f"all of {', '.join(TABLES)}", "Add what is missing."
            )
        tables = {name: _table(table, name, raw[name]) for name, table in TABLES.items()}
        return cls(**tables, tolerance=raw.get("tolerance", {}), effects=tuple(specs_of(raw.get("effects", []))))
    except SimulatorFileError as error:
        raise type(error)(f"{path}: {error.found}", error.expected, error.remedy) from None


def _number(value: float) -> str:
    return repr(float(value))


def _line(name: str, value: str, comment: str) -> str:
    return f"{name} = {value}  # {comment}" if comment else f"{name} = {value}"


def simulator_text(params: BenchParameters) -> str:
    """Return the simulator file of ``params`` as text."""
    from .parameters import TABLES

    lines = ["# Simulator of the bench: SI units, absolute pressures.", 'kind = "bench"', ""]
    for table, cls in TABLES.items():
        lines.append(f"[{table}]")
        for f in dataclasses.fields(cls):
            value = getattr(getattr(params, table), f.name)
            if "unit" in f.metadata:
                comment = ", ".join(part for part in (f.metadata["unit"], f.metadata["comment"]) if part)
                lines.append(_line(f.name, _number(value), comment))
            else:
                lines.append(_line(f.name, toml_value(value), ""))
        lines.append("")
    if params.tolerance:
        lines.append("[tolerance]  # relative: how well each is known; a value within it is no gap")
        lines += [f"{name} = {_number(value)}" for name, value in params.tolerance.items()]
        lines.append("")
    for spec in params.effects:
        lines += [*spec.lines(), ""]
    return "\n".join(lines).rstrip() + "\n"


def write_simulator_file(params: BenchParameters, path: Path) -> None:
    """Write ``params`` to ``path``, whole or not at all."""
    write_whole(path, simulator_text(params))
