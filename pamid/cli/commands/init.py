"""``pamid init``: a commented simulator file and a mapping of columns for somebody's own log."""

from __future__ import annotations

import argparse
import contextlib
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ...errors import OutputError, PamidError, ParameterError
from ...file_sets import check_folder, replacing_together
from ...files import write_whole
from .._drafting import (
    FILES,
    Asker,
    ask_for_columns,
    ask_for_numbers,
    ask_for_units,
    assign,
    checked_folder,
    disagreement,
    following,
    hold,
    names,
    pairs,
    quoted,
    refer,
    show,
    show_commands,
    tell,
    tried,
    trusted,
    write,
)
from .._simulators import add_trust_option, coded, outline
from ..common import DONE, add_command, print_json, table

if TYPE_CHECKING:
    import pandas as pd

    from ...simulators import Simulator
    from ...systems.draft import Draft


_DESCRIPTION = """\
Inspect a log with any names and units, and write the two files that the other commands need:

  columns.toml   which column is which signal, and its unit
  sim.toml       the parameters of the recorded bench, cylinder, joint or muscle, with comments

Names and units are recognised from the column names, English or German, or guessed from the values. On a terminal the
command asks for what the log does not show. In a script, or with --yes, a missing unit or number is assumed and marked
ASSUMED in the files; an ambiguity (gauge or absolute, two columns for one signal, an unknown unit) is an error that
names the option to set. The log is read with the new mapping before anything is written.
"""
_EXAMPLES = """\
  pamid init run1.csv --sim arm.xml --out setup                    ports of a MuJoCo model, or of an FMU
  pamid init run1.csv                                              asks for what the log does not show
  pamid init run1.csv --kind muscle --set rest_length='200 mm' --set rest_diameter='20 mm' --yes
  pamid init *.csv --kind cylinder --signal time=0:ms --signal x=4:mm --signal P=5:bar:gauge --signal F=6:N \\
      --set bore='25 mm' --yes --out setup                         a log without column names
"""


def add_parser(subparsers: Any) -> None:
    """Add the command."""
    summary = "write sim.toml and a mapping of columns for your own log"
    parser = add_command(subparsers, "init", summary, _DESCRIPTION, _EXAMPLES)
    parser.add_argument(
        "log", metavar="LOG", nargs="+", help="log file(s) or folder: CSV, parquet, MATLAB 5 to 7.3, HDF5, JSON"
    )
    parser.add_argument(
        "--kind",
        metavar="KIND",
        default="",
        help="what was recorded: bench, muscle, cylinder or joint (default: guessed)",
    )
    parser.add_argument(
        "--sim",
        metavar="MODEL",
        help="a MuJoCo model (.xml), an FMU, a python-control system (FILE.py:NAME), or a simulator file (.toml): find "
        "the columns of its ports, and write a simulator file if there is none",
    )
    add_trust_option(parser)
    parser.add_argument(
        "--equation",
        metavar="LEFT=RIGHT",
        action="append",
        default=[],
        help="equation of your own system, such as 'dh/dt = v' or 'F = A*p'; its names are columns, or parameters of "
        "--set; repeatable",
    )
    parser.add_argument(
        "--signal",
        metavar="SIGNAL=COLUMN[*FACTOR][:UNIT[:gauge]]",
        action="append",
        default=[],
        help="column of a signal, by name or by position from 0, with its unit; repeatable",
    )
    parser.add_argument(
        "--set",
        metavar="NAME=VALUE",
        action="append",
        default=[],
        help="parameter of the simulator file, in SI or with a unit ('25 mm'); repeatable",
    )
    parser.add_argument(
        "--constant",
        metavar="NAME=VALUE[@FILES]",
        action="append",
        default=[],
        help="signal that is constant in this log, such as eps=0.04 or length='17.45 cm', or in files that match a "
        "pattern: length='17.45 cm@*kinked25*'; repeatable",
    )
    parser.add_argument(
        "--assume",
        choices=("gauge", "absolute"),
        help="whether pressures are gauge or absolute where name, unit, range and force do not show it",
    )
    parser.add_argument("--encoding", metavar="NAME", help="encoding of text files, such as big5 (default: detected)")
    parser.add_argument("--out", metavar="DIR", default=".", help="folder for the two files (default: this one)")
    parser.add_argument("--yes", action="store_true", help="ask nothing, accept all proposals")
    parser.add_argument("--force", action="store_true", help="replace existing files")


def run(args: argparse.Namespace) -> int:
    """Run the command."""
    try:
        return _run(args)
    except PamidError as error:
        error.page = "docs/first_hour.md#describe-it"
        raise


