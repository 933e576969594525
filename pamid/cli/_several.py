"""Several logs on the command line, and what a later diagnosis goes on from."""

from __future__ import annotations

import argparse
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import ParameterError
from .common import load_log, mapping_of
from .rows import rows_where

if TYPE_CHECKING:
    import pandas as pd

    from ..gap.diagnosis.result import Diagnosis
    from ..gap.several.history import History
    from ..opinion import Opinion

HISTORY = ("state.json", "logs.parquet")
"""What `pamid.gap.several.history` writes."""


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the options that are about several logs."""
    group = parser.add_argument_group("several logs")
    group.add_argument(
        "--conditions",
        metavar="TABLE.csv",
        help="conditions of each log: columns log, day and parameters of the simulator in its units; each LOG is then "
        "a separate log",
    )
    group.add_argument(
        "--since",
        metavar="DIR",
        help="continue the diagnosis in DIR: its posterior is the prior of this one, and "
        "its simulator the default of --sim",
    )


def wanted(args: argparse.Namespace) -> bool:
    """Return whether an option asks for a diagnosis of several logs."""
    return bool(args.conditions or args.since)


def logs_of(args: argparse.Namespace, simulator: Any) -> dict[str, pd.DataFrame] | None:
    """Return each named file as a log of its own; None where they are the runs of one log."""
    from ..signals.joining import is_joined
    from ..signals.log import MAX_BYTES, find_logs

    files = find_logs(args.log)
    parts_of_runs = is_joined(files, mapping_of(args, simulator), MAX_BYTES)
    if (len(files) == 1 or parts_of_runs) and not wanted(args):
        return None
    found: dict[str, pd.DataFrame] = {}
    for file in files:
        name = file.stem if file.stem not in found else file.name
        if name in found:
            raise ParameterError(f"Two logs are named {file.name}.", "names that differ", "Rename one of the files.")
        with warnings.catch_warnings():
            if not wanted(args):
                warnings.simplefilter("ignore")  # they come again where all files are one log
            found[name] = load_log(args, simulator=simulator, paths=[file])
    if not wanted(args) and all(log["trajectory"].nunique() == 1 for log in found.values()):
        return None
    return found


def simulator_before(args: argparse.Namespace) -> Any:
    """Return the simulator of the diagnosis that the arguments go on from; None where they begin again."""
    return _history(args, None).simulator if args.since else None


def _history(args: argparse.Namespace, simulator: Any) -> History:
    from ..any_simulator import read_simulator
    from ..gap.several.history import read_history

    trust = bool(getattr(args, "trust", False))
    return read_history(args.since, simulator, read=lambda page: read_simulator(page, trust=trust))


def diagnosed(
    args: argparse.Namespace, simulator: Any, effects: str | list[str], step: Callable[[str], None]
) -> tuple[Diagnosis, pd.DataFrame]:
    """Diagnose one log or several with a simulator of any kind; return the answer and the rows used."""
    import pandas as pd

    from ..any_simulator import diagnose
    from ..gap.engine import rows_used
    from ..gap.several import read_conditions

    if args.since and effects != "all":
        raise ParameterError(
            "--effects or --without is given with --since.",
            "the library of the earlier diagnosis, whose posterior is the prior",
            "Leave the option out, or diagnose all logs anew.",
        )
    notes: list[str] = []
    logs = logs_of(args, simulator)
    step("read the log")
    if logs is None:
        log, total = _used(args, simulator)
        if len(log) < total:
            notes = [rows_used(len(log), total)]
        found_in: Any = {Path(args.log[0]).stem: log}
    else:
        found_in = {name: _counted(args, simulator, log) for name, log in logs.items()}
    table = read_conditions(args.conditions, simulator) if args.conditions else None
    since = _history(args, simulator) if args.since else None
    found = diagnose(
        found_in, simulator, effects, conditions=table, since=since, alone=logs is None, seed=args.seed,
        progress=step,
    )  # fmt: skip
    found.notes[:0] = notes
    assert found.history is not None
    if args.sim:
        found.history.page = str(Path(args.sim).resolve())
    found.history.columns = str(Path(args.columns).resolve()) if args.columns else ""
    found.history.encoding = args.encoding or ""
    return found, pd.concat(found.history.logs.values(), ignore_index=True)


def judged_after(
    args: argparse.Namespace, simulator: Any, effects: str | list[str], step: Callable[[str], None]
) -> tuple[Opinion, pd.DataFrame]:
    """Return the second opinion on the parameters of another tool that ``--after`` names, and the rows used."""
    from ..opinion import second_opinion

    if wanted(args):
        raise ParameterError(
            "--after is given with --conditions or --since.",
            "one log",
            "Leave one out: a second opinion concerns one log.",
        )
    log = _counted(args, simulator, load_log(args, simulator=simulator))
    return second_opinion(log, simulator, args.after, effects, seed=args.seed, progress=step), log


def _counted(args: argparse.Namespace, simulator: Any, log: pd.DataFrame) -> pd.DataFrame:
    """Return a log without the readings that do not count."""
    rows = rows_where(log, args.where)
    return log if rows is None else simulator.where(log, rows)


def _used(args: argparse.Namespace, simulator: Any) -> tuple[pd.DataFrame, int]:
    """Return as much of the log as a diagnosis uses, whole runs, and how many rows there are."""
    from ..gap.settings import MAX_ROWS
    from ..signals.pieces import read_log_part

    if not simulator.reads_all and not args.where:
        return read_log_part(args.log, args.columns, most=MAX_ROWS, nan=args.nan)
    log = load_log(args, simulator=simulator)  # which conditions remain is known once all is read
    return _counted(args, simulator, log), len(log)
