"""The simulator file of a system: a TOML file with its kind and its numbers."""

from pathlib import Path

from ..bench.simulator_file import ERRORS
from ..effects.spec import specs_of
from ..errors import (
    SimulatorFileError,
    SimulatorSyntaxError,
    SimulatorTypeError,
    UnknownOptionError,
)
from ..names import REMOVE, refuse_others
from ..simulators.page import simulator_kinds
from ..toml_files import read_toml
from .base import System


def kind_of_file(path: str | Path) -> str:
    """Return the kind of system that a simulator file describes; "bench" where it names none or cannot be read."""
    try:
        kind = read_toml(path, "a simulator file", ERRORS).get("kind", "bench")
    except SimulatorFileError:
        return "bench"
    if not isinstance(kind, str):
        raise SimulatorTypeError(f"{path}: kind is {kind!r}.", "text", 'Put it in quotes: kind = "bench".')
    return kind


def read_system(path: str | Path) -> System:
    """Read the simulator file of a system.

    Parameters
    ----------
    path : path-like
        TOML file with ``kind = "cylinder"`` and a table ``[cylinder]``; numbers are in SI, or text with a unit.

    Returns
    -------
    System
        What it says, checked.

    Raises
    ------
    SimulatorFileError
        The file is missing, no TOML, lacks something, or holds something unknown or implausible.

    Examples
    --------
    >>> import tempfile, pathlib
    >>> from pamid.systems import read_system
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = pathlib.Path(folder) / "sim.toml"
    ...     _ = file.write_text('kind = "cylinder"' + chr(10) + "[cylinder]" + chr(10) + 'bore = "25 mm"')
    ...     read_system(file).values["bore"]
    0.025
    """
    from . import all_systems

    path = Path(path)
    raw = read_toml(path, "a simulator file", ERRORS)
    kind, known = raw.get("kind"), all_systems()
    if kind not in known:
        ported = ", ".join(simulator_kinds())
        raise UnknownOptionError(
            f"{path} is of the kind {kind!r}.",
            f"a system: bench, {', '.join(known)}; or a simulator with ports: {ported}",
            "Correct kind in the file, and the name of its table.",
        )
    named = ("kind", kind, "effects", "tolerance")
    refuse_others(raw, named, f"{path} has", f"kind, [{kind}], [tolerance] and [[effects]]", REMOVE, spelt=repr)
    for name in (kind, "tolerance"):
        if not isinstance(table := raw.get(name, {}), dict):
            raise SimulatorSyntaxError(f"{path}: {name} is {table!r}.", "a table", f"Write [{name}].")
    try:
        return known[kind](
            **raw.get(kind, {}), effects=specs_of(raw.get("effects", [])), tolerance=raw.get("tolerance", {})
        )
    except SimulatorFileError as error:
        raise type(error)(f"{path}: {error.found}", error.expected, error.remedy) from None
