"""How a log's own columns become signals in SI: names, units, references, constants, filters."""

import difflib
import fnmatch
import math
import types
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from numbers import Integral, Real
from pathlib import Path
from typing import Annotated, Any, Self, get_args, get_origin, get_type_hints

from pamid.constants import ATMOSPHERIC_PRESSURE
from pamid.errors import LogNotFoundError, MappingError, UnitError

from ..explained import explained_fields
from ..names import require_one_of
from ..toml_files import TomlErrors, read_toml
from .formats._encoding import is_encoding
from .unit_names import find_unit, parse_quantity
from .units import Unit, dimension_of, is_gauge_name

_ERRORS = TomlErrors(LogNotFoundError, MappingError, MappingError)
_ORDERS = ("raise", "sort", "split")
_DUPLICATES = ("drop", "mean", "raise", "keep")


@explained_fields
@dataclass(frozen=True)
class SignalMapping:
    """One signal: where it is in the log and how it is converted to SI.

    The value is ``unit(sign · scale · (raw + offset))``, then made absolute where it is gauge pressure.

    Examples
    --------
    >>> from pamid.signals import SignalMapping
    >>> SignalMapping(column=1, unit="kPa", gauge=True).unit
    'kPa'
    """

    column: Annotated[
        str | int | None, "Name or position (from 0) of the source column; None: the signal's own name."
    ] = None
    unit: Annotated[
        str | None, 'Unit of the source, such as ``"kPa"`` or ``"L/min ANR"`` (see `pamid.signals.UNITS`); None: SI.'
    ] = None
    gauge: Annotated[
        bool | None,
        "For pressures: whether the source is gauge pressure. It is then made absolute with the ambient pressure, "
        "unless the signal's name (``p``, ``p_gauge``) keeps it gauge. None: what the unit (``barg``) or else the "
        "name says.",
    ] = None
    scale: Annotated[float, "Factor on the raw value, before the unit; a calibration such as kPa per ADC step."] = 1.0
    offset: Annotated[float, "Added to the raw value, before scale and unit."] = 0.0
    sign: Annotated[int, "1 or -1: turns the direction."] = 1
    offset_after: Annotated[float, "Added after scale, still in the unit: the intercept of a calibration line."] = 0.0
    subtract_zero_run: Annotated[
        bool, "Whether to subtract the mean of this column in the zero run (see `LogMapping.zero_run`)."
    ] = False
    source: Annotated[
        str,
        '``"value"``, or for ``eps``: ``"length"`` (the column is the muscle\'s length L, ε = (L₀ - L)/L₀) or '
        '``"shortening"`` (the column is L₀ - L). Both need the constant ``rest_length``.',
    ] = "value"
    allowed: Annotated[
        tuple[float, ...] | None, "Values that the raw column may take; rows with others are corrupt and left out."
    ] = None
    range: Annotated[tuple[float, float] | None, "Range of the raw column; rows outside are corrupt and left out."] = (
        None
    )
    check: Annotated[bool, "Whether the values must look like their unit; False overrides the check."] = True
    own: Annotated[
        bool, "Whether the name is a simulator's own and says nothing of the unit, such as ``u`` for a force."
    ] = False

    @classmethod
    def from_value(cls, signal: str, value: Any, own: bool = False) -> Self:
        """Build from a column's name or position, or from a table of settings, and check.

        The name of the signal serves messages and the check of its unit; with ``own`` a unit of another quantity than
        the name's is a sign that the name is a simulator's own.
        """
        if isinstance(value, cls):
            mapping = value
        elif isinstance(value, str | int) and not isinstance(value, bool):
            mapping = cls(column=value)
        elif isinstance(value, Mapping):
            _require_known(value, [f.name for f in fields(cls)], f"the signal {signal}")
            settings = dict(value)
            for key in ("allowed", "range"):
                if settings.get(key) is not None:
                    settings[key] = tuple(
                        _number(v, f"{signal}.{key}") for v in _sequence(settings[key], f"{signal}.{key}")
                    )
            mapping = cls(**settings)
        else:
            raise MappingError(
                f"The mapping of the signal {signal} is {value!r}.",
                "a column's name or position, or a table such as {column = 1, unit = 'kPa', gauge = true}",
                "Correct the mapping.",
            )
        if own and isinstance(mapping.unit, str) and mapping.dimension(signal) is not None:
            mapping = replace(mapping, own=find_unit(mapping.unit).dimension != mapping.dimension(signal))
        mapping.validate(signal)
        return mapping

    def validate(self, signal: str) -> None:
        """Raise if settings of a signal contradict each other."""
        _require_kinds(self, f"{signal}.")
        unit = self.si_unit(signal)
        known = self.dimension(signal)
        pressure = unit.dimension == "pressure" if unit else known == "pressure"
        if self.gauge is not None and not pressure and known is not None:
            raise MappingError(f"gauge is given for {signal}.", "gauge for pressures only", "Remove it.")
        if unit is not None and unit.gauge is not None and self.gauge not in (None, unit.gauge):
            raise MappingError(
                f"{signal} has the unit '{self.unit}' and gauge = {str(self.gauge).lower()}.",
                "the two to agree",
                "Remove one of them.",
            )
        if self.source not in ("value", "length", "shortening"):
            raise MappingError(
                f"{signal}.source is {self.source!r}.", "'value', 'length' or 'shortening'", "Correct it."
            )
        if self.sign not in (1, -1):
            raise MappingError(f"{signal}.sign is {self.sign!r}.", "1 or -1", "Use scale for other factors.")
        if self.range is not None and (len(self.range) != 2 or not self.range[0] <= self.range[1]):
            raise MappingError(f"{signal}.range is {list(self.range)}.", "[lowest, highest]", "Correct it.")

    def si_unit(self, signal: str) -> Unit | None:
        """Return the unit, checked against the signal's quantity; None where none is given: the source is SI."""
        if self.unit is None:
            return None
        if self.own:
            return find_unit(self.unit)
        return find_unit(self.unit, signal if self.source == "value" else "length")

    def dimension(self, signal: str) -> str | None:
        """Return the physical dimension of the source column; None if the signal's name does not show it."""
        if self.own:
            return None
        return dimension_of(signal) if self.source == "value" else "length"

    def is_gauge(self, signal: str) -> bool:
        """Return whether the source is gauge pressure: by `gauge`, else the unit, else the signal's name."""
        unit = self.si_unit(signal)
        if self.gauge is not None:
            return self.gauge
        if unit is not None and unit.gauge is not None:
            return unit.gauge
        return is_gauge_name(signal)


