"""Conditions of each of several logs: another rest position, load, temperature, supply, or day."""

import csv
import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, NamedTuple, TypeVar

from ...bench.parameters import BenchParameters
from ...errors import EmptyLogError, LogNotFoundError, MissingColumnError, ParameterError, UnknownOptionError, among
from ...explained import explained_fields
from ...simulators.base import Simulator
from ...toml_files import TomlErrors, read_small_text

S = TypeVar("S", BenchParameters, Simulator)
_ERRORS = TomlErrors(LogNotFoundError, EmptyLogError, EmptyLogError)


@explained_fields
class Conditions(NamedTuple):
    """Conditions of one log.

    Examples
    --------
    >>> from pamid.gap.several.conditions import Conditions
    >>> Conditions({"temperature": 303.0}, "friday").day  # K
    'friday'
    """

    numbers: Annotated[dict[str, float], "Numbers of the simulator, in its units, that hold for this log alone."]
    day: Annotated[str, "Logs of one day share what may change from day to day."]

    def under(self, simulator: S) -> S:
        """Return the simulator for this log."""
        return simulator.with_(self.numbers) if self.numbers else simulator


def read_conditions(path: str | Path, simulator: BenchParameters | Simulator | None = None) -> dict[str, Conditions]:
    """Read a table of conditions.

    Parameters
    ----------
    path : path-like
        A CSV file with a column ``log`` (name of the log, with or without its ending), and any of ``day`` and the
        numbers of a simulator file in SI units, such as ``temperature`` (K) or ``inertia`` (kg m²). An empty cell
        leaves the simulator's number.
    simulator : BenchParameters or Simulator, optional
        The simulator; one with ports has parameters in units of its own. By default a bench.

    Returns
    -------
    dict of str to Conditions
        By the name of the log.

    Raises
    ------
    LogNotFoundError, EmptyLogError, MissingColumnError, UnknownOptionError, ParameterError
        The table cannot be used; the message names file, row and column.

    Examples
    --------
    >>> import tempfile, pathlib
    >>> from pamid.gap.several import read_conditions
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = pathlib.Path(folder) / "conditions.csv"
    ...     _ = file.write_text(chr(10).join(["log,day,temperature", "monday,1,293", "friday,2,303"]))  # K
    ...     read_conditions(file)["friday"].numbers
    {'temperature': 303.0}
    """
    file = Path(path)
    header, *rows = _rows(file)
    if "log" not in header:
        raise MissingColumnError(
            f"{file.name} has the columns {', '.join(header)[:300]}.", "a column 'log'", "Name each row's log."
        )
    about: Any = BenchParameters.for_muscle("B") if simulator is None else simulator
    for k, name in enumerate(header):
        if name not in ("log", "day", *about.names) or name in header[:k]:
            raise UnknownOptionError(
                f"{file.name} has a column "
                f"'{name}'{', not a simulator parameter' * (name not in header[:k])}{' twice' * (name in header[:k])}.",
                *among(name, ["log", "day", *about.names], "Correct or remove it."),
            )
    found: dict[str, Conditions] = {}
    stems: set[str] = set()
    for row, fields in enumerate(rows, start=2):
        cells = dict(zip(header, fields, strict=True))
        name = cells["log"]
        if not name or Path(name).stem in stems:
            raise ParameterError(
                f"Row {row} of {file.name} names {'the log ' + name + ' again' if name else 'no log'}.",
                "each log once",
                "Correct the row.",
            )
        stems.add(Path(name).stem)
        found[name] = Conditions(_numbers(cells, file.name, row), cells.get("day", "") or name)
        found[name].under(about)  # says which number is out of its range
    return found


def _rows(file: Path) -> list[list[str]]:
    """Return the fields of each line, the header first, all of one length."""
    text = read_small_text(file, "a table of conditions", _ERRORS)
    try:
        rows = [[field.strip() for field in row] for row in csv.reader(io.StringIO(text), strict=True) if any(row)]
    except csv.Error as error:
        raise EmptyLogError(
            f"{file.name} is not a table: {error}.", "CSV with a header", "Correct the file."
        ) from error
    if not rows:
        raise EmptyLogError(f"{file.name} is empty.", "CSV with a header", "Name each row's log.")
    for number, row in enumerate(rows, start=1):
        if len(row) != len(rows[0]):
            raise ParameterError(
                f"Row {number} of {file.name} has {len(row)} fields.", f"{len(rows[0])}, as the header", "Correct it."
            )
    return rows


def _numbers(cells: Mapping[str, str], file: str, row: int) -> dict[str, float]:
    found = {}
    for name, text in cells.items():
        if name in ("log", "day") or not text:
            continue
        try:
            found[name] = float(text)
        except ValueError:
            raise ParameterError(
                f"Row {row} of {file} has {name} = {text[:60]!r}.",
                "a number in the unit of the simulator's parameter",
                "Correct the cell.",
            ) from None
    return found


def conditions_of(names: Sequence[str], table: Mapping[str, Conditions] | None) -> list[Conditions]:
    """Return the conditions of logs by their names; without a row each log is a day of its own."""
    table = dict(table or {})
    by_stem = {Path(name).stem: c for name, c in table.items()}
    stems = {Path(name).stem for name in names} | set(names)
    if strange := [name for name in table if name not in stems and Path(name).stem not in stems]:
        raise UnknownOptionError(
            f"The table of conditions names {', '.join(strange)}, which is not one of the logs.",
            f"names of {', '.join(names)}",
            "Correct the column 'log'.",
        )
    return [table.get(name) or by_stem.get(Path(name).stem) or Conditions({}, name) for name in names]