def _of_model(args: argparse.Namespace) -> int:
    """Write the mapping of a log where names, units or the clock need one, and the page of a model that has none."""
    from ...simulators.page import MODELS, bare_model
    from ...systems.draft import draft_for
    from .._clock import count_as_simulated, count_seconds
    from .._models import (
        by_source,
        columns_of,
        declare_model,
        is_plain,
        join,
        lacking,
        model_page,
        take,
        with_units,
        without_column,
    )

    model, code = Path(args.sim), coded(args.sim, args.trust)
    given_page = code is None and model.suffix.lower() not in MODELS
    draft = draft_for(args.log, encoding=args.encoding)
    simulator = code or (outline(model, args.trust) if given_page else bare_model(model))
    draft.own_page = model if given_page else None
    draft.clear()
    declare_model(draft, simulator)
    if simulator.kind != "mujoco":  # a mechanism moves too fast for one row a second
        count_seconds(draft)
    for pair in args.signal:
        assign(draft, by_source(simulator, pair))
    hold(draft, pairs([by_source(simulator, pair) for pair in args.constant], "--constant"))
    found, doubts = columns_of(draft, simulator)
    columns = {m.port: m.column for m in found}
    if not given_page:
        join(draft, simulator, found)
    if (
        not given_page
        and not (args.encoding or args.constant)
        and is_plain(draft, found)
        and not doubts
        and not lacking(simulator, columns, doubts)
    ):
        return _page_alone(args, draft, columns, simulator)
    folder = checked_folder(args, FILES[:1] if given_page else FILES)
    take(draft, simulator, found, doubts)
    draft.settle()
    if args.trust or not simulator.executes:
        count_as_simulated(draft, simulator)
    if not given_page:
        with_units(draft, simulator)
    log = tried(draft, draft.read)
    known = {p.name: p.source for p in simulator.ports if draft.of(p.source) is not None or p.source in draft.fixed()}
    missing = lacking(simulator, known, doubts)
    if not given_page:
        draft.page = model_page(simulator, known, folder, mapped=True)
    if not args.json:
        show(draft)
    doubt = "" if missing else without_column(draft, simulator, doubts)
    if args.trust and given_page and not missing:
        _try(simulator, log)
    tell(args, draft, log, write(draft, folder), doubt, missing)
    return DONE


def _try(simulator: Simulator, log: pd.DataFrame) -> None:
    """Warn if a simulator that may run does not repeat itself."""
    from ...simulators.port_log import port_log
    from ...simulators.steadiness import tell_if_unsteady

    with contextlib.suppress(PamidError):  # reported where the simulator is compared with the log
        tell_if_unsteady(simulator, port_log(log, simulator))


def _page_alone(args: argparse.Namespace, draft: Draft, columns: dict[str, str], simulator: Simulator) -> int:
    """Write the page of a model that names the columns itself."""
    from .._models import model_page

    folder = check_folder(args.out, ("sim.toml",))
    page = folder / "sim.toml"
    if page.exists() and not args.force:
        raise OutputError(f"{page} already exists.", "a new path", "Add --force to replace it.")
    tried(draft, draft.read)
    with replacing_together(folder, ("sim.toml",)) as stage:
        write_whole(stage / "sim.toml", model_page(simulator, columns, folder, mapped=False))
    follow = following(args.log, f"--sim {quoted([page])}{trusted(draft)}", folder)
    unknown = [port.name for port in draft.ports if port.name not in columns]
    if args.json:
        files = {"sim.toml": str(page)}
        more = {"next": follow[-1], "commands": follow}
        print_json({"files": files, "columns": columns, "without_column": unknown, **more})
        return 0
    rows = [[port, column] for port, column in columns.items()] + [[port, "-"] for port in unknown]
    print(table(["port", "column"], rows))
    print(f"\nwrote {page}: correct what is ASSUMED, and give tolerances")
    show_commands(follow)
    return 0


def _run(args: argparse.Namespace) -> int:
    if args.sim:
        return _of_model(args)
    if args.equation:
        return _of_equations(args)
    from ...systems.draft import draft_for, given_numbers, kinds

    folder = checked_folder(args)
    ask = Asker(sys.stdin.isatty() and not (args.yes or args.json))
    given = pairs(args.set, "--set")
    draft = draft_for(args.log, args.kind, list(given), args.encoding)
    if not draft.kind:
        if not args.json:
            show(draft)
        if not ask.interactive:
            raise ParameterError(
                f"The columns {names(draft)} do not show what was recorded.",
                f"--kind {', '.join(kinds())}",
                "Add --kind, and --signal for columns whose names say nothing. For any other system name its simulator "
                "(--sim) or its equations (--equation).",
            )
        draft = draft_for(args.log, ask.choice("What was recorded?", kinds(), "muscle"), encoding=args.encoding)
    for pair in args.signal:
        assign(draft, pair)
    draft.numbers = given_numbers(given, draft.kind)
    hold(draft, pairs(args.constant, "--constant"))
    draft.settle()
    if ask.interactive:
        show(draft)
    try:
        ask_for_columns(draft, ask)
        draft.settle()
        ask_for_units(draft, ask)
        refer(draft, ask, args.assume)
    finally:
        if not (ask.interactive or args.json):
            show(draft)
    ask_for_numbers(draft, ask)
    draft.settle()
    log = tried(draft, draft.read)
    said = disagreement(draft, log)
    tell(args, draft, log, write(draft, folder), said)
    return 0


def _of_equations(args: argparse.Namespace) -> int:
    """Write the page of equations, and the mapping of their log."""
    from ...systems.draft import draft_for
    from .._clock import count_as_simulated, count_seconds
    from .._equations import declare_equations, settle_equations, split_equations

    if args.kind:
        raise ParameterError("--kind and --equation are given.", "one of them", "Leave --kind out.")
    folder, equations, numbers = checked_folder(args), split_equations(args.equation), pairs(args.set, "--set")
    draft, ask = draft_for(args.log, encoding=args.encoding), Asker(False)
    draft.clear()
    declare_equations(draft, equations, numbers)  # names mean what the equations say
    count_seconds(draft)
    for pair in args.signal:
        assign(draft, pair)
    hold(draft, pairs(args.constant, "--constant"))
    try:
        simulator = settle_equations(draft, equations, numbers)
        count_as_simulated(draft, simulator)
        ask_for_columns(draft, ask)
        refer(draft, ask, args.assume)
    finally:
        if not args.json:
            show(draft)
    log = tried(draft, draft.read)
    tell(args, draft, log, write(draft, folder), "")
    return 0