@dataclass(frozen=True)
class FileConstants:
    """Constants of the files whose name matches a pattern.

    Parameters
    ----------
    match : str
        Pattern over the file's name and over its trailing path, such as ``"*kinked25*"``; upper and lower case differ.
    constants : mapping of str to float or str
        Signals or ``rest_length``, ``length`` fixed in these files; SI or text with a unit (``"17.45 cm"``).

    Examples
    --------
    >>> from pamid.signals import FileConstants
    >>> FileConstants("*25.mat", {"eps": 0.04}).matches("data/kinked25.mat")
    True
    """

    match: str
    constants: Mapping[str, float | str]

    def matches(self, path: str | Path) -> bool:
        """Return whether a file's name, or its whole path after some folder, matches the pattern."""
        name = Path(path).as_posix()
        return fnmatch.fnmatchcase(Path(path).name, self.match) or fnmatch.fnmatchcase(name, f"*/{self.match}")


@dataclass(frozen=True)
class LogMapping:
    """How logs of one kind become tidy frames in SI: the argument `mapping` of `read_log`.

    Parameters
    ----------
    signals : mapping of str to SignalMapping
        Signals by their name in the frame (``time``, ``P``, ``F``, ``eps``, ``q``, ...). Empty: the log's own names.
    trajectory : str, int or None
        Name or position of a column that names each row's run; None: ``trajectory`` where there is one.
    trajectories : str or None
        Pattern over the variables of a MATLAB or HDF5 file, each of which is a run (``"Test*Data"``).
    zero_run : str or None
        Variable of a MATLAB or HDF5 file that holds a zero run, for `SignalMapping.subtract_zero_run`.
    entries : str or None
        Key of the list of entries in a JSON file; None: found automatically.
    name : str or None
        Template of a run's name with ``{stem}``, ``{variable}``, ``{run}`` and, for JSON, the numbers and
        texts beside the entries (``"{run}-kp{kp}"``).
    constants : mapping of str to float or str
        Constants of every file: signals (``eps``), or ``rest_length``, ``length`` from which ``eps`` follows.
    files : tuple of FileConstants
        Constants of files by pattern; a later match overrides an earlier one.
    ambient_pressure : float
        Pressure that gauge pressures are relative to, Pa, absolute.
    sampling_period : float or None
        Time between rows, s, for logs without a time column.
    skip_rows : int
        Rows to leave out at the start of every run.
    time_order : {"raise", "sort", "split"}
        Where time goes back: an error, sorting, or the start of a new run.
    duplicates : {"drop", "mean", "raise", "keep"}
        Rows with the same time as the row before: the first stays, their mean, an error, or all stay. With drop and
        mean, more than 5 % of a run's rows is an error: such a clock is too coarse.
    delimiter, decimal, thousands : str or None
        Of text files; None: found automatically (thousands: none).
    header : bool or None
        Whether a text file's first row names the columns; None: found automatically.
    encoding : str or None
        Of text files, such as "big5"; None: UTF-8, UTF-16, GB18030 or Latin-1, found automatically.
    keep_others : bool
        Whether to keep numeric columns that are not mapped.
    own : mapping of str to str
        Signals of a simulator of your own, each with the unit in which it wants them (empty: SI). Their unit may be of
        another quantity than the name means here, such as volts for ``u``.

    Examples
    --------
    >>> from pamid.signals import LogMapping
    >>> m = LogMapping.load({"time": {"column": 0, "unit": "ms"}, "P": {"column": 5, "unit": "bar", "gauge": True}})
    >>> m.signals["P"].unit
    'bar'
    """

    signals: Mapping[str, SignalMapping] = field(default_factory=dict)
    trajectory: str | int | None = None
    trajectories: str | None = None
    zero_run: str | None = None
    entries: str | None = None
    name: str | None = None
    constants: Mapping[str, float | str] = field(default_factory=dict)
    files: tuple[FileConstants, ...] = ()
    ambient_pressure: float = ATMOSPHERIC_PRESSURE
    sampling_period: float | None = None
    skip_rows: int = 0
    time_order: str = "raise"
    duplicates: str = "drop"
    delimiter: str | None = None
    decimal: str | None = None
    thousands: str | None = None
    header: bool | None = None
    encoding: str | None = None
    keep_others: bool = False
    own: Mapping[str, str] = field(default_factory=dict)

    @classmethod
    def load(
        cls, source: Self | Mapping[str, Any] | str | Path | None, own: Mapping[str, str] | Iterable[str] = ()
    ) -> Self:
        """Build from a dict, a TOML file, another mapping, or nothing.

        Parameters
        ----------
        source : LogMapping, mapping, str, Path or None
            A dict of the parameters above, or only of signals; or the path of a TOML file with the same keys.
        own : mapping of str to str, or iterable of str
            More signals of a simulator of your own, with or without their units.

        Returns
        -------
        LogMapping
            The checked mapping.

        Raises
        ------
        LogNotFoundError
            If the TOML file is missing.
        MappingError
            If keys are unknown or values malformed.
        UnitError
            If a unit is unknown or of another dimension than its signal.
        """
        own = dict(own) if isinstance(own, Mapping) else dict.fromkeys(own, "")
        if source is None:
            return cls(own=own)
        if isinstance(source, cls):
            return replace(source, own={**source.own, **own}) if own else source
        if isinstance(source, str | Path):
            return cls.load(read_toml(source, "a mapping file", _ERRORS), own)
        if not isinstance(source, Mapping):
            raise MappingError(
                f"mapping is a {type(source).__name__}.", "a dict or the path of a TOML file", "Pass one of them."
            )
        keys = {f.name for f in fields(cls)}
        settings = dict(source)
        if settings and not (set(settings) & keys):
            settings = {"signals": settings}
        _require_known(settings, sorted(keys), "the mapping")
        signals = dict(_table(settings.get("signals", {}), "signals"))
        _move_names(signals, settings)
        names = settings["own"] = dict.fromkeys(map(str, _sequence(settings.get("own", ()), "own")), "") | own
        settings["signals"] = {str(n): SignalMapping.from_value(str(n), v, str(n) in names) for n, v in signals.items()}
        settings["files"] = tuple(_file_constants(entry) for entry in _sequence(settings.get("files", ()), "files"))
        for name, value in _table(settings.get("constants", {}), "constants").items():
            parse_quantity(value, name)
        if "ambient_pressure" in settings:
            settings["ambient_pressure"] = parse_quantity(settings["ambient_pressure"], "P")
        if settings.get("sampling_period") is not None:
            settings["sampling_period"] = parse_quantity(settings["sampling_period"], "time")
        mapping = cls(**settings)
        mapping.validate()
        return mapping

    def validate(self) -> None:
        """Raise if an option is unknown."""
        _require_kinds(self)
        for name, mark in (("decimal", self.decimal), ("thousands", self.thousands)):
            if mark is not None and len(mark) != 1:
                raise MappingError(f"{name} is {mark!r}.", "one character", "Correct the mapping.")
        for name, value, offered in (
            ("time_order", self.time_order, _ORDERS),
            ("duplicates", self.duplicates, _DUPLICATES),
        ):
            require_one_of(value, offered, f"{name} is {value!r}.", "Correct the mapping.", MappingError)
        if self.encoding is not None and not is_encoding(self.encoding):
            raise MappingError(f"encoding is {self.encoding!r}.", "a name such as utf-8 or gb18030", "Correct it.")
        if self.skip_rows < 0:
            raise MappingError(f"skip_rows is {self.skip_rows!r}.", "a number of rows, 0 or more", "Correct it.")
        if not 3e4 < self.ambient_pressure < 2e5:
            raise UnitError(
                f"ambient_pressure is {self.ambient_pressure:.6g} Pa.",
                "the ambient pressure in Pa, between 30 000 and 200 000",
                "Give it in Pa or as text with a unit, such as '1.013 bar'.",
            )
        if self.sampling_period is not None and not self.sampling_period > 0:
            raise MappingError(f"sampling_period is {self.sampling_period}.", "a positive time in s", "Correct it.")

    @property
    def run_column(self) -> str | int:
        """Column that names the runs."""
        return "trajectory" if self.trajectory is None else self.trajectory

    def constants_of(self, path: str | Path) -> dict[str, float]:
        """Return the constants of one file, in SI: those of each matching pattern override those of every file."""
        constants = dict(self.constants)
        for entry in self.files:
            if entry.matches(path):
                constants |= entry.constants
        return {name: parse_quantity(value, name) for name, value in constants.items()}


