"""Simulator files: TOML with a simulator's kind, its ports, its numbers and the effects that are part of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from functools import cache
from inspect import isabstract
from pathlib import Path
from typing import Any

from .._discovery import subclasses
from .._plugins import left_out, plugins
from ..errors import (
    MissingParameterError,
    OversizedSimulatorError,
    ParameterError,
    SimulatorFileError,
    SimulatorNotFoundError,
    SimulatorSyntaxError,
    UnknownOptionError,
    UntrustedCodeError,
)
from ..names import REMOVE, refuse_others
from ..toml_files import TomlErrors, read_toml
from .base import Simulator
from .between import place_name, read_between
from .ports import ModelParameter, Port

_ERRORS = TomlErrors(SimulatorNotFoundError, OversizedSimulatorError, SimulatorSyntaxError)
_FITTING = {
    "input": ("input",), "output": ("state", "output"), "joint": ("joint", "state", "output"),
    "encoder": ("joint", "state", "output"), "chamber": ("chamber", "state", "output"), "parameter": ("parameter",),
}  # fmt: skip
"""Ports at which the effects of a kind can act; a state or output may be a joint or chamber that nobody declared."""
_TABLES = ("ports", "parameters", "between", "effects")
MODELS = (".xml", ".fmu")
"""Endings of models that are read without a page."""
_PORT = {f.name: f.type for f in fields(Port)}
_NOT_KINDS = {"fmu_wrapper"}
"""It holds no kind, and imports all that writes C code."""


def bare_model(path: Path, trust: bool = False) -> Simulator:
    """Return a model without a simulator file: its ports stand in columns of their own names."""
    from .fmu_model import FmuSimulator
    from .mujoco_model import MujocoSimulator

    return FmuSimulator(path, trust=trust) if path.suffix.lower() == ".fmu" else MujocoSimulator(path)


@cache
def simulator_kinds() -> dict[str, type[Simulator]]:
    """Return the kinds of simulators that a simulator file may name, with their classes."""
    found = {kind: cls for cls in subclasses("pamid.simulators", Simulator, _NOT_KINDS) for kind in cls.kinds}
    expected = "a complete subclass of pamid.simulators.Simulator with its own kinds"
    for source, thing in plugins("pamid.simulators", expected):
        whole = isinstance(thing, type) and issubclass(thing, Simulator) and not isabstract(thing)
        if whole and thing.kinds and not set(thing.kinds) & set(found):
            found |= dict.fromkeys(thing.kinds, thing)
        else:
            left_out(source, repr(thing), expected)
    return dict(sorted(found.items()))


def page_signals(path: str | Path) -> dict[str, str]:
    """Return the columns of signals in a simulator file, with units, without running anything that it names."""
    ports = read_toml(path, "a simulator file", _ERRORS).get("ports", {})
    entries = ports.items() if isinstance(ports, dict) else ()
    signals = {n: p for n, p in entries if isinstance(p, dict) and p.get("kind") in ("input", "output", "state")}
    return {str(p.get("column") or name): str(p.get("unit", "-")) for name, p in signals.items()}


def read_simulator(path: str | Path, *, trust: bool = False) -> Simulator:
    """Read the simulator file of a simulator, or a model itself. Nothing runs code from a file without trust.

    Parameters
    ----------
    path : path-like
        TOML file with ``kind``, a table of that name, ``[ports]``, and if wanted ``[parameters]``, ``[[effects]]``; or
        a MuJoCo model (``.xml``) or an FMU (``.fmu``), with the simulator file of the same name beside it if there is
        one.
    trust : bool, default=False
        Whether the code that the simulator file names (a Python function, an FMU) may run.

    Returns
    -------
    Simulator
        What it says.

    Raises
    ------
    UntrustedCodeError
        It names code, and ``trust`` is False.
    SimulatorFileError, ParameterError
        The simulator file is missing, not valid TOML, or contains something invalid.

    Examples
    --------
    >>> import tempfile, pathlib
    >>> from pamid.simulators import read_simulator
    >>> page = '''
    ... kind = "function"
    ... [function]
    ... function = "piston.py:force"
    ... [ports]
    ... P = { kind = "input", unit = "Pa" }
    ... F = { kind = "output", unit = "N" }
    ... [parameters]
    ... area = { value = 5e-4, tolerance = 0.02, unit = "m^2" }
    ... '''
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     code = "def force(u, p): return u.P * p.area"
    ...     _ = (pathlib.Path(folder) / "piston.py").write_text(code)
    ...     _ = (pathlib.Path(folder) / "sim.toml").write_text(page)
    ...     read_simulator(pathlib.Path(folder) / "sim.toml", trust=True).outputs
    ('F',)
    """
    path = Path(path)
    if path.suffix.lower() in MODELS:
        page = path.with_suffix(".toml")
        return read_simulator(page, trust=trust) if page.is_file() else bare_model(path, trust)
    raw = read_toml(path, "a simulator file", _ERRORS)
    kind, known = raw.get("kind"), simulator_kinds()
    if kind not in known:
        raise UnknownOptionError(f"{path} is of the kind {kind!r}.", f"one of {', '.join(known)}", "Correct kind.")
    tables = f"kind, [{kind}], [ports], [parameters], [[between]], [[effects]]"
    refuse_others(raw, ("kind", kind, *_TABLES), f"{path} has", tables, REMOVE, spelt=repr)
    try:
        table = _table(raw, kind)
        ports = [_port(name, given) for name, given in _table(raw, "ports").items()]
        numbers = {name: _number(name, given) for name, given in _table(raw, "parameters").items()}
        effects, between = _effects(raw.get("effects", [])), read_between(raw.get("between", []))
        if known[kind].executes and not trust:
            raise UntrustedCodeError(
                f"{path} names code to run: {', '.join(str(v) for v in table.values() if isinstance(v, str))}.",
                "your permission to run it",
                "Read that code, then add --trust (in Python: trust=True).",
            )
        made = known[kind].from_page(kind, table, ports, numbers, effects, path.parent)
        _refuse_misplaced(made)
        return made.with_(between=between) if between else made
    except (SimulatorFileError, ParameterError) as error:
        raise type(error)(f"{path}: {error.found}", error.expected, error.remedy) from None


def read_outline(path: str | Path) -> Simulator:
    """Read the ports of a simulator file without running anything that it names."""
    raw = read_toml(path, "a simulator file", _ERRORS)
    known = simulator_kinds().get(raw.get("kind", ""))
    if known is None or not known.executes:
        return read_simulator(path)
    try:
        ports = [_port(name, given) for name, given in _table(raw, "ports").items()]
        outline = Simulator(ports)
    except (SimulatorFileError, ParameterError) as error:
        raise type(error)(f"{path}: {error.found}", error.expected, error.remedy) from None
    if not outline.inputs and not outline.states and not outline.outputs:
        return read_simulator(path)
    return outline


def _table(raw: Mapping[str, Any], name: str) -> dict[str, Any]:
    table = raw.get(name, {})
    if not isinstance(table, dict):
        raise SimulatorSyntaxError(f"{name} is {table!r}.", "a table", f"Write [{name}].")
    return table


def _port(name: str, given: Any) -> Port:
    if not isinstance(given, dict) or "kind" not in given:
        raise SimulatorSyntaxError(
            f"The port {name} is {given!r}.", 'a table such as { kind = "input", unit = "V" }', "Write its kind."
        )
    refuse_others(given, _PORT, f"The port {name} has", f"only {', '.join(list(_PORT)[1:])}")
    texts = {k: v for k, v in given.items() if k != "start" and not isinstance(v, str)}
    if texts:
        raise SimulatorSyntaxError(
            f"{next(iter(texts))} of the port {name} is not text.", "text in quotes", "Quote it."
        )
    return Port(name, **given)


def _number(name: str, given: Any) -> ModelParameter:
    if isinstance(given, dict):
        refuse_others(given, ("value", "tolerance", "unit"), f"The parameter {name} has", "value, tolerance, unit")
        if "value" not in given:
            raise MissingParameterError(f"The parameter {name} has no value.", "a number", "Add value = ...")
        return ModelParameter(**given)
    return ModelParameter(given)


def _effects(given: Any) -> list[tuple[str, str, dict[str, float]]]:
    from .catalogue import port_effects

    if not isinstance(given, list) or not all(isinstance(e, dict) for e in given):
        raise SimulatorSyntaxError("effects is not a list of tables.", "[[effects]]", "Write one [[effects]] each.")
    found = []
    for e in given:
        values = {k: v for k, v in e.items() if k not in ("effect", "at")}
        name, where, known = e.get("effect"), place_name(e.get("at")), port_effects()
        if name not in known:
            raise UnknownOptionError(f"[[effects]] has {name!r}.", f"one of {', '.join(known)}", "Correct effect.")
        if where is None:
            raise MissingParameterError(
                f"The effect {name} has no port.", 'at = "PORT", or at = ["A", "B"] between two', "Say where it acts."
            )
        parameters = [p.name for p in known[name][1].parameters]
        refuse_others(values, parameters, f"The effect {name} has no", remedy="Correct it.")
        if wrong := [k for k, v in values.items() if isinstance(v, bool) or not isinstance(v, (int, float))]:
            raise SimulatorSyntaxError(f"{wrong[0]} of the effect {name} is not a number.", "a number", "Correct it.")
        found.append((name, where, {k: float(v) for k, v in values.items()}))
    return found


def _refuse_misplaced(simulator: Simulator) -> None:
    """Raise where an effect is at a port of a kind at which it never acts."""
    from .catalogue import port_effects

    kinds = {p.name: p.kind for p in simulator.ports} | dict.fromkeys(simulator.parameters, "parameter")
    for name, where, _ in simulator.effects:
        kind, known = kinds.get(where), port_effects()
        fit = _FITTING.get(known[name][0] if name in known else "", ())
        if kind is not None and fit and kind not in fit:
            there = [n for n, k in kinds.items() if k in fit]
            raise UnknownOptionError(
                f"The effect {name} is at {where!r}, a port of the kind {kind}.",
                f"one of {', '.join(there)}" if there else f"a port of the kind {' or '.join(fit)}",
                "Correct 'at' under [[effects]].",
            )


def page_text(simulator: Simulator, folder: str | Path = ".") -> str:
    """Return the simulator file of a simulator, which `read_simulator` reads.

    Parameters
    ----------
    simulator : Simulator
        The simulator.
    folder : path-like, default="."
        Where the simulator file will lie: files are named from there.

    Returns
    -------
    str
        TOML.

    Raises
    ------
    ParameterError
        It was made in Python from something that has no name, such as a lambda.

    Examples
    --------
    >>> import math
    >>> from pamid.simulators import FunctionSimulator, Port, page_text
    >>> ports = [Port("u", "input", "V"), Port("y", "output", "N")]
    >>> print(page_text(FunctionSimulator(math.hypot, ports, form="algebraic")).splitlines()[-1])
    y = { kind = "output", unit = "N" }
    """
    return simulator.page_text(Path(folder))
