"""Read and write simulator files: TOML in, a checked `BenchParameters` out, and back."""

import dataclasses
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any, TypeVar

from ..effects import EffectSpec
from ..effects.spec import specs_of
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

ERRORS = TomlErrors(SimulatorNotFoundError, OversizedSimulatorError, SimulatorSyntaxError)

HEAD = ("# Simulator of the bench: SI units, absolute pressures.",)
"""First lines of a simulator file."""

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
    """Build parameters from the tables, tolerances and effects of a file, naming the file in every error."""
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


def simulator_text(
    tables: Mapping[str, Any], tolerance: Mapping[str, float], effects: Iterable[EffectSpec],
    head: Sequence[str] = HEAD, meaning: Mapping[str, str] = MappingProxyType({}), assumed: Collection[str] = (),
) -> str:  # fmt: skip
    """Return tables, each a record of numbers, tolerances and effects as the text of a simulator file."""
    lines = [*head, 'kind = "bench"', ""]
    for table, held in tables.items():
        lines.append(f"[{table}]")
        for f in dataclasses.fields(held):
            said = f.metadata.get("unit", ""), meaning.get(f.name, ""), f.metadata.get("comment", "")
            value = getattr(held, f.name)
            comment = ", ".join(dict.fromkeys(part for part in said if part))
            mark = "  ASSUMED: replace it by yours" if f.name in assumed else ""
            written = _number(value) if "unit" in f.metadata else toml_value(value)
            lines.append(f"{f.name} = {written}" + (f"  # {comment}{mark}" if comment else ""))
        lines.append("")
    if tolerance:
        lines.append("[tolerance]  # relative: how well each is known; a value within it is no gap")
        lines += [f"{name} = {_number(value)}" for name, value in tolerance.items()]
        lines.append("")
    for spec in effects:
        lines += [*spec.lines(), ""]
    return "\n".join(lines).rstrip() + "\n"