def _move_names(signals: dict[str, Any], settings: dict[str, Any]) -> None:
    """Remove the column of run names from the signals: it is text without a unit."""
    if "trajectory" not in signals:
        return
    entry = signals.pop("trajectory")
    table = entry if isinstance(entry, Mapping) else {"column": entry}
    _require_known(table, ["column"], "the signal trajectory")
    column = table.get("column", "trajectory")
    if settings.setdefault("trajectory", column) != column:
        raise MappingError(
            f"Two columns name the runs: {settings['trajectory']!r} and {column!r}.", "one", "Remove one of them."
        )


def _file_constants(entry: Any) -> FileConstants:
    if isinstance(entry, FileConstants):
        return entry
    if not isinstance(entry, Mapping) or not isinstance(entry.get("match"), str):
        raise MappingError(
            f"An entry of files is {entry!r}.", "a table with match and constants", "Correct the mapping."
        )
    _require_known(entry, ["match", "constants"], f"the files {entry['match']}")
    constants = _table(entry.get("constants", {}), f"constants of the files {entry['match']}")
    for name, value in constants.items():
        parse_quantity(value, name)
    return FileConstants(entry["match"], dict(constants))


def _require_known(given: Mapping[str, Any], known: list[str], where: str) -> None:
    unknown = [str(k) for k in given if k not in known]
    if unknown:
        near = difflib.get_close_matches(unknown[0], known, n=1)
        raise MappingError(
            f"{where[0].upper() + where[1:]} has the unknown setting '{unknown[0]}'.",
            f"only {', '.join(known)}",
            f"Did you mean '{near[0]}'?" if near else "Remove it.",
        )


