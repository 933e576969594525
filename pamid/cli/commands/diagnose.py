"""``pamid diagnose``: where simulator and log disagree, which missing effect is the cause, how far the gap shrinks."""

from __future__ import annotations

import argparse
import shutil
import textwrap
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ...errors import ParameterError, UnknownOptionError
from ...file_sets import check_folder, replacing_together
from ...files import write_whole
from .._several import HISTORY, add_options, diagnosed, logs_of, simulator_before, wanted
from .._simulators import CORRECTED, add_trust_option, port_simulator_of, write_corrected
from ..common import (
    DONE,
    UNTESTED,
    add_command,
    add_log_options,
    load_log,
    note,
    number,
    print_json,
    progress,
    simulator_of,
    system_of,
    table,
)
from ..rows import add_where, readings_where, rows_where

if TYPE_CHECKING:
    from ...gap.diagnosis.result import Diagnosis
    from ...gap.several.history import History
    from ...report.sections import Source

FILES = ("diagnosis.json", *CORRECTED, *HISTORY, "report.html")
"""What --out receives."""

_CANDIDATES = 6
_ROOM = 1 << 20
_DESCRIPTION = """\
Diagnose the gap between a simulator and a log: where it lies (equation, region of the state, frequencies, runs), which
effect that the simulator lacks is the cause, and how far the gap shrinks once it is added, on runs that the fit has not
seen. The parameters under [tolerance] are refitted first and with every candidate, so that a parameter a little off is
no gap.

The answer is one cause, one of a class that this log cannot split, several causes, a cause that is not in the library,
or no gap. Where the log leaves a choice, the run to record next is named.

DIR receives report.html (opens in any browser, without a network), diagnosis.json, and corrected.toml, the simulator
with the causes added, which 'pamid evaluate' and 'pamid simulate' take.

SIM.toml may also be the page of a cylinder, a joint or a single muscle, as 'pamid init --kind' writes it;
corrected.toml is then such a page, for 'pamid evaluate' and 'pamid diagnose'. It may be the page of a simulator of your
own as well, a Python function, a MuJoCo model, an FMU or a python-control system (docs/simulators.md), or such a model
itself, .xml or .fmu: effects then act at its ports, and the corrected simulator comes back as what it was.

With --where only windows of 20 ms count whose rows all meet the condition; what effects remember still runs through the
others. On a bench it is the readings of force and flow that count, since a condition says nothing of joint and valve.

Several LOGs of a bench that hold several runs each are diagnosed together: causes are shared, valves, friction and gas
are each day's own, and a cause may come or go between two days. DIR then also holds what a later diagnosis goes on from
(--since DIR), and 'pamid next DIR' designs the run to record next.
"""
_EXAMPLES = """\
  pamid diagnose log.parquet --sim sim.toml --out diagnosis
  pamid diagnose log.parquet --out diagnosis --effects coulomb_friction,hysteresis,leakage
  pamid diagnose bench.csv --columns mapping.toml --sim sim.toml --out diagnosis --without creep --json
  pamid diagnose log.csv --sim motor.toml --trust --out diagnosis      a function of your own, or an FMU
  pamid diagnose log.csv --sim arm.xml --out diagnosis                 a MuJoCo model
  pamid diagnose muscle.mat --columns columns.toml --sim sim.toml --where 'F > 5' --out diagnosis
  pamid diagnose monday.parquet friday.parquet --sim sim.toml --out diagnosis
  pamid diagnose next.parquet --since diagnosis --sim sim.toml --out second
  pamid evaluate other.parquet --sim diagnosis/corrected.toml
"""


