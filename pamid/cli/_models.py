"""The first simulator file of a MuJoCo model or an FMU, and the mapping of the log that it is compared with."""

import contextlib
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from ..errors import PamidError
from ..signals._tidy import for_port, numbers_of, sampling_period, to_si
from ..signals.headers import read_header
from ..signals.mapping import SignalMapping
from ..signals.unit_names import parse_quantity
from ..signals.units import UNITS
from ..simulators import Port, Simulator, page_text
from ..simulators.absent import closest
from ..simulators.likeness import dimension
from ..simulators.matching import Match, matches
from ..simulators.motion import rate_between
from ..systems.base import Input
from ..systems.draft import Draft


def declare_model(draft: Draft, simulator: Simulator) -> None:
    """Give a draft the signals of a model: its inputs, readings and states."""
    draft.ports = tuple(Input(p.source, _plain(p.unit), p.kind, needed=False) for p in _signals(simulator))
    draft.runs_code = simulator.executes
    headers = [str(g.column) for g in draft.guesses]
    for port in _signals(simulator):  # a simulator file may say the column itself, with its unit or without
        if port.column and (column := _header(port.column, headers)):
            unit = _last_word(port, column)
            draft.assign(port.column, column, unit)
            if unit and unit != draft.unit_of(port.column):
                draft.suppose(port.column, f"ASSUMED: in {unit}, as its header says")


def by_source(simulator: Simulator, pair: str) -> str:
    """Return a ``SIGNAL=...`` of the command line with the column that a simulator file names for this port, if any."""
    name, equals, rest = pair.partition("=")
    sources = {p.name: p.source for p in _signals(simulator)}
    name = name.strip()
    return f"{name if name in sources.values() else sources.get(name, name)}{equals}{rest}"


def _header(name: str, headers: Sequence[str]) -> str:
    """Return the header that a simulator file names, as written or without its unit; empty where there is none."""
    alike = [h for h in headers if for_port(h, {name: ""})[0] == name]
    return name if name in headers else alike[0] if len(alike) == 1 else ""


def _last_word(port: Port, column: str) -> str:
    """Return the unit in the last word of a column whose name is not the port's own, if it is one beyond doubt."""
    header = read_header(column)
    known = header.unit if header.clear and not header.bracketed and column != port.name else None
    return known if known and UNITS[known].dimension == dimension(port.unit) else ""


def columns_of(draft: Draft, simulator: Simulator) -> tuple[list[Match], dict[str, str]]:
    """Return the probable column of each port beside the given ones, and the doubts."""
    said = {g.signal: (str(g.column), g.unit or "") for g in draft.guesses if g.signal}
    ports = _signals(simulator)
    given = {p.name: said[p.source] for p in ports if p.source in said}
    t, frame = first_run(draft)
    found, doubts = matches(simulator, ports, frame, t, given)
    open_ = [p for p in ports if p.column and p.name not in given and p.name not in {m.port for m in found}]
    headers = [str(g.column) for g in draft.guesses if g.signal not in said]
    lost = {p.name: f"the log lacks {p.column}" for p in open_ if closest(p.column, headers, ports)}
    return found, {**lost, **doubts}