_KINDS = {
    str: "text", bool: "true or false", float: "a finite number", int: "a whole number", tuple: "a list",
    Mapping: "a table",
}  # fmt: skip
"""Names of a setting's values in a file."""


def _require_kinds(of: Any, where: str = "") -> None:
    """Raise if a setting does not have the type of its field."""
    for name, hint in get_type_hints(type(of)).items():
        value, offered = getattr(of, name), get_args(hint) if isinstance(hint, types.UnionType) else (hint,)
        kinds = [get_origin(kind) or kind for kind in offered if kind is not types.NoneType]
        if not (value is None and len(kinds) < len(offered)) and not any(_is_a(value, kind) for kind in kinds):
            raise MappingError(
                f"{where}{name} is {value!r}.", " or ".join(_KINDS[kind] for kind in kinds), "Correct the mapping."
            )


def _is_a(value: Any, kind: Any) -> bool:
    if isinstance(value, bool) or kind is bool:
        return kind is bool and isinstance(value, bool)
    if kind is float:
        return isinstance(value, Real) and math.isfinite(value)
    return isinstance(value, Integral if kind is int else kind)


def _table(value: Any, where: str) -> Mapping[str, Any]:
    if not isinstance(value, Mapping):
        raise MappingError(f"{where} is {value!r}.", "a table", "Correct the mapping.")
    return value


def _sequence(value: Any, where: str) -> Sequence[Any]:
    if isinstance(value, str) or not isinstance(value, Sequence):
        raise MappingError(f"{where} is {value!r}.", "a list", "Correct the mapping.")
    return value


def _number(value: Any, where: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise MappingError(f"{where} is {value!r}.", "a number", "Correct the mapping.")
    return float(value)
