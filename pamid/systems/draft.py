"""The first draft of a mapping and a simulator file for a log that nobody has described yet."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import pandas as pd

from ..bench.parameters import NUMBERS, BenchParameters
from ..errors import MappingError, UnitError
from ..names import require_one_of
from ..signals.formats import RawTable
from ..signals.guess import Guess, guess_columns, guess_kind, with_unit
from ..signals.headers import Header, read_header
from ..signals.log import find_logs, read_log
from ..signals.mapping import LogMapping, SignalMapping
from ..signals.mapping_text import mapping_text
from ..signals.unit_names import parse_quantity, unit_name
from ..signals.units import UNITS, dimension_of
from ..simulators.dimensions import unit_powers
from ..simulators.written_units import in_si
from . import all_systems
from .base import Input
from .bench_page import BENCH_INPUTS, OWN, bench_text
from .raw import clock_settings, read_raw, run_columns
from .reference import disagreement, zero_of_force

_TYPICAL = {"rest_length": 0.2, "rest_diameter": 0.02, "bore": 0.025}
_SHARES = {name for name, unit in UNITS.items() if unit.dimension == "ratio"}
_OF_KIND = {"bore": "cylinder", "rod": "cylinder", "rest_diameter": "muscle", "gravity": "joint", "limit": "joint"}
_LITRES = re.compile(r"[\[(]\s*([lL])\s*[\])]")
"""A volume in litres, which a header of two muscles has for the left one."""
_STROKE = frozenset(("x", "stroke", "hub", "kolbenhub", "kolbenweg", "piston", "cylinder", "zylinder", "rod"))


def kinds() -> list[str]:
    """Return the kinds that a draft can be made for."""
    return ["bench", *all_systems()]


def composed_unit(column: str | int | None) -> str:
    """Return the unit in a column's name that is made of others, such as kmol/min; empty where there is none."""
    if not isinstance(column, str):
        return ""
    header, litres = read_header(column), _LITRES.search(column)
    said = header.unread or (litres[1] if litres and header.unit is None else "")
    return said if said and in_si(said) else ""


