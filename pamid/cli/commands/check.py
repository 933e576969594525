"""``pamid check``: what is in a log, what can be identified from it, and what to record next."""

from __future__ import annotations

import argparse
import json
import shlex
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ...errors import PamidError, PressureReferenceError, TimeOrderError, UnitError
from ...file_sets import check_folder, replacing_together
from ...files import write_whole
from ...json_data import json_ready
from .._progress import progress
from .._simulators import add_trust_option, runs_code
from .._style import marked
from ..common import add_command, add_log_options, any_simulator_of, checked_output, note, print_json, table, wrapped

if TYPE_CHECKING:
    import pandas as pd

    from ...survey import Survey

FILES = ("check.html", "check.json")
"""What --out receives."""

_DESCRIPTION = """\
Examine a log before anything is fitted to it: columns and units, sampling, gaps and sensor faults, the noise of each
channel, repeated runs, and excitation. Then report, for each class of effects, whether it can be identified from the
log, why not, and what to record next.

With a simulator of the bench, each effect of the library is tried on the log: which ones would be visible, and which
would look alike. Doubtful data give warnings; only unreadable data are an error.
"""
_EXAMPLES = """\
  pamid check log.parquet
  pamid check log.parquet --sim log.sim.toml --html check.html
  pamid check *.csv --columns columns.toml --sim sim.toml --json
"""
_MOST = 8
_ROOM = 1 << 20


def add_parser(subparsers: Any) -> None:
    """Add the command."""
    summary = "show what a log contains, what it can tell you and what to record next"
    parser = add_command(subparsers, "check", summary, _DESCRIPTION, _EXAMPLES)
    add_log_options(parser)
    parser.add_argument(
        "--sim", metavar="SIM.toml", help="simulator file (default: LOG.sim.toml or sim.toml beside LOG, if there)"
    )
    add_trust_option(parser)
    parser.add_argument("--html", metavar="FILE", help="write an HTML page to this file")
    parser.add_argument("--out", metavar="DIR", help="write check.html and check.json to this folder")


def run(args: argparse.Namespace) -> int:
    """Run the command."""
    from ...survey.survey import survey

    if args.html:
        checked_output(args.html, [*args.log, args.sim, args.columns], _ROOM)
    if args.out:
        check_folder(args.out, FILES, size=_ROOM)
    ported = _has_ports(args)
    simulator = None if ported else any_simulator_of(args)
    own = _own_units(args) if ported else {}
    log, doubts = _read(args, own)
    with progress(args, "Looking"):
        found = survey(log, simulator)
    if ported:
        _leave_out_muscles(found)
        units = {name: unit for name, unit in own.items() if unit != "-"}
        found.channels[:] = [replace(c, unit=units.get(c.name, c.unit)) for c in found.channels]
        doubts += _port_doubts(args, log)
    found.warnings[:0] = doubts
    files = _write(args, found, log)
    if args.json:
        print_json({**found.as_dict(), "files": [str(f) for f in files]})
        return 0
    _tell(found)
    for file in files:
        print(f"wrote {file}")
    if not files:
        note(args, "--html FILE writes this as a page with pictures")
    if args.sim:
        print(f"\nnext: {_diagnose(args)}")
    return 0


def _has_ports(args: argparse.Namespace) -> bool:
    """Return whether --sim names a simulator with ports, beside which a log is looked at by itself."""
    from ...simulators import simulator_kinds
    from ...simulators.page import MODELS
    from ...systems.file import kind_of_file

    if not args.sim or not (Path(args.sim).suffix.lower() in MODELS or kind_of_file(args.sim) in simulator_kinds()):
        return False
    note(args, f"{args.sim} is a simulator with ports: the log is examined on its own")
    return True


def _own_units(args: argparse.Namespace) -> dict[str, str]:
    """Return the columns that the page of a simulator with ports names, with units; nothing of the simulator runs."""
    from ...simulators.page import MODELS, page_signals

    page = Path(args.sim)
    page = page.with_suffix(".toml") if page.suffix.lower() in MODELS else page
    return page_signals(page) if page.is_file() else {}


def _port_doubts(args: argparse.Namespace, log: pd.DataFrame) -> list[str]:
    """Return contradictions with a simulator's ports, and whether it is deterministic; without trust no code runs."""
    from ...simulators.page import MODELS, read_outline
    from ...simulators.port_log import port_log
    from ...simulators.port_units import unit_doubts
    from ...simulators.steadiness import unsteadiness

    try:
        if runs_code(args.sim) and not args.trust:
            if Path(args.sim).suffix.lower() not in MODELS:
                read_outline(args.sim)
            note(args, f"{args.sim} runs code: with --trust, its ports are compared with the columns of the log")
            return []
        simulator: Any = any_simulator_of(args)
        at_ports = port_log(log, simulator)
        told = unsteadiness(simulator, at_ports)
        return [*([told] if told else []), *(f"{text}." for text in unit_doubts(simulator, at_ports))]
    except PamidError as error:
        return [f"The columns are not compared with the ports: {error}"]


