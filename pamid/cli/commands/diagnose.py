"""``pamid diagnose``: where simulator and log disagree, which missing effect is the cause, how far the gap shrinks."""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ...errors import ParameterError, UnknownOptionError, among
from ...file_sets import check_folder, replacing_together
from ...files import write_whole
from ...json_data import json_ready
from .._corrected import CORRECTED, write_corrected
from .._drafting import quoted, show_commands
from .._progress import progress
from .._several import HISTORY, add_options, diagnosed, judged_after, simulator_before
from .._simulators import add_trust_option
from ..common import (
    DONE,
    UNTESTED,
    add_command,
    add_log_options,
    any_simulator_of,
    note,
    number,
    print_json,
    table,
    wrapped,
)
from ..rows import add_where

if TYPE_CHECKING:
    import pandas as pd

    from ...gap.diagnosis.result import Diagnosis
    from ...gap.several.history import History
    from ...opinion import Opinion, Passport
    from ...report.sections import Source

PASSPORT = ("passport.toml", "passport.html")
FILES = ("diagnosis.json", *CORRECTED, *HISTORY, *PASSPORT, "report.html")
"""What --out receives."""

_CANDIDATES = 6
_ROOM = 1 << 20
_DESCRIPTION = """\
Diagnose the gap between a simulator and a log: where it is (equation, region of the state, frequencies, runs), which
missing effect is the cause, and how far the gap shrinks on unseen runs once that effect is added. The parameters under
[tolerance] are refitted first and with every candidate, so a parameter within its tolerance is not a gap.

The answer is one cause, one of a class that this log cannot distinguish, several causes, a cause that is not in the
library, or no gap. If the log does not decide, the answer names the run to record next.

DIR receives report.html (opens in any browser, without a network), diagnosis.json, and corrected.toml, the simulator
with the causes added, for 'pamid evaluate' and 'pamid simulate'.

SIM.toml may also describe a cylinder, a joint or a single muscle, as 'pamid init --kind' writes it, or your own
simulator: a Python function, a MuJoCo model, an FMU or a python-control system (docs/simulators.md). A model file
itself, .xml or .fmu, works too. Effects then act at its ports, and the corrected simulator is written in its format.

With --where, only windows in which all rows meet the condition are compared; effects with memory still run through the
other rows. On a bench the condition applies to the readings of force and flow, not to joint and valve.

Several LOGs with several runs each are diagnosed together: causes are shared, and a cause may appear or disappear
between two days. Valves, friction and gas of a bench, and clocks and offsets of other simulators, may differ from day
to day. A later diagnosis can continue from DIR (--since DIR), and 'pamid next DIR' designs the run to record next.

--after FIT asks for a second opinion on parameters that another tool fitted: MuJoCo's sysid (params_x_hat.yaml), PACE
and BAM (JSON, YAML), a fitted MJCF, start values for FMPy. It reports which of them absorbed physics that the simulator
lacks, which this log does not determine, what is missing, and whether another run is needed. DIR then also contains
passport.toml and passport.html; 'pamid passport' tests such a passport on the log of another system.
"""
_EXAMPLES = """\
  pamid diagnose log.parquet --sim sim.toml --out diagnosis
  pamid diagnose log.parquet --out diagnosis --effects coulomb_friction,hysteresis,leakage
  pamid diagnose bench.csv --columns columns.toml --sim sim.toml --out diagnosis --without creep --json
  pamid diagnose log.csv --sim motor.toml --trust --out diagnosis      a function of your own, or an FMU
  pamid diagnose log.csv --sim arm.xml --out diagnosis                 a MuJoCo model
  pamid diagnose log.csv --sim arm.xml --after params_x_hat.yaml --out opinion      fitted by another tool
  pamid diagnose muscle.mat --columns columns.toml --sim sim.toml --where 'F > 5' --out diagnosis
  pamid diagnose monday.parquet friday.parquet --sim sim.toml --out diagnosis
  pamid diagnose next.parquet --since diagnosis --sim sim.toml --out second
  pamid evaluate other.parquet --sim diagnosis/corrected.toml
"""


def add_parser(subparsers: Any) -> None:
    """Add the command."""
    summary = "find where simulator and log disagree, the cause, and how far the gap closes"
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
    parser.add_argument("--after", metavar="FIT", action="append", help="parameters fitted by another tool; repeatable")
    add_where(parser)
    add_options(parser)
    add_trust_option(parser)


def run(args: argparse.Namespace) -> int:
    """Run the command."""
    from ...gap.inference.so_far import twice
    from ...opinion import Passport
    from ...report import answers
    from ...signals.log import find_logs

    folder = check_folder(args.out, FILES, size=_ROOM)
    find_logs(args.log)  # an unknown name is reported before anything is read
    simulator = any_simulator_of(args) or simulator_before(args)
    if simulator is None:
        raise ParameterError(
            "No simulator is given, and no simulator file is in the log's folder.",
            "a simulator file",
            "Add --sim SIM.toml; 'pamid init' writes one.",
        )
    effects = _effects(args.effects, args.without, simulator)
    started = time.perf_counter()
    opinion: Opinion | None = None
    with progress(args, "Diagnosing") as step:
        if args.after:
            opinion, log = judged_after(args, simulator, effects, step)
            d = opinion.diagnosis
        else:
            d, log = diagnosed(args, simulator, effects, step)
    source = _source(args, log)
    passport = Passport.of(opinion, source.log) if opinion is not None else None
    with progress(args, "Writing the report:") as step:
        tried = _tried_on(args, d)
        files = twice(lambda short: write(d, folder, source, d.history, passport, step, tried, short))
    if args.json:
        judged = {"opinion": json_ready(opinion.as_dict())} if opinion is not None else {}
        print_json({**d.as_dict(), **judged, "files": {file.name: str(file) for file in files}})
        return DONE if d.tested else UNTESTED
    if opinion is not None:
        for text in opinion.sentences():
            print(wrapped("after", text))
        print()
    told = answers(d)
    print(f"{told.verdict}\n")
    for word, text in (("where", told.where), ("which", told.which), ("how far", told.how_far)):
        for place, line in enumerate(text.splitlines()):
            print(wrapped("" if place else word, line))
    if d.candidates:
        print(f"\n{_ranking(d)}")
    _print_notes(d)
    print()
    for file in files:
        print(f"wrote {file}")
    print()
    show_commands(_following(args, folder))
    note(args, f"took {time.perf_counter() - started:.0f} s")
    return DONE if d.tested else UNTESTED