def add_parser(subparsers: Any) -> None:
    """Add the command."""
    summary = "where simulator and log disagree, the cause, and how far the gap closes"
    parser = add_command(subparsers, "diagnose", summary, _DESCRIPTION, _EXAMPLES)
    add_log_options(parser)
    parser.add_argument(
        "--sim", metavar="SIM.toml", help="simulator file (default: LOG.sim.toml or sim.toml beside LOG)"
    )
    parser.add_argument("--out", metavar="DIR", required=True, help="folder for report, diagnosis and simulator")
    parser.add_argument(
        "--effects", metavar="A,B,...", default="all", help="effects that may be the cause (default: the whole library)"
    )
    parser.add_argument(
        "--without", metavar="A,B,...", action="append", default=[], help="effects to leave out; repeatable"
    )
    add_where(parser)
    add_options(parser)
    add_trust_option(parser)


def run(args: argparse.Namespace) -> int:
    """Run the command."""
    from ...gap import diagnose_simulator
    from ...report import answers
    from ...systems import diagnose_system

    folder = check_folder(args.out, FILES, size=_ROOM)
    ported = port_simulator_of(args)
    system = system_of(args) if ported is None else None
    kind = "" if ported is not None else "bench" if system is None else system.library
    effects = _effects(args.effects, args.without, kind)
    bench = system is None and ported is None
    if wanted(args) and not bench:
        raise ParameterError(
            "--conditions or --since is given, and the simulator is none of the bench.",
            "logs of the antagonistic bench",
            "Diagnose the logs of other systems one by one.",
        )
    logs = logs_of(args) if bench else None
    history: History | None = None
    log = load_log(args, ported=ported) if not bench else None
    params = simulator_of(args) or simulator_before(args) if bench else None
    if params is None and bench:
        raise ParameterError(
            "No simulator is named, and none lies beside the log.",
            "a simulator file",
            "Add --sim SIM.toml; 'pamid init' writes one.",
        )
    started = time.perf_counter()
    with progress(args, "Diagnosing") as step:
        if ported is not None:
            assert log is not None
            measured = [p.source for p in ported.ports if p.kind != "input"]
            log = readings_where(log, args.where, measured)
            d = diagnose_simulator(log, ported, effects=effects, seed=args.seed, progress=step)
        elif system is not None:
            assert log is not None
            rows = rows_where(log, args.where)
            d = diagnose_system(log, system, effects=effects, rows=rows, seed=args.seed, progress=step)
        else:
            assert params is not None
            d, history, log = diagnosed(args, params, effects, logs, step)
        step("report")
        files = write(d, folder, _source(args, log), history)
    if args.json:
        print_json({**d.as_dict(), "files": {file.name: str(file) for file in files}})
        return DONE if d.tested else UNTESTED
    told = answers(d)
    print(f"{told.verdict}\n")
    for word, text in (("where", told.where), ("which", told.which), ("how far", told.how_far)):
        print(_paragraph(word, text))
    if d.candidates:
        print(f"\n{_ranking(d)}")
    _print_notes(d)
    if history is not None and d.gap and len(d.rivals) > 1:
        print(_paragraph("next", f"'pamid next {folder}' designs the run that distinguishes the explanations."))
    print()
    for file in files:
        print(f"wrote {file}")
    note(args, f"took {time.perf_counter() - started:.0f} s")
    return DONE if d.tested else UNTESTED


def write(d: Diagnosis, folder: Path, source: Source, history: History | None = None) -> list[Path]:
    """Write report, diagnosis and simulator into a folder, all of them or none.

    A corrected simulator with ports that cannot be made, loaded and run is left out, which the diagnosis's notes tell.

    Parameters
    ----------
    d : Diagnosis
        What to write.
    folder : Path
        Where to; made if it is not there.
    source : Source
        Where the diagnosis comes from.
    history : History, optional
        What a later diagnosis goes on from.

    Returns
    -------
    list of Path
        The files.

    Raises
    ------
    OutputError
        If they cannot be written; what was there before then stays.
    """
    from ...report import report_html
    from ...simulators import Simulator

    with replacing_together(folder, FILES) as stage:
        if isinstance(d.corrected, Simulator):
            d.notes.extend(write_corrected(d.corrected, stage, folder))
        elif d.corrected is not None:
            d.corrected.to_toml(stage / "corrected.toml")
        write_whole(stage / "report.html", report_html(d, source))
        write_whole(stage / "diagnosis.json", d.to_json() + "\n")
        if history is not None:
            history.write(stage)
        written = [name for name in FILES if (stage / name).exists()]
    return [folder / name for name in written]