@dataclass
class Draft:
    """What is known so far."""

    paths: list[Path]
    """The log files."""
    tables: list[RawTable]
    """Their tables as they stand in the files, the one to describe columns by first."""
    kind: str
    """What the log is of; empty where that is not known yet."""
    guesses: list[Guess]
    """What each column probably is."""
    settings: dict[str, Any] = field(default_factory=dict)
    """Settings of the mapping beside its signals."""
    numbers: dict[str, Any] = field(default_factory=dict)
    """Numbers of the simulator file that were given."""
    constants: dict[str, str] = field(default_factory=dict)
    """Constants of the mapping, such as ``rest_length``."""
    file_constants: dict[str, dict[str, str]] = field(default_factory=dict)
    """Constants of the files that a pattern names."""
    ports: tuple[Input, ...] = ()
    """Signals of equations of one's own, instead of those of a kind."""
    in_si: bool = False
    """Whether ports without a unit are in SI, as in equations; else they are as the log has them."""
    page: str = ""
    """Their page."""
    runs_code: bool = False
    """Whether the simulator file names foreign code, such as an FMU."""
    supposed: dict[str, str] = field(default_factory=dict)
    """What nobody has said of a signal's column or unit, and why it is taken so."""
    own_page: Path | None = None
    """The simulator file, where the user has one: none is written."""

    @property
    def table(self) -> RawTable:
        """The table by which the columns are described."""
        return self.tables[0]

    def column(self, name: str | int) -> pd.Series:
        """Return a column of all runs, one after the other."""
        frames = [t.frame for t in self.tables]
        if isinstance(name, int):
            return pd.concat([f.iloc[:, name] for f in frames if f.shape[1] > name], ignore_index=True)
        return pd.concat([f[name] for f in frames if name in f.columns], ignore_index=True)

    def unit_of(self, signal: str) -> str:
        """Return the unit of a signal as `pamid.signals.UNITS` names it; empty where it has none that is known."""
        found = next((i.unit for i in self.inputs() if i.name == signal), "")
        return (unit_name(found) or "") if found else ""

    def suppose(self, signal: str, why: str) -> None:
        """Mark what is taken for a signal as nobody's word; an empty reason unmarks it."""
        self.supposed = {k: v for k, v in self.supposed.items() if k != signal} | ({signal: why} if why else {})
        self.guesses = [replace(g, why="found", sure=True) if g.signal == signal else g for g in self.guesses]

    @property
    def title(self) -> str:
        """What the log is of, in words."""
        return "a system of your own" if self.ports else f"a {self.kind}"

    def clear(self) -> None:
        """Forget what columns were guessed to be, clock and names of runs aside."""
        self.guesses = [
            g if g.signal in ("time", "trajectory") else replace(g, signal="", unit=None, question="")
            for g in self.guesses
        ]

    # --- signals --------------------------------------------------------------------------------------------
    def inputs(self) -> tuple[Input, ...]:
        """Return the signals of its kind, time first."""
        if self.ports:
            return (Input("time", "s", "time"), *self.ports)
        own = BENCH_INPUTS if self.kind == "bench" else all_systems()[self.kind].signals if self.kind else ()
        return (Input("time", "s", "time"), *own)

    def of(self, signal: str) -> Guess | None:
        """Return the column that a signal comes from."""
        return next((g for g in self.guesses if g.signal == signal), None)

    def fixed(self) -> set[str]:
        """Return the signals that stand still, by a constant of the mapping."""
        given = set(self.constants).union(*self.file_constants.values())
        return given | ({"eps"} if "length" in given else set())

    def lacking(self) -> list[Input]:
        """Return the signals that its kind needs and no column is known for; of alternatives the first."""
        known = self.fixed() | {g.signal for g in self.guesses if g.signal}
        if self.settings.get("sampling_period"):
            known |= {"time"}
        lacking = [i for i in self.inputs() if i.needed and i.name not in known]
        if not self.ports and self.kind and self.kind != "bench":
            by_name = {i.name: i for i in self.inputs()}
            system = all_systems()[self.kind]
            lacking += [by_name[group[0]] for group in system.one_of if not known & set(group)]
            free = [name for name in system.own(known) if name not in self.numbers and name not in _TYPICAL]
            lacking += [by_name[name] for name in free if name in by_name]  # a number without which nothing is known
        return lacking

    def assign(self, signal: str, column: str, unit: str = "", reference: str = "", scale: float = 1.0) -> None:
        """Name the column that a signal comes from."""
        self._check_dimension(signal, column, unit, scale)
        source = "value"
        if signal in ("length", "shortening"):
            share = bool(unit) and unit_name(unit) in _SHARES  # of the rest length
            source = "value" if signal == "shortening" and share else signal
            signal = "eps"
        position = self._position(column, signal)
        if signal == "trajectory" and position is not None:
            self._clear(signal)
            self.guesses[position] = replace(self.guesses[position], signal=signal, why="given", question="")
            self.settings.pop("time_order", None)
            return
        if position is None:  # a number beside the entries of a JSON log
            head = self.table.head[column]
            self._clear(signal)
            self.guesses.append(
                Guess(column, signal, unit or None, scale=scale, low=float(head), high=float(head), why="given")
            )
            return
        unit, scale = self._composed(signal, column, unit, scale)
        gauge = {"gauge": True, "absolute": False}.get(reference)
        name: str | int = str(self.table.frame.columns[position]) if self.table.named else position
        stated = unit or (self._own_unit(name, signal, source) if scale == 1.0 else "")
        told = Guess(name, signal, stated or None, gauge, source, scale, why="given", settled=gauge is not None)
        told = replace(told, own=self._is_own(signal, stated))
        SignalMapping.from_value(signal, told.settings())
        guess = with_unit(replace(told, unit=unit_name(stated) if stated else None), self.column(name))
        if scale != 1.0 and not unit:  # a calibration that ends in SI
            guess = replace(guess, unit=None, scale=scale)
        self._clear(signal)
        self.guesses[position] = replace(guess, sure=guess.sure or bool(stated) or scale != 1.0)

    def _composed(self, signal: str, column: str, unit: str, scale: float) -> tuple[str, float]:
        """Return a unit and a factor of a simulator's signal, a unit that is made of others as its factor."""
        port = next((i for i in self.ports if i.name == signal), None)
        other = port is not None and bool(port.unit) and unit_name(port.unit) is None  # such as m3/min
        said = unit
        if not said and scale == 1.0 and (self.in_si or (port is not None and port.unit)):
            said = composed_unit(column) or (read_header(column).unit or "" if other else "")
        made = in_si(said) if said and port is not None and (other or unit_name(said) is None) else None
        if made is None:
            return unit, scale
        wanted = in_si(port.unit) if port is not None and port.unit else (1.0, made[1])
        if wanted is None or unit_powers(wanted[1]) != unit_powers(made[1]):
            return unit, scale
        return "", scale * made[0] / wanted[0]

    def _check_dimension(self, signal: str, column: str, unit: str, scale: float) -> None:
        """Refuse a column in a unit of something else than the port of a simulator that it is said to be."""
        port = next((i for i in self.ports if i.name == signal), None)
        said = unit or (read_header(column).unit if scale == 1.0 and read_header(column).bracketed else "")
        found, wanted = unit_name(said) if said else None, unit_name(port.unit) if port and port.unit else None
        if found in (None, "-", "1") or wanted is None or UNITS[found].dimension == UNITS[wanted].dimension:
            return
        raise UnitError(
            f"The column {column!r} is in {found}, a {UNITS[found].dimension}; {signal} is in {wanted}.",
            f"a {UNITS[wanted].dimension}",
            f"If it is, say how many {wanted} one {found} is: --signal '{signal}={column}*FACTOR'.",
        )

    def _own_unit(self, name: str | int, signal: str, source: str) -> str:
        """Return the unit in the header of a column, where it suits the signal that the column is said to be."""
        header = read_header(name) if isinstance(name, str) else Header([])
        if self.ports and header.unit:
            return header.unit if self._may_take(signal, str(name), header) else ""
        wanted = SignalMapping(source=source).dimension(signal)
        unit = unit_name(header.unit, wanted) if header.unit else None
        return unit if unit and wanted in (None, UNITS[unit].dimension) else ""

    def _may_take(self, signal: str, column: str, header: Header) -> bool:
        """Return whether the unit in a header is that of a port's column, rather than a part of the port's name."""
        port = next((i for i in self.ports if i.name == signal), None)
        if port is None or (header.bracketed and port.unit):
            return True  # the clock, or checked already
        if not port.unit:
            return self.in_si and (header.bracketed or column != signal)
        wanted = unit_name(port.unit)
        return column != signal and wanted is not None and UNITS[wanted].dimension == UNITS[str(header.unit)].dimension

    def _is_own(self, signal: str, unit: str) -> bool:
        """Return whether a simulator uses a name for another quantity than usual, such as ``u`` for a force."""
        known, found = dimension_of(signal), unit_name(unit)
        own = signal in {port.name for port in self.ports} - {"time"}
        return own and known is not None and (found is None or UNITS[found].dimension != known)

    def _position(self, column: str, signal: str) -> int | None:
        names = [str(c) for c in self.table.frame.columns]
        if self.table.named and column in names:
            return names.index(column)
        bare = [k for k, name in enumerate(names) if (read := read_header(name)).bracketed and read.bare == column]
        if self.table.named and len(bare) == 1:
            return bare[0]
        if column.isdigit() and int(column) < len(names):
            return int(column)
        if isinstance(self.table.head.get(column), int | float):
            return None
        raise MappingError(
            f"There is no column {column!r} for {signal}.",
            f"one of {', '.join(names[:20])}" if self.table.named else f"a position from 0 to {len(names) - 1}",
            "Correct the column.",
        )

    def _clear(self, signal: str) -> None:
        self.guesses = [replace(g, signal="", question="") if g.signal == signal else g for g in self.guesses]

    def settle(self) -> None:
        """Leave out what its kind does not know, and note what only its kind can say."""
        if not (self.kind or self.ports):
            return
        wanted = {i.name for i in self.inputs()} | {"trajectory"}
        self.guesses = [
            replace(g, signal="", question="") if g.signal and g.signal not in wanted else g for g in self.guesses
        ]
        self.guesses = [self._length_or_shortening(g) for g in self.guesses]
        needs_rest = any(g.signal == "eps" and g.source != "value" for g in self.guesses)
        if needs_rest or "length" in set(self.constants).union(*self.file_constants.values()):
            rest = self.numbers.get("rest_length", _TYPICAL["rest_length"])
            self.constants.setdefault("rest_length", f"{rest} m")
        if (clock := self.of("time")) is not None:
            self._look_at_clock(clock.column)

    def _length_or_shortening(self, guess: Guess) -> Guess:
        """Return a guess of a contraction, as a length where its readings are near the muscle's."""
        rest = self.numbers.get("rest_length")
        if guess.source != "shortening" or guess.why == "given" or rest is None or guess.high != guess.high:
            return guess
        if set(read_header(str(guess.column)).words) & {"shortening", "contraction", "verkürzung", "kontraktion"}:
            return guess
        factor = UNITS[guess.unit].factor if guess.unit in UNITS else 1.0
        half = 0.5 * parse_quantity(rest, "rest_length")
        low, high = sorted((factor * guess.low * guess.scale, factor * guess.high * guess.scale))
        if low <= half or high >= 3.0 * half:
            return guess
        self.supposed[guess.signal] = "ASSUMED: a length rather than a shortening, as it is near the muscle's own"
        return replace(guess, source="length")

    def _look_at_clock(self, column: str | int) -> None:
        """Note what the clock says of the runs."""
        for table in self.tables:
            frame = table.frame
            try:
                time = (frame.iloc[:, column] if isinstance(column, int) else frame[column]).to_numpy(dtype=float)
            except (KeyError, IndexError, TypeError, ValueError):
                continue  # another table, or stamps of date and time: the reader reports what is wrong
            if self.of("trajectory") is None and (names := run_columns(frame, time)):
                self.assign("trajectory", names[0])
            found = clock_settings(time, self.of("trajectory") is None)
            self.settings |= found if table is self.table else {k: v for k, v in found.items() if k == "time_order"}

    def pressures(self) -> list[Guess]:
        """Return the columns of pressures."""
        return [g for g in self.guesses if g.is_pressure]

    def refer(self, gauge: bool, why: str, also: Sequence[Guess] = ()) -> None:
        """Say of the pressures that do not tell themselves, and of some others, whether they are gauge or absolute."""
        self.guesses = [
            replace(g, gauge=gauge, settled=True, why=why) if g.is_pressure and (not g.settled or g in also) else g
            for g in self.guesses
        ]

    def reference(self) -> bool | None:
        """Return whether the pressure is gauge, by the force that it makes; None where that does not tell."""
        wanted = self.mapping()
        entry = wanted["signals"].get("P")
        if entry is None or "F" not in wanted["signals"]:
            return None
        entry["gauge"] = False
        zero = zero_of_force(read_log(self.paths, wanted, nan="keep", sampling="ignore", check_units=False))
        return None if zero is None else zero == 0.0

    def read(self) -> pd.DataFrame:
        """Read the logs with the mapping."""
        checked = not self.ports  # typical values of muscles do not hold for other systems
        mapping = LogMapping.load(self.mapping(), {port.name: port.unit for port in self.ports})
        return read_log(self.paths, mapping, nan="keep", sampling="ignore", check_units=checked)

    def run_names(self) -> list[str]:
        """Return the columns whose values change in long stretches, as the names or numbers of runs do."""
        frame = self.table.frame
        changes = {
            str(c): int((frame[c] != frame[c].shift()).sum()) for c in frame.columns if not frame[c].isna().all()
        }
        known = {str(g.column) for g in self.guesses if g.signal}
        return [name for name, n in changes.items() if 1 < n < len(frame) / 20 and name not in known][:3]

    def doubt(self, log: pd.DataFrame) -> str:
        """Return the contradiction between force, pressure and the given numbers; empty where they agree."""
        if self.kind == "bench" or set(self.assumed()) & set(_TYPICAL):
            return ""
        return disagreement(log, all_systems()[self.kind](**self.numbers))

    # --- the files ------------------------------------------------------------------------------------------
    def mapping(self) -> dict[str, Any]:
        """Return the mapping as `read_log` takes it."""
        signals = {g.signal: g.settings() for g in self.guesses if g.signal and g.signal != "trajectory"}
        if self.settings.get("zero_run") and "F" in signals:
            signals["F"]["subtract_zero_run"] = True
        settings = dict(self.settings)
        if (run := self.of("trajectory")) is not None:
            settings["trajectory"] = run.column
        if self.file_constants:
            settings["files"] = [{"match": m, "constants": dict(c)} for m, c in self.file_constants.items()]
        return {"signals": signals, **settings, **({"constants": dict(self.constants)} if self.constants else {})}

    def columns_text(self) -> str:
        """Return the mapping file."""
        meaning = {i.name: i.meaning for i in self.inputs()}
        comments = {
            g.signal: _comment(g, meaning.get(g.signal, ""), self.supposed.get(g.signal, ""))
            for g in self.guesses
            if g.signal
        }
        unused = [f"{g.column}: {g.low:.4g} to {g.high:.4g}" for g in self.guesses if not g.signal]
        unused += [f"beside the samples: {k} = {v}" for k, v in list(self.table.head.items())[:20]]
        whole = self.mapping()
        title = f"Columns of {self.paths[0].name}" + (f" and {len(self.paths) - 1} more" if self.paths[1:] else "")
        return mapping_text(
            whole["signals"], {k: v for k, v in whole.items() if k != "signals"}, comments, unused, title
        )

    def assumed(self) -> tuple[str, ...]:
        """Return the numbers of the simulator file that nobody has given and nobody else can know."""
        if self.ports:
            return ()
        if self.kind == "bench":
            return tuple(name for name in OWN if name not in self.numbers)
        known = {i.name for i in self.inputs() if self.of(i.name) is not None} | self.fixed()
        return tuple(name for name in all_systems()[self.kind].own(known) if name not in self.numbers)

    def page_text(self) -> str:
        """Return the simulator file, with numbers that were not given marked."""
        if self.ports:
            return self.page
        if self.kind == "bench":
            given = {k: v if k == "name" else parse_quantity(v, k) for k, v in self.numbers.items()}
            return bench_text(BenchParameters.for_muscle("B").replace(**{"name": "my muscle", **given}), self.assumed())
        cls = all_systems()[self.kind]
        values = {**{name: _TYPICAL[name] for name in self.assumed() if name in _TYPICAL}, **self.numbers}
        return cls.text(cls(**values).values, self.assumed())


