"""The first page of a MuJoCo model or an FMU, and the mapping of the log that it is held against."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ..simulators import Port, Simulator
    from ..systems.draft import Draft

_ROLES = {
    "input": {
        "cmd",
        "command",
        "commanded",
        "des",
        "desired",
        "ref",
        "reference",
        "target",
        "ctrl",
        "setpoint",
        "goal",
    },
    "speed": {"dq", "qd", "qvel", "vel", "velocity", "speed", "omega", "rate"},
    "place": {"q", "qpos", "pos", "position", "angle", "theta", "encoder"},
}
"""What logs call a command, a speed and a position; the first that a name says is what it is."""


def declare_model(draft: Draft, simulator: Simulator) -> None:
    """Give a draft the signals of a model: its inputs, readings and states."""
    from ..systems.base import Input

    draft.ports = tuple(Input(p.name, _plain(p.unit), p.kind, needed=False) for p in _signals(simulator))
    draft.runs_code = simulator.executes


def columns_of(draft: Draft, simulator: Simulator) -> dict[str, str]:
    """Return the column that each port of a model probably is, those that were given among them."""
    found = {g.signal: str(g.column) for g in draft.guesses if g.signal not in ("", "time", "trajectory")}
    for port in _signals(simulator):
        taken = {*found.values(), *(str(g.column) for g in draft.guesses if g.signal in ("time", "trajectory"))}
        if port.name not in found and draft.table.named:
            free = [str(g.column) for g in draft.guesses if str(g.column) not in taken]
            if column := _likeliest(port, free, _signals(simulator)):
                found[port.name] = column
    return found


def is_plain(draft: Draft) -> bool:
    """Tell whether a page alone can say what the columns of a log are: its clock and runs need no mapping."""
    clock, run = draft.of("time"), draft.of("trajectory")
    ticks = clock is not None and clock.settings() in ({"column": "time"}, {"column": "time", "unit": "s"})
    given = any(g.why == "given" and g.signal for g in draft.guesses)
    return ticks and not given and (run is None or run.column == "trajectory")


def model_page(simulator: Simulator, columns: Mapping[str, str], folder: Path, mapped: bool) -> str:
    """Return the first draft of the page of a model: its ports and numbers.

    Parameters
    ----------
    simulator : Simulator
        The model; nothing of it runs.
    columns : mapping of str to str
        Column by port, as guessed or given.
    folder : Path
        Where the page will lie.
    mapped : bool
        Whether a mapping beside it says the columns.
    """
    from dataclasses import replace

    from ..simulators import page_text

    named = {p: c for p, c in columns.items() if c != p and not mapped}
    simulator.ports = tuple(replace(p, column=named.get(p.name, "")) for p in simulator.ports)
    simulator.parameters = simulator.own_numbers()
    unknown = {p.name for p in _signals(simulator)} - set(columns)
    lines = page_text(simulator, folder).splitlines()
    for k, line in enumerate(lines):
        name = line.partition(" =")[0]
        if name in named:
            lines[k] += "  # ASSUMED: replace the column or confirm it"
        elif name in unknown:
            lines[k] += '  # add column = "..." if the log has it'
        elif line == "[parameters]":
            lines[k] += "  # a tolerance of 0 holds a number fixed: say how well you know each"
    return "\n".join(lines) + "\n"


def _signals(simulator: Simulator) -> list[Port]:
    """Return the ports that a log may have a column of."""
    hidden = {p.through for p in simulator.ports if p.through}
    return [p for p in simulator.ports if p.kind in ("input", "output", "state") and p.name not in hidden]


def _plain(unit: str) -> str:
    return "" if unit == "-" else unit


def _likeliest(port: Port, columns: list[str], ports: Sequence[Port]) -> str:
    """Return the column whose name is nearest to a port's and says nothing else; empty where none is near."""
    import difflib

    wanted, role = _letters(port.name), _role_of(port)
    others = {"input"} if role == "output" else _ROLES.keys() - {role}  # a reading may be of any motion
    plain = {_letters(_bare(c)): c for c in columns if _said(c) not in others}
    if wanted in plain:
        return plain[wanted]
    stem = _letters(port.name.removesuffix("_dq").removesuffix("_q").removesuffix("_ctrl"))
    own = [c for letters, c in plain.items() if stem in letters and _said(c)]
    alone = [c for c in plain.values() if _said(c)] if sum(_role_of(p) == role for p in ports) == 1 else []
    inside = [c for letters, c in plain.items() if len(letters) > 1 and (letters in wanted or wanted in letters)]
    for found in (own, inside, alone):
        if len(found) == 1:
            return found[0]
    if close := difflib.get_close_matches(wanted, plain, n=1, cutoff=0.75):
        return plain[close[0]]
    # A unit tells where no other port and no other column has one of its kind.
    kind = _dimension(port.unit)
    alike = [c for c in plain.values() if kind and _dimension(_unit(c)) == kind]
    return alike[0] if len(alike) == 1 and sum(_dimension(p.unit) == kind for p in ports) == 1 else ""


def _role_of(port: Port) -> str:
    """Return the role in which a log writes a port down."""
    return port.kind if port.kind != "state" else "speed" if port.name.endswith("_dq") else "place"


def _said(column: str) -> str:
    """Return the role that a column's name says; empty where it says none."""
    words = re.findall("[a-z]+", _bare(column))
    return next((role for role, known in _ROLES.items() if any(w in known for w in words)), "")


def _bare(column: str) -> str:
    """Return the words of a column's name in small letters, without its unit."""
    from ..signals.headers import read_header

    return " ".join(read_header(column).words)


def _unit(column: str) -> str:
    from ..signals.headers import read_header

    return read_header(column).unit or ""


def _dimension(unit: str) -> str:
    """Return the dimension of a unit; empty where it is not known."""
    from ..signals.unit_names import unit_name
    from ..signals.units import UNITS

    found = unit_name(unit) if unit else None
    return UNITS[found].dimension if found else ""


def _letters(name: str) -> str:
    return "".join(c for c in name.lower() if c.isalnum())
