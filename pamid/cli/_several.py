"""Several logs on the command line, and what a later diagnosis goes on from."""

from __future__ import annotations

import argparse
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import ParameterError
from .common import load_log
from .rows import readings_where

if TYPE_CHECKING:
    import pandas as pd

    from ..bench.parameters import BenchParameters
    from ..gap.diagnosis.result import Diagnosis
    from ..gap.several.history import History

HISTORY = ("state.json", "logs.parquet")
"""What `pamid.gap.several.history` writes."""
_JUDGED = ("F", "F1", "F2", "mdot", "mdot1", "mdot2")
"""Readings that --where keeps or drops on a bench."""


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the options that are about several logs."""
    group = parser.add_argument_group("several logs of one bench")
    group.add_argument(
        "--conditions",
        metavar="TABLE.csv",
        help="what held for each log: columns log, day and numbers of the simulator, SI units; each LOG is then a log "
        "of its own",
    )
    group.add_argument(
        "--since",
        metavar="DIR",
        help="go on from the diagnosis in DIR: its posterior is the prior of this one, and "
        "its simulator that of this one where none is named",
    )


def wanted(args: argparse.Namespace) -> bool:
    """Tell whether an option asks for a diagnosis of several logs."""
    return bool(args.conditions or args.since)


def logs_of(args: argparse.Namespace) -> dict[str, pd.DataFrame] | None:
    """Return each file that the arguments name as a log of its own; None where they are the runs of one log.

    Files of one run each are the runs of one log, unless a table of conditions or an earlier diagnosis says otherwise.
    """
    from ..signals import read_log
    from ..signals.log import find_logs

    files = find_logs(args.log)
    if len(files) == 1 and not wanted(args):
        return None
    found: dict[str, pd.DataFrame] = {}
    for file in files:
        name = file.stem if file.stem not in found else file.name
        if name in found:
            raise ParameterError(f"Two logs are named {file.name}.", "names that differ", "Rename one of the files.")
        with warnings.catch_warnings():
            if not wanted(args):
                warnings.simplefilter("ignore")  # they come again where all files are one log
            found[name] = read_log([file], args.columns, nan=args.nan)
    if not wanted(args) and all(log["trajectory"].nunique() == 1 for log in found.values()):
        return None
    return found


def simulator_before(args: argparse.Namespace) -> BenchParameters | None:
    """Return the simulator of the diagnosis that the arguments go on from; None where they begin anew."""
    from ..gap.several.history import read_history

    return read_history(args.since).params if args.since else None


def diagnosed(
    args: argparse.Namespace,
    params: BenchParameters,
    effects: str | list[str],
    logs: dict[str, pd.DataFrame] | None,
    step: Callable[[str], None],
) -> tuple[Diagnosis, History, pd.DataFrame]:
    """Diagnose one log or several of a bench; return the answer, what a later one goes on from, and the rows used.

    Parameters
    ----------
    args : Namespace
        The options.
    params : BenchParameters
        The simulator.
    effects : "all" or list of str
        Effects that may be causes.
    logs : dict of str to DataFrame, optional
        Several logs; one is read from the arguments where they are None.
    step : callable
        Called with a text at each step.
    """
    import pandas as pd

    from ..effects.registry import chosen_effects
    from ..gap import diagnose
    from ..gap.engine import rows_used
    from ..gap.several import Conditions, read_conditions
    from ..gap.several.go_on import go_on
    from ..gap.several.history import History, read_history

    if logs is None:
        step("read the log")
        log, rows = _used(args)
        history = History(params, chosen_effects(effects, "bench"))
        found = diagnose(log, params, effects=effects, seed=args.seed, progress=step)
        if len(log) < rows:
            found.notes.insert(0, rows_used(len(log), rows))
        name = Path(args.log[0]).stem
        history.add(found, {name: log}, [Conditions({}, name)])
        return found, history, log
    logs = {name: readings_where(log, args.where, _JUDGED) for name, log in logs.items()}
    table = read_conditions(args.conditions) if args.conditions else None
    history = read_history(args.since, params) if args.since else History(params, chosen_effects(effects, "bench"))
    if args.since and effects != "all":
        raise ParameterError(
            "--effects or --without is given with --since.",
            "the library of the earlier diagnosis, whose posterior is the prior",
            "Leave the option out, or diagnose all logs anew.",
        )
    found = go_on(history, logs, conditions=table, seed=args.seed, progress=step)
    return found, history, pd.concat(history.logs.values(), ignore_index=True)


def _used(args: argparse.Namespace) -> tuple[pd.DataFrame, int]:
    """Return as much of the log as a diagnosis uses, whole trajectories, and how many rows there are."""
    from ..gap.settings import MAX_ROWS
    from ..signals import read_log_part

    if args.where:  # what is left of a condition is not known before all is read
        log = readings_where(load_log(args), args.where, _JUDGED)
        return log, len(log)
    return read_log_part(args.log, args.columns, most=MAX_ROWS, nan=args.nan)