def first_run(draft: Draft) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Return the times of the first run, s, and its columns of numbers, clock and names of runs aside."""

    def numbers(column: str | int) -> np.ndarray | None:
        try:
            return np.asarray(draft.table.frame[column].to_numpy(dtype=float, na_value=np.nan))
        except (KeyError, TypeError, ValueError):
            return None

    if not draft.table.named:
        return np.zeros(0), {}
    named = [g.column for g in draft.guesses if g.signal not in ("time", "trajectory")]
    found = {str(name): x for name in named if (x := numbers(name)) is not None and x.ndim == 1}
    period, frame = draft.settings.get("sampling_period"), draft.table.frame
    known, _ = sampling_period(draft.table, parse_quantity(period, "time") if period else None)
    t = np.arange(len(frame)) * (known or 1.0)
    if (clock := draft.of("time")) is not None:
        with contextlib.suppress(PamidError):  # reported where the log is read
            how = SignalMapping.from_value("time", clock.settings())
            t = to_si(numbers_of(frame[clock.column], "time", draft.paths[0]), "time", how, {}, 0.0, draft.paths[0])
    ends = np.flatnonzero(np.diff(t) <= 0.0)
    end = int(ends[0]) + 1 if len(ends) else len(t)
    return t[:end], {name: x[:end] for name, x in found.items()}


def take(draft: Draft, simulator: Simulator, found: Sequence[Match], doubts: Mapping[str, str]) -> None:
    """Assign to a draft what was found; what is guessed is marked in its files."""
    sources = {p.name: p.source for p in _signals(simulator)}
    for match in found:
        signal, named = sources[match.port], simulator.port(match.port).column
        draft.assign(signal, match.column, match.unit)
        why = match.why or (f"the log lacks {named}, which the simulator file names" if named else "")
        draft.suppose(signal, f"ASSUMED: {why}" if why else "")
    for port, doubt in doubts.items():
        if draft.of(sources[port]) is not None:
            draft.suppose(sources[port], f"ASSUMED, DOUBTFUL: {doubt}")
    for p in _signals(simulator):
        unit, guess = _as_logged(draft, p), draft.of(p.source)
        if p.source not in draft.supposed and unit and guess is not None and UNITS[unit][1:3] != (1.0, 0.0):
            draft.suppose(p.source, f"ASSUMED: in {unit}, as in the log, since the port has no unit")


def _as_logged(draft: Draft, port: Port) -> str:
    """Return the unit in a header whose values are taken as they stand, for a port without a unit."""
    guess = draft.of(port.source)
    if _plain(port.unit) or guess is None or guess.unit or guess.scale != 1.0:
        return ""
    header = read_header(str(guess.column))
    return header.unit or "" if header.clear else ""


def join(draft: Draft, simulator: Simulator, found: Sequence[Match]) -> str:
    """Declare the joint of an FMU where samples and units tell one, so that friction can be tested there; its name."""
    t, frame = first_run(draft)
    said = {g.signal: str(g.column) for g in draft.guesses if g.signal} | {m.port: m.column for m in found}
    if simulator.kind != "fmu" or any(p.kind == "joint" for p in simulator.ports):
        return ""
    kinds = {p.name: (p.kind, dimension(p.unit)) for p in simulator.ports}
    inputs = [n for n, (kind, _) in kinds.items() if kind == "input"]
    for position, rate, force in (("angle", "angular rate", "torque"), ("length", "speed", "force")):
        acting = [n for n in inputs if kinds[n][1] == force]
        acting = [n for n in acting if n not in said] or acting  # what is not logged may stand for a load
        acting = acting or (inputs if len(inputs) == 1 else [])  # the only drive acts where friction does, or before it
        moving = [v for v, of_v in kinds.items() if of_v == ("output", rate) and v in said]
        pairs = [
            (q, v)
            for q, of_q in kinds.items()
            for v in moving
            if of_q == ("output", position) and q in said and rate_between(t, frame[said[q]], frame[said[v]])[0] > 0.9
        ] or [("", v) for v in moving]
        if len(acting) == 1 == len(pairs):
            (q, v), through = pairs[0], acting[0]
            unit = simulator.port(through).unit
            joint = Port(f"joint_of_{q or v}", "joint", unit, position=q, velocity=v, through=through)
            simulator.ports = (*simulator.ports, joint)
            return joint.name
    return ""


def lacking(simulator: Simulator, columns: Mapping[str, str], doubts: Mapping[str, str]) -> list[str]:
    """Return the data missing for a comparison of log and simulator, and the option that gives it."""
    signals = _signals(simulator)
    wanted = [p for p in signals if p.kind == "input" and p.start is None and p.name not in columns]
    acting = {p.through for p in simulator.ports if p.through}
    if any(p.kind == "input" and p.name in columns for p in signals):
        wanted = [p for p in wanted if p.name not in acting]  # none by itself, as a disturbance is
    read = sorted((p for p in signals if p.kind != "input"), key=lambda p: p.kind == "state")  # outputs first
    wanted += [] if any(p.name in columns for p in read) else read[:1]
    return [
        f"no column is known for {p.source}{f' ({doubts[p.name]})' if p.name in doubts else ''}: add "
        f"--signal {p.source}=COLUMN{f':{p.unit}' if _plain(p.unit) else ''}"
        + (f", or --constant {p.source}=VALUE if it is constant" if p.kind == "input" else "")
        for p in wanted
    ]


def without_column(draft: Draft, simulator: Simulator, doubts: Mapping[str, str]) -> str:
    """Return which ports have no column although one is named like them, and why; empty where there is none."""
    open_ = {p.source: doubts[p.name] for p in _signals(simulator) if p.name in doubts and draft.of(p.source) is None}
    return "; ".join(
        f"{port} has no column: {why}. If one fits, name it with its unit or factor: --signal "
        f"'{port}=COLUMN:UNIT' or '{port}=COLUMN*FACTOR'"
        for port, why in open_.items()
    )


def with_units(draft: Draft, simulator: Simulator) -> None:
    """Give the ports of a python-control system, which has no units, those of their columns."""
    if simulator.kind != "control":
        return
    units = {
        p.name: (guess.unit or _as_logged(draft, p) if (guess := draft.of(p.source)) else "")
        for p in _signals(simulator)
    }
    simulator.ports = tuple(replace(p, unit=units.get(p.name) or "-") if p.unit == "-" else p for p in simulator.ports)
    draft.ports = tuple(Input(p.source, _plain(p.unit), p.kind, needed=False) for p in _signals(simulator))


def is_plain(draft: Draft, found: Sequence[Match] = ()) -> bool:
    """Return whether a simulator file alone describes the columns of a log: its clock and runs need no mapping."""
    clock, run = draft.of("time"), draft.of("trajectory")
    said = clock is not None and (clock.sure or not clock.unit)  # an assumed unit is to be seen
    ticks = said and clock is not None and clock.settings() in ({"column": "time"}, {"column": "time", "unit": "s"})
    given = any(g.why == "given" and g.signal for g in draft.guesses)
    converted = any(m.unit and m.unit != (draft.unit_of(m.port) or m.unit) for m in found)
    converted |= any(read_header(m.column).bracketed for m in found)  # a log without a mapping loses the brackets
    marked = any(m.named and m.why for m in found)
    return ticks and not given and not converted and not marked and (run is None or run.column == "trajectory")


def model_page(simulator: Simulator, columns: Mapping[str, str], folder: Path, mapped: bool) -> str:
    """Return the first draft of the simulator file of a model: its ports and numbers."""
    named = {p: c for p, c in columns.items() if c != p and not mapped}
    simulator.ports = tuple(replace(p, column=named.get(p.name, "")) for p in simulator.ports)
    simulator.parameters = simulator.own_numbers()
    unknown = {p.name for p in _signals(simulator)} - set(columns)
    begun = _begun(simulator, columns)
    simulator.ports = (*simulator.ports, *begun)
    lines = page_text(simulator, folder).splitlines()
    for k, line in enumerate(lines):
        name = line.partition(" =")[0]
        if name in named:
            lines[k] += "  # ASSUMED: replace the column or confirm it"
        elif name in unknown:
            lines[k] += '  # add column = "..." if the log has it'
        elif name in {p.name for p in begun}:
            lines[k] += "  # each run begins at its own value, which is fitted"
        elif name.startswith("joint_of_"):
            lines[k] += "  # ASSUMED, by units and samples: friction is tested here"
        elif line == "[parameters]":
            lines[k] += "  # a tolerance of 0 holds a number fixed: say how well you know each"
    return "\n".join(lines) + "\n"


def _begun(simulator: Simulator, columns: Mapping[str, str]) -> list[Port]:
    """Return the FMU states at which each run begins, where a reading shows the value and its rate; else none."""
    found = simulator.own_states()
    return found if len(found) <= 2 * sum(p.kind == "output" and p.name in columns for p in simulator.ports) else []


def _signals(simulator: Simulator) -> list[Port]:
    """Return the ports that a log may have a column of; not torques beside MuJoCo's actuators, nor hidden states."""
    hidden = {p.through for p in simulator.ports if p.through and not p.column and simulator.kind == "mujoco"}
    hidden |= set(simulator.hidden_states)
    return [p for p in simulator.ports if p.kind in ("input", "output", "state") and p.name not in hidden]


def _plain(unit: str) -> str:
    return "" if unit == "-" else unit