def _effects(chosen: str, without: Sequence[str], kind: str) -> str | list[str]:
    """Return the names of the effects that may be the cause of a kind of system's gap."""
    import difflib

    from ...effects import all_effects
    from ...effects.registry import chosen_effects
    from ...simulators import port_effects

    at_ports = not kind
    known = set(port_effects()) if at_ports else set(all_effects())

    def names(text: str, option: str) -> list[str]:
        found = [name.strip() for name in text.split(",") if name.strip()]
        for name in found:
            if name.partition("@")[0] not in known:
                close = difflib.get_close_matches(name, known, n=3)
                raise UnknownOptionError(
                    f"{option} names {name!r}, which is no effect.",
                    f"one of {', '.join(sorted(known))}",
                    f"Did you mean {' or '.join(close)}?" if close else "Correct the name.",
                )
        return found

    left_out = {name for text in without for name in names(text, "--without")}
    if chosen.strip() == "all" and not left_out:
        return "all"
    whole = sorted(known) if at_ports else chosen_effects("all", kind)
    kept = whole if chosen.strip() == "all" else names(chosen, "--effects")
    kept = [name for name in dict.fromkeys(kept) if name not in left_out]
    if not kept:
        raise ParameterError("No effect is left to be the cause.", "at least one", "Name more in --effects.")
    return kept


def _source(args: argparse.Namespace, log: Any) -> Source:
    from ...report.sections import Source

    logs = args.log if isinstance(args.log, list) else [args.log]
    unnamed = f"the simulator of {_short(args.since)}" if args.since else "the simulator beside it"
    more = f" and {len(logs) - 1} more" if len(logs) > 1 else ""
    return Source(
        log=f"{_short(logs[0])}{more}",
        simulator=_short(args.sim) if args.sim else unnamed,
        rows=len(log),
        runs=int(log["trajectory"].nunique()) if "trajectory" in log else 0,
    )


def _short(path: str) -> str:
    """Return the end of a path; a report travels, and the rest of it says nothing elsewhere."""
    return "/".join(Path(path).parts[-2:])


def _ranking(d: Diagnosis) -> str:
    from ...report.drawings.ranking import answer_names
    from ...report.sentences import closes, reason

    told = answer_names(d)
    named = sorted(d.candidates, key=lambda c: ((c.effect, c.where) not in told, -c.confidence))
    first = named[: max(_CANDIDATES, len(told))]
    rows = [
        [
            f"{c.effect} at {c.where}" if c.where else c.effect,
            number(round(c.confidence, 3)),
            closes(d, c) or "-",
            "" if (c.effect, c.where) in told else reason(d, c),
        ]
        for c in first
    ]
    return table(["candidate", "confidence", "closes alone", "why not"], rows)


def _print_notes(d: Diagnosis) -> None:
    from ...report.sentences import experiment
    from ...report.several import changed

    lines = [("changed", changed(c)) for c in d.changes]
    lines += [("note", text) for text in d.notes]
    if d.next_experiment is not None:
        lines.append(("next", experiment(d.next_experiment)))
    if lines:
        print()
    for word, text in lines:
        print(_paragraph(word, text))


def _paragraph(word: str, text: str) -> str:
    """Return a text with a word before it, wrapped to the terminal; control characters of a log's names left out."""
    clean = "".join(c if c.isprintable() else " " for c in text)
    width = max(40, min(shutil.get_terminal_size((110, 24)).columns, 120))
    return textwrap.fill(clean, width, initial_indent=f"{word:<9}", subsequent_indent=" " * 9)
