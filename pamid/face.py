"""What every simulator can be asked, whether of a bench, of a system or with ports."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from .errors import MissingColumnError, ParameterError

if TYPE_CHECKING:
    import numpy as np
    import pandas as pd


class AnySimulator:
    """A simulator of any kind."""

    kind: ClassVar[str]
    """Kind of its simulator file."""
    form: str
    """Form of its system: ``"bench"``, or one of `pamid.simulators.Simulator`."""
    library: ClassVar[str] = ""
    """Of `pamid.effects.base.KINDS` the one whose effects "all" are; empty for those that can act at ports."""
    estimator: ClassVar[str] = "GeometricForce"
    """Name of the estimator that fits its parameters."""
    reads_all: ClassVar[bool] = True
    """Whether a diagnosis reads all of a log, instead of whole runs spread over a long one."""
    day_lasts: ClassVar[bool] = False
    """Whether a further log, unless conditions say otherwise, is of the last day."""
    corrected_files: ClassVar[tuple[str, ...]] = ("corrected.toml",)
    """Files of a corrected one, its simulator file first."""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of its numbers."""
        raise NotImplementedError

    @property
    def own_ports(self) -> tuple[Any, ...]:
        """Ports with names, units and columns of its own; none where a log has pamid's signals."""
        return ()

    @property
    def readings(self) -> Sequence[str]:
        """Columns of readings that a condition on rows keeps or drops."""
        return [p.source for p in self.own_ports if p.kind != "input"]

    def where(self, log: pd.DataFrame, rows: np.ndarray) -> pd.DataFrame:
        """Return a log without the readings of the other rows."""
        there = [name for name in self.readings if name in log.columns]
        if not there:
            raise MissingColumnError(
                f"--where is given, and the log has none of {', '.join(self.readings)}.",
                "a reading that conditions are about",
                "Leave --where out.",
            )
        return log.assign(**{name: log[name].where(rows) for name in there})

    def counting(self, logs: Mapping[str, pd.DataFrame], rows: np.ndarray) -> dict[str, pd.DataFrame]:
        """Return a log in which only some rows count; raise where each reading has rows of its own."""
        raise ParameterError(
            "Rows that count are given for several logs, or for a simulator with readings of its own.",
            "one log of a cylinder, a joint or a muscle",
            "Set the readings in other rows to NaN: they are then left out.",
        )

    def doubts(self, log: pd.DataFrame) -> list[str] | None:
        """Return doubts about the units of a log and the reference of its pressure; None where it has no such test."""
        return None

    def samples(self, log: pd.DataFrame) -> pd.DataFrame:
        """Return a log with the inputs and target of its estimator; no target in rows where it is not known."""
        return log

    def unit_of(self, columns: Sequence[str]) -> str:
        """Return the unit of the estimator's target on a log with some columns, where it says one."""
        return ""

    def as_bench(self) -> Any:
        """Return the bench whose muscles a stream of samples is about; None without muscles."""
        return None

    def to_toml(self, path: Path) -> None:
        """Write its simulator file."""
        raise NotImplementedError

    def write_corrected(
        self, stage: Path, folder: Path, read: Callable[[Path], AnySimulator], but: Collection[str] = ()
    ) -> AnySimulator:
        """Write its corrected files in a stage that becomes a folder; return what they say.

        Some effects may be written as they were identified although a model's elements come close.
        """
        self.to_toml(path := stage / self.corrected_files[0])
        return read(path)

    @property
    def inexact(self) -> tuple[str, ...]:
        """Names of its effects for which the elements of its model are not quite the same."""
        return ()

    def start_values(self) -> dict[str, float] | None:
        """Return the values of an FMU's parameters for any importer; None of other simulators."""
        return None

    def fit_numbers(self) -> Mapping[str, Any]:
        """Return the numbers that another tool may have fitted."""
        raise ParameterError(
            f"The simulator is that of a {self.kind}.",
            "a cylinder, joint or muscle, or a simulator with ports",
            "Give its numbers tolerances ([tolerance]) and diagnose the log, which refits them.",
        )


def check_simulator(given: object) -> None:
    """Refuse what is no simulator, such as the path of one."""
    if isinstance(given, AnySimulator):
        return
    if isinstance(given, (str, Path)):
        text = repr(str(given))
        raise ParameterError(
            f"The simulator is the text {text}.", "a simulator", f"Read it: pamid.read_simulator({text})."
        )
    raise ParameterError(
        f"The simulator is of type {type(given).__name__}.",
        "one of pamid",
        "Read its file or model with pamid.read_simulator, or see pamid.simulators.",
    )
