"""Read and write simulator files: TOML in, a checked `BenchParameters` out, and back."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from ..errors import (
    MissingParameterError,
    OversizedSimulatorError,
    SimulatorFileError,
    SimulatorNotFoundError,
    SimulatorSyntaxError,
    SimulatorTypeError,
)
from ..names import REMOVE, refuse_others
from ..toml_files import TomlErrors, read_toml, toml_value

if TYPE_CHECKING:
    from ..effects import EffectSpec

ERRORS = TomlErrors(SimulatorNotFoundError, OversizedSimulatorError, SimulatorSyntaxError)

T = TypeVar("T")


def _table(cls: type, name: str, raw: Any) -> Any:
    if not isinstance(raw, dict):
        raise SimulatorTypeError(f"{name} is {raw!r}.", "a table", f"Write [{name}] with one parameter a line.")
    known = [f.name for f in dataclasses.fields(cls)]
    refuse_others(raw, known, f"[{name}] has", remedy=REMOVE, spelt=repr)
    if missing := [key for key in known if key not in raw]:
        raise MissingParameterError(
            f"[{name}] lacks {', '.join(missing)}.", f"all of {', '.join(known)}", "Add what is missing."
        )
    return cls(**raw)


def read_simulator_file(made: Callable[..., T], classes: Mapping[str, type], path: Path) -> T:
    """Return what is made of the tables, tolerances and effects of a file, naming the file in every error."""
    from ..effects.spec import specs_of

    raw = read_toml(path, "a simulator file", ERRORS)
    try:
        if raw.get("kind") == "bench":
            del raw["kind"]
        known = [*classes, "tolerance", "effects"]
        refuse_others(raw, known, "There is", remedy=REMOVE, spelt=repr)
        if missing := [name for name in classes if name not in raw]:
            raise MissingParameterError(
                f"The tables {', '.join(missing)} are missing.", f"all of {', '.join(classes)}", "Add what is missing."
            )
        tables = {name: _table(table, name, raw[name]) for name, table in classes.items()}
        return made(**tables, tolerance=raw.get("tolerance", {}), effects=tuple(specs_of(raw.get("effects", []))))
    except SimulatorFileError as error:
        raise type(error)(f"{path}: {error.found}", error.expected, error.remedy) from None


def _number(value: float) -> str:
    return repr(float(value))


def _line(name: str, value: str, comment: str) -> str:
    return f"{name} = {value}  # {comment}" if comment else f"{name} = {value}"


def simulator_text(tables: Mapping[str, Any], tolerance: Mapping[str, float], effects: Iterable[EffectSpec]) -> str:
    """Return tables, each a record of numbers, tolerances and effects as the text of a simulator file."""
    lines = ["# Simulator of the bench: SI units, absolute pressures.", 'kind = "bench"', ""]
    for table, held in tables.items():
        lines.append(f"[{table}]")
        for f in dataclasses.fields(held):
            value = getattr(held, f.name)
            if "unit" in f.metadata:
                comment = ", ".join(part for part in (f.metadata["unit"], f.metadata["comment"]) if part)
                lines.append(_line(f.name, _number(value), comment))
            else:
                lines.append(_line(f.name, toml_value(value), ""))
        lines.append("")
    if tolerance:
        lines.append("[tolerance]  # relative: how well each is known; a value within it is no gap")
        lines += [f"{name} = {_number(value)}" for name, value in tolerance.items()]
        lines.append("")
    for spec in effects:
        lines += [*spec.lines(), ""]
    return "\n".join(lines).rstrip() + "\n"
