"""The first draft of a mapping and a page for a log that nobody has described yet."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import ColumnTypeError, MappingError, UnknownOptionError
from ..signals.formats import RawTable, format_of
from ..signals.guess import Guess, guess_columns, guess_kind, with_unit
from ..signals.log import MAX_BYTES, find_logs
from ..signals.mapping import LogMapping, SignalMapping
from ..signals.mapping_text import mapping_text
from ..signals.units import UNITS, parse_quantity
from . import all_systems
from .base import Input
from .bench_page import BENCH_INPUTS, OWN, bench_text
from .file import system_text

if TYPE_CHECKING:
    import pandas as pd

_TYPICAL = {"rest_length": 0.2, "rest_diameter": 0.02, "bore": 0.025}
_JUMP = 20.0  # sampling intervals: a step of time this long within the first rows is the recorder, not the run
_FIRST = 0.02


def kinds() -> list[str]:
    """Return the kinds that a draft can be made for."""
    return ["bench", *all_systems()]


@dataclass
class Draft:
    """What is known so far.

    Parameters
    ----------
    paths : list of Path
        The log files.
    table : RawTable
        The first of their tables, as it stands in the file.
    kind : str
        What the log is of; empty where that is not known yet.
    guesses : list of Guess
        What each column probably is.
    settings : dict
        Settings of the mapping beside its signals.
    numbers : dict of str to float or str
        Numbers of the page that were given.
    constants : dict of str to str
        Constants of the mapping, such as ``rest_length``.
    """

    paths: list[Path]
    table: RawTable
    kind: str
    guesses: list[Guess]
    settings: dict[str, Any] = field(default_factory=dict)
    numbers: dict[str, Any] = field(default_factory=dict)
    constants: dict[str, str] = field(default_factory=dict)

    # --- signals --------------------------------------------------------------------------------------------
    def inputs(self) -> tuple[Input, ...]:
        """Return the signals of its kind, time first."""
        own = BENCH_INPUTS if self.kind == "bench" else all_systems()[self.kind].inputs if self.kind else ()
        return (Input("time", "s", "time"), *own)

    def of(self, signal: str) -> Guess | None:
        """Return the column that a signal comes from."""
        return next((g for g in self.guesses if g.signal == signal), None)

    def lacking(self) -> list[Input]:
        """Return the signals that its kind needs and no column is known for."""
        fixed = set(self.constants) | ({"eps"} if {"length", "rest_length"} <= set(self.constants) else set())
        return [i for i in self.inputs() if i.needed and self.of(i.name) is None and i.name not in fixed]

    def assign(self, signal: str, column: str, unit: str = "", reference: str = "", scale: float = 1.0) -> None:
        """Say which column a signal comes from.

        Parameters
        ----------
        signal : str
            Name in the tidy log; ``length`` and ``shortening`` stand for ``eps``.
        column : str
            Name, or position from 0.
        unit : str, default=""
            Its unit; guessed from the values by default.
        reference : str, default=""
            ``"gauge"`` or ``"absolute"`` for a pressure.
        scale : float, default=1.0
            Factor on the raw value.

        Raises
        ------
        MappingError, UnitError
            There is no such column, or the unit is unknown or of another dimension.
        """
        source = "value"
        if signal in ("length", "shortening"):
            signal, source = "eps", signal
        position = self._position(column, signal)
        self._clear(signal)
        if position is None:  # a number beside the entries of a JSON log
            head = self.table.head[column]
            self.guesses.append(
                Guess(column, signal, unit or None, scale=scale, low=float(head), high=float(head), why="given")
            )
            return
        gauge = {"gauge": True, "absolute": False}.get(reference)
        name: str | int = str(self.table.frame.columns[position]) if self.table.named else position
        told = Guess(name, signal, unit or None, gauge, source, scale, why="given")
        SignalMapping.from_value(signal, told.settings())
        guess = with_unit(told, self.table.frame.iloc[:, position])
        if scale != 1.0 and not unit:  # a calibration that ends in SI
            guess = replace(guess, unit=None, scale=scale, sure=True)
        if gauge is not None:
            guess = replace(guess, gauge=gauge, sure=guess.sure or bool(unit))
        if unit and UNITS[unit].dimension != "pressure":
            guess = replace(guess, sure=True)
        self.guesses[position] = guess

    def _position(self, column: str, signal: str) -> int | None:
        names = [str(c) for c in self.table.frame.columns]
        if self.table.named and column in names:
            return names.index(column)
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
        self.guesses = [replace(g, signal="") if g.signal == signal else g for g in self.guesses]

    def settle(self) -> None:
        """Leave out what its kind does not know, and note what only its kind can say."""
        if not self.kind:
            return
        wanted = {i.name for i in self.inputs()} | {"trajectory"}
        self.guesses = [replace(g, signal="") if g.signal and g.signal not in wanted else g for g in self.guesses]
        if (eps := self.of("eps")) is not None and eps.source != "value":
            rest = self.constants.setdefault("rest_length", str(self.numbers.get("rest_length", "")))
            if not rest:
                self.constants["rest_length"] = f"{_TYPICAL['rest_length']} m"

    # --- the files ------------------------------------------------------------------------------------------
    def mapping(self) -> dict[str, Any]:
        """Return the mapping as `read_log` takes it."""
        signals = {g.signal: g.settings() for g in self.guesses if g.signal and g.signal != "trajectory"}
        settings = dict(self.settings)
        if (run := self.of("trajectory")) is not None:
            settings["trajectory"] = run.column
        return {"signals": signals, **settings, **({"constants": dict(self.constants)} if self.constants else {})}

    def columns_text(self) -> str:
        """Return the mapping file."""
        meaning = {i.name: i.meaning for i in self.inputs()}
        comments = {g.signal: _comment(g, meaning.get(g.signal, "")) for g in self.guesses if g.signal}
        unused = [f"{g.column}: {g.low:.4g} to {g.high:.4g}" for g in self.guesses if not g.signal]
        unused += [f"beside the samples: {k} = {v}" for k, v in list(self.table.head.items())[:20]]
        whole = self.mapping()
        title = f"Columns of {self.paths[0].name}" + (f" and {len(self.paths) - 1} more" if self.paths[1:] else "")
        return mapping_text(
            whole["signals"], {k: v for k, v in whole.items() if k != "signals"}, comments, unused, title
        )

    def assumed(self) -> tuple[str, ...]:
        """Return the numbers of the page that nobody has given and nobody else can know."""
        if self.kind == "bench":
            return tuple(name for name in OWN if name not in self.numbers)
        known = {i.name for i in self.inputs() if self.of(i.name) is not None} | set(self.constants)
        return tuple(name for name in all_systems()[self.kind].own(known) if name not in self.numbers)

    def page_text(self) -> str:
        """Return the simulator file; what nobody has given is marked in it."""
        if self.kind == "bench":
            from ..bench.parameters import BenchParameters

            given = {k: v if k == "name" else parse_quantity(v, k) for k, v in self.numbers.items()}
            return bench_text(BenchParameters.for_muscle("B").replace(**{"name": "my muscle", **given}), self.assumed())
        cls = all_systems()[self.kind]
        values = {**{name: _TYPICAL[name] for name in self.assumed() if name in _TYPICAL}, **self.numbers}
        return system_text(cls, cls(**values).values, self.assumed())


def draft_for(paths: str | Path | Sequence[str | Path], kind: str = "") -> Draft:
    """Look at logs and propose a mapping.

    Parameters
    ----------
    paths : path-like or sequence of them
        Logs of one kind, as for `pamid.read_log`.
    kind : str, default=""
        ``"bench"``, ``"muscle"``, ``"cylinder"``, ``"joint"``; guessed from the columns by default.

    Returns
    -------
    Draft
        The proposal.

    Raises
    ------
    LogError
        The log cannot be read at all.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> import pandas as pd
    >>> from pamid.systems import draft_for
    >>> log = pd.DataFrame({"t [s]": [0.0, 0.1, 0.2], "p [bar]": [3.0, 3.1, 3.2], "x [mm]": [180, 179, 178]})
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     log.to_csv(Path(folder) / "log.csv", index=False)
    ...     len(draft_for(Path(folder) / "log.csv").guesses)
    3
    """
    if kind and kind not in kinds():
        raise UnknownOptionError(f"There is no kind {kind!r}.", f"one of {', '.join(kinds())}", "Correct it.")
    files = find_logs(paths)
    settings: dict[str, Any] = {}
    table, tables = _first_table(files[0], settings)
    if len(tables) > 1:
        settings |= _variables(tables)
    guesses = guess_columns(table.frame, table.named, kind)
    kind = kind or guess_kind({g.signal for g in guesses})
    guesses = guess_columns(table.frame, table.named, kind)
    draft = Draft(files, table, kind, guesses, settings)
    clock = draft.of("time")
    if clock is not None and (skip := _jump(table.frame, clock)):
        settings["skip_rows"] = skip
    if isinstance(table.head.get("trajectory"), str):
        settings["name"] = "{trajectory}-{stem}"
    return draft


def _first_table(path: Path, settings: dict[str, Any]) -> tuple[RawTable, list[RawTable]]:
    """Read the first file; thousands points are tried where the numbers look like it."""
    mapping = LogMapping()
    try:
        tables, _ = format_of(path).read(path, mapping, MAX_BYTES)
    except ColumnTypeError as error:
        mark = "." if "thousands = '.'" in error.remedy else "," if "thousands = ','" in error.remedy else ""
        if not mark:
            raise
        settings["thousands"] = mark
        tables, _ = format_of(path).read(path, replace(mapping, thousands=mark), MAX_BYTES)
    largest = max(tables, key=lambda t: t.frame.shape[1])
    return largest if largest.frame.shape[1] > tables[0].frame.shape[1] else _not_zero(tables), tables


def _not_zero(tables: list[RawTable]) -> RawTable:
    return next((t for t in tables if not _is_zero_run(t)), tables[0])


def _is_zero_run(table: RawTable) -> bool:
    return any(word in (table.variable or "").lower() for word in ("offset", "zero", "tare"))


def _variables(tables: list[RawTable]) -> dict[str, Any]:
    """Return settings that take the variables of one file as runs."""
    names = [str(t.variable) for t in tables if t.variable and not _is_zero_run(t)]
    if len(names) < 2:
        return {"trajectories": names[0]} if names else {}
    head, tail = _shared(names), _shared([n[::-1] for n in names])[::-1]
    found: dict[str, Any] = {"trajectories": f"{head}*{tail[: max(0, min(map(len, names)) - len(head))]}"}
    if zero := next((str(t.variable) for t in tables if _is_zero_run(t)), ""):
        found["zero_run"] = zero
    return found


def _shared(names: Sequence[str]) -> str:
    """Return the letters that all names begin with."""
    n = next((k for k, letters in enumerate(zip(*names, strict=False)) if len(set(letters)) > 1), min(map(len, names)))
    return names[0][:n]


def _jump(frame: pd.DataFrame, clock: Guess) -> int:
    """Return the rows before a jump of time at the very start, where a recorder has not begun to record."""
    column = frame.iloc[:, clock.column] if isinstance(clock.column, int) else frame[clock.column]
    try:
        time = column.to_numpy(dtype=float)
    except (TypeError, ValueError):
        return 0
    steps = np.diff(time)
    usual = float(np.median(steps)) if len(steps) else 0.0
    early = steps[: max(3, int(_FIRST * len(steps)))]
    jumps = np.flatnonzero((early > _JUMP * usual) & (usual > 0))
    return int(jumps[-1]) + 1 if len(jumps) else 0


def _comment(guess: Guess, meaning: str) -> str:
    said = [meaning or guess.signal]
    if guess.why == "its name" and not guess.sure:
        said.append("unit or reference ASSUMED: check it")
    elif not guess.sure:
        said.append("ASSUMED: check it")
    if guess.high == guess.high:
        said.append(f"raw {guess.low:.4g} to {guess.high:.4g}")
    return "; ".join(said)


def given_numbers(pairs: Mapping[str, str], kind: str) -> dict[str, Any]:
    """Return numbers of a page, checked one by one.

    Parameters
    ----------
    pairs : mapping of str to str
        Names and values as a person writes them (``"25 mm"``).
    kind : str
        Kind of the page.

    Returns
    -------
    dict
        The numbers in SI.
    """
    if kind == "bench":
        from ..bench.parameters import NUMBERS, BenchParameters

        found: dict[str, Any] = {}
        for name, value in pairs.items():
            if name not in NUMBERS and name != "name":
                raise UnknownOptionError(
                    f"{name!r} is no number of the bench.", f"one of {', '.join(NUMBERS)}", "Correct the name."
                )
            found[name] = value if name == "name" else parse_quantity(value, name)
        BenchParameters.for_muscle("B").replace(**found)
        return found
    known = {q.name: q for q in all_systems()[kind].numbers}
    for name in pairs:
        if name not in known:
            raise UnknownOptionError(
                f"{name!r} is no number of a {kind}.", f"one of {', '.join(known)}", "Correct the name."
            )
    return {name: known[name].checked(value, kind) for name, value in pairs.items()}