def draft_for(
    paths: str | Path | Sequence[str | Path], kind: str = "", numbers: Sequence[str] = (), encoding: str | None = None
) -> Draft:
    """Propose a mapping for logs of one kind; kind and encoding are found by default, `numbers` are those given."""
    if kind:
        require_one_of(kind, kinds(), f"There is no kind {kind!r}.", "Correct it.")
    files = find_logs(paths)
    settings: dict[str, Any] = {} if encoding is None else {"encoding": encoding}
    tables = read_raw(files, settings)
    table = tables[0]
    draft = Draft(files, tables, kind or _kind_of_numbers(numbers), [], settings)
    draft.guesses = guess_columns(table.frame, table.named, draft.kind, draft.column)
    if not draft.kind and (told := _told_kind(draft.guesses)):
        draft.kind = told
        draft.guesses = guess_columns(table.frame, table.named, told, draft.column)
    if isinstance(table.head.get("trajectory"), str):
        settings["name"] = "{trajectory}-{stem}"
    return draft


def _kind_of_numbers(numbers: Sequence[str]) -> str:
    """Return the kind that only has the numbers that are given."""
    kinds_ = {_OF_KIND[name] for name in numbers if name in _OF_KIND}
    return kinds_.pop() if len(kinds_) == 1 else ""