def _following(args: argparse.Namespace, folder: Path) -> list[str]:
    """Return the commands after a diagnosis: the corrected simulator on the log, and the design of the next run."""
    trust = " --trust" if args.trust else ""
    columns = "".join(
        f" --{name} {quoted([value])}" for name in ("columns", "encoding") if (value := getattr(args, name))
    )
    found = []
    if (folder / "corrected.toml").exists():
        corrected = f"--sim {quoted([folder / 'corrected.toml'])}"
        found.append(f"pamid evaluate {quoted(args.log)}{columns} {corrected}{trust}")
    if (folder / HISTORY[0]).exists():
        found.append(f"pamid next {quoted([folder])}{trust}")
    return found


def write(
    d: Diagnosis,
    folder: Path,
    source: Source,
    history: History | None = None,
    passport: Passport | None = None,
    step: Callable[[str], None] | None = None,
    log: pd.DataFrame | None = None,
    short: bool = False,
) -> list[Path]:
    """Write report, diagnosis and corrected simulator into a folder, all of them or none; in short no report."""
    from ...report import report_html

    with replacing_together(folder, FILES) as stage:
        d.notes.extend(text for text in write_corrected(d, stage, folder, log) if text not in d.notes)
        if not short:
            write_whole(stage / "report.html", report_html(d, source, step))
        write_whole(stage / "diagnosis.json", d.to_json() + "\n")
        if history is not None:
            history.write(stage, folder)
        if passport is not None:
            for name, text in passport.texts().items():
                (stage / name).write_text(text, encoding="utf-8")
        written = [name for name in FILES if (stage / name).exists()]
    return [folder / name for name in written]


def _tried_on(args: argparse.Namespace, d: Diagnosis) -> pd.DataFrame | None:
    """Return the log on which the corrected simulator is tried; none where conditions or rows of its own hold."""
    logs = list(d.history.logs.values()) if d.history is not None else []
    return logs[0] if len(logs) == 1 and not (args.where or args.conditions) else None


def _effects(chosen: str, without: Sequence[str], simulator: Any) -> str | list[str]:
    """Return the names of the effects that may be the cause of a simulator's gap."""
    from ...any_simulator import library_of
    from ...effects import all_effects
    from ...simulators import port_effects

    at_ports = not simulator.library
    known = set(port_effects()) if at_ports else set(all_effects())

    def names(text: str, option: str) -> list[str]:
        found = [name.strip() for name in text.split(",") if name.strip()]
        for name in found:
            if name.partition("@")[0] not in known:
                like = [k for k in known if k.partition("_")[2] == name.partition("_")[2] != ""]
                expected, remedy = among(name, sorted(known))
                if at_ports and like:  # of the same kind, under the name that it has on the bench
                    remedy = f"Did you mean {' or '.join(sorted(like)[:3])}?"
                raise UnknownOptionError(f"{option} names {name!r}, which is not an effect.", expected, remedy)
        return found

    left_out = {name for text in without for name in names(text, "--without")}
    if chosen.strip() == "all" and not left_out:
        return "all"
    kept = library_of("all", simulator) if chosen.strip() == "all" else names(chosen, "--effects")
    kept = [name for name in dict.fromkeys(kept) if name not in left_out]
    if not kept:
        raise ParameterError("No effect is left as a candidate.", "at least one", "Name more in --effects.")
    return kept


def _source(args: argparse.Namespace, log: Any) -> Source:
    from ...report.sections import Source

    unnamed = f"the simulator of {_short(args.since)}" if args.since else "the simulator beside it"
    more = f" and {len(args.log) - 1} more" if len(args.log) > 1 else ""
    return Source(
        log=f"{_short(args.log[0])}{more}",
        simulator=_short(args.sim) if args.sim else unnamed,
        rows=len(log),
        runs=int(log["trajectory"].nunique()) if "trajectory" in log else 0,
    )


def _short(path: str) -> str:
    """Return the end of a path; a report travels, and the rest of it says nothing elsewhere."""
    return "/".join(Path(path).parts[-2:])


def _ranking(d: Diagnosis) -> str:
    from ...report.drawings.ranking import answer_names
    from ...report.quantities import said_at
    from ...report.ranked import certainty, closes, reason

    told = answer_names(d)
    named = sorted(d.candidates, key=lambda c: ((c.effect, c.where) not in told, -c.confidence))
    first = named[: max(_CANDIDATES, len(told))]
    rows = [
        [
            said_at(c.effect, c.where),
            number(round(certainty(d, c), 3)),
            closes(d, c) or "-",
            "" if (c.effect, c.where) in told else reason(d, c),
        ]
        for c in first
    ]
    return table(["candidate", "confidence", "closes alone", "why not"], rows)


def _print_notes(d: Diagnosis) -> None:
    from ...report.sentences import experiment

    lines = [("note", text) for text in d.notes]
    if d.next_run is not None:
        lines.append(("next", experiment(d.next_run)))
    if lines:
        print()
    for word, text in lines:
        print(wrapped(word, text))