def _leave_out_muscles(found: Survey) -> None:
    """Leave out the questions about muscles and their gas, which a log of another system need not answer."""
    asked = [a for a in found.answers if "the log lacks" not in a.why]
    left_out = {a.record for a in found.answers if a not in asked} - {a.record for a in asked}
    found.answers[:] = asked
    found.record[:] = [text for text in found.record if text not in left_out]
    found.notes[:] = [text for text in found.notes if not text.startswith("With --sim")]


def _diagnose(args: argparse.Namespace) -> str:
    """Return the command that comes next."""
    options = [*(["--columns", args.columns] if args.columns else []), "--sim", args.sim]
    options += [*(["--trust"] if runs_code(args.sim) else []), "--out", "diagnosis"]
    return shlex.join(["pamid", "diagnose", *args.log, *options])


def _read(args: argparse.Namespace, own: dict[str, str]) -> tuple[pd.DataFrame, list[str]]:
    """Read the log; unlike other commands, report doubts about units or clock instead of refusing it."""
    from ...signals import LogMapping
    from ...signals.log import log_settings, read_with_notes

    mapping = LogMapping.load(args.columns, own=own)
    nan = "keep" if args.nan == "raise" else args.nan
    check_units, order = not own, None  # ports say themselves what their units are
    doubts: list[str] = []
    while True:
        settings = log_settings(mapping, nan, "ignore", time_order=order, encoding=args.encoding)
        try:
            log, notes = read_with_notes(args.log, settings, nan=nan, check_units=check_units)
        except (UnitError, PressureReferenceError) as error:
            if not check_units or not error.found.partition(": ")[2]:
                raise
            check_units = False
            doubts.append(f"{error} Until then the other commands refuse the log ('pamid init' writes a mapping).")
        except TimeOrderError as error:
            if order is not None:
                raise
            order = "split"
            doubts.append(f"{error} Here, a new run begins wherever time goes back.")
        else:
            return log, doubts + [f"{text}." for text in (*notes.losses(), *notes.readings.sentences())]


def _write(args: argparse.Namespace, found: Survey, log: pd.DataFrame) -> list[Path]:
    from ...survey.page import survey_html

    if not (args.html or args.out):
        return []
    page = survey_html(found, log, name=_name(args))
    files = [write_whole(args.html, page)] if args.html else []
    if args.out:
        data = json.dumps(json_ready(found.as_dict()), indent=2, ensure_ascii=False) + "\n"
        with replacing_together(args.out, FILES) as stage:
            for name, text in zip(FILES, (page, data), strict=True):
                write_whole(stage / name, text)
        files += [Path(args.out) / name for name in FILES]
    return files


def _name(args: argparse.Namespace) -> str:
    first = "/".join(Path(args.log[0]).parts[-2:])
    return f"{first} and {len(args.log) - 1} more" if args.log[1:] else first


# --- for people -------------------------------------------------------------------------------------------------
def _tell(found: Survey) -> None:
    from ...survey.words import channel_rows, sampling_sentence

    print(wrapped("log", sampling_sentence(found.sampling)))
    header, rows = channel_rows(found.channels)
    print("\n" + table(header, rows) + "\n")
    for text in found.warnings:
        print(wrapped(marked("warning", "warning"), text, len("warning")))
    if found.warnings:
        print()
    print(marked("What this log can tell", "head"))
    for answer in found.answers:
        print(wrapped(marked(answer.answer, answer.answer), f"{answer.question}: {answer.why}", len(answer.answer)))
    _tell_separations(found)
    if found.record:
        print("\n" + marked("What to record next", "head"))
        for number, text in enumerate(found.record[:_MOST], 1):
            print(wrapped(f"{number}.", text))
        if len(found.record) > _MOST:
            print(f"   and {len(found.record) - _MOST} more: --json, --html")
    print()
    for text in found.notes:
        print(wrapped("note", text))


def _tell_separations(found: Survey) -> None:
    if not found.separations:
        return
    seen = [s for s in found.separations if s.seen]
    hidden = [s.effect for s in found.separations if not s.seen]
    print("\n" + marked("The library on this log", "head"))
    print(wrapped("seen", f"{len(seen)} of {len(found.separations)} effects of typical size stand out from the noise."))
    if hidden:
        print(wrapped("hidden", ", ".join(hidden)))
    for group in found.classes():
        print(wrapped("alike", ", ".join(group)))