def _told_kind(guesses: Sequence[Guess]) -> str:
    """Return the kind that the columns tell; a position alone does not tell a cylinder from a muscle."""
    kind = guess_kind({g.signal for g in guesses})
    if kind != "cylinder":
        return kind
    words = {w for g in guesses if g.signal == "x" for w in read_header(str(g.column)).words}
    return kind if words & _STROKE else ""


def _comment(guess: Guess, meaning: str, supposed: str = "") -> str:
    said = [meaning or guess.signal]
    if supposed:
        said.append(supposed)
    if not guess.sure:
        said.append("unit ASSUMED: check it")
    if guess.is_pressure and guess.why not in ("its name", "given"):
        said.append(guess.why)
    if guess.high == guess.high:
        said.append(f"raw {guess.low:.4g} to {guess.high:.4g}")
    return "; ".join(said)


def given_numbers(pairs: Mapping[str, str], kind: str) -> dict[str, Any]:
    """Return numbers of a simulator file, checked one by one."""
    if kind == "bench":
        found: dict[str, Any] = {}
        for name, value in pairs.items():
            if name != "name":
                require_one_of(name, NUMBERS, f"{name!r} is not a parameter of the bench.")
            found[name] = value if name == "name" else parse_quantity(value, name)
        BenchParameters.for_muscle("B").replace(**found)
        return found
    known = {q.name: q for q in all_systems()[kind].quantities}
    for name in pairs:
        require_one_of(name, known, f"{name!r} is not a parameter of a {kind}.")
    return {name: known[name].checked(value, kind) for name, value in pairs.items()}
