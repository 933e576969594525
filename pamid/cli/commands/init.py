"""``pamid init``: a commented simulator file and a mapping of columns for somebody's own log."""

from __future__ import annotations

import argparse
import contextlib
import shlex
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ...errors import MissingColumnError, OutputError, PamidError, ParameterError
from .._ask import Asker
from ..common import add_command, note, print_json, table

if TYPE_CHECKING:
    from ...systems.base import Input
    from ...systems.draft import Draft

FILES = ("columns.toml", "sim.toml")

_DESCRIPTION = """\
Look at a log of any names and units, and write the two files that every other command takes:

  columns.toml   which column is which signal, and in which unit it is
  sim.toml       the numbers of the bench, cylinder, joint or muscle that was recorded, with comments

Names and units are guessed from the columns' names and ranges. On a terminal you are asked what cannot be known;
elsewhere, or with --yes, what is not given is assumed and marked ASSUMED in the files. The log is read once with the
new mapping before anything is written.
"""
_EXAMPLES = """\
  pamid init run1.csv                                              asks what it cannot know
  pamid init run1.csv --kind muscle --set rest_length='200 mm' --set rest_diameter='20 mm' --yes
  pamid init *.csv --kind cylinder --signal time=0:ms --signal x=4:mm --signal P=5:bar:gauge --signal F=6:N \\
      --set bore='25 mm' --yes --out setup                         a log without names of columns
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
        help="number of the simulator file, in SI or with a unit ('25 mm'); repeatable",
    )
    parser.add_argument(
        "--constant",
        metavar="NAME=VALUE",
        action="append",
        default=[],
        help="signal that stands still in this log, such as eps=0.04 or length='17.45 cm'; repeatable",
    )
    parser.add_argument("--out", metavar="DIR", default=".", help="folder for the two files (default: this one)")
    parser.add_argument("--yes", action="store_true", help="ask nothing, take what is proposed")
    parser.add_argument("--force", action="store_true", help="replace files that exist")


def run(args: argparse.Namespace) -> int:
    """Run the command."""
    try:
        return _run(args)
    except PamidError as error:
        error.page = "docs/first_hour.md#describe-it"
        raise


def _run(args: argparse.Namespace) -> int:
    from ...systems.draft import draft_for, given_numbers, kinds

    folder = _checked_folder(args)
    ask = Asker(sys.stdin.isatty() and not (args.yes or args.json))
    draft = draft_for(args.log, args.kind)
    if not args.json:
        _show(draft)
    if not draft.kind:
        if not ask.interactive:
            raise ParameterError(
                f"The columns {_names(draft)} do not tell what was recorded.",
                f"--kind {', '.join(kinds())}",
                "Add --kind, and --signal for columns whose names say nothing.",
            )
        draft = draft_for(args.log, ask.choice("What was recorded?", kinds(), "muscle"))
    for pair in args.signal:
        _assign(draft, pair)
    draft.numbers = given_numbers(_pairs(args.set, "--set"), draft.kind)
    draft.constants = _pairs(args.constant, "--constant")
    if "length" in draft.constants and "rest_length" in draft.numbers:
        draft.constants.setdefault("rest_length", f"{draft.numbers['rest_length']} m")
    _ask_for_columns(draft, ask)
    _ask_for_units(draft, ask)
    _ask_for_numbers(draft, ask)
    draft.settle()
    log = _tried(draft)
    files = _write(draft, folder)
    _tell(args, draft, log, files)
    return 0


# --- asking -------------------------------------------------------------------------------------------------
def _show(draft: Draft) -> None:
    named = draft.table.named
    rows = [
        [
            str(g.column)[:30] if named else str(g.column),
            f"{g.low:.4g}" if g.low == g.low else "text",
            f"{g.high:.4g}" if g.high == g.high else "",
            g.signal or "-",
            _unit(g),
            "" if g.sure else "assumed",
        ]
        for g in draft.guesses
    ]
    print(table(["column" if named else "position", "lowest", "highest", "signal", "unit", ""], rows) + "\n")


def _unit(guess: Any) -> str:
    if not guess.signal:
        return ""
    reference = {True: " gauge", False: " absolute"}.get(guess.gauge, "")
    return (guess.unit or "as it is") + reference


def _names(draft: Draft) -> str:
    return ", ".join(str(g.column) for g in draft.guesses[:12])


def _ask_for_columns(draft: Draft, ask: Asker) -> None:
    for wanted in draft.lacking():

        def known(answer: str, wanted: Input = wanted) -> None:
            if answer != "none":
                _assign(draft, f"{wanted.name}={answer}")

        ask.text(f"Which column is {wanted.name}, the {wanted.meaning}? (column[:unit], or none)", "none", known)
    if lacking := draft.lacking():
        first = lacking[0]
        raise MissingColumnError(
            f"No column is known to be {', '.join(f'{i.name} ({i.meaning})' for i in lacking)}; the log has "
            f"{_names(draft)}.",
            f"the signals of a {draft.kind}: {', '.join(i.name for i in draft.inputs() if i.needed)}",
            f"Say which it is, for instance --signal {first.name}=COLUMN:UNIT, or choose another --kind.",
        )


def _ask_for_units(draft: Draft, ask: Asker) -> None:
    for guess in [g for g in draft.guesses if g.signal and not g.sure]:
        shown = f"{guess.signal} (column {guess.column}) goes from {guess.low:.4g} to {guess.high:.4g}. Unit?"

        def usable(answer: str, guess: Any = guess) -> None:
            unit, _, reference = answer.partition(" ")
            _assign(draft, f"{guess.signal}={guess.column}:{unit}:{reference}".rstrip(":"))

        if ask.interactive:
            ask.text(shown, _unit(guess) if guess.unit else "", usable)


def _ask_for_numbers(draft: Draft, ask: Asker) -> None:
    from ...systems import all_systems
    from ...systems.bench_page import _MEANING
    from ...systems.draft import given_numbers

    if not ask.interactive:
        return
    quantities = {} if draft.kind == "bench" else {q.name: q for q in all_systems()[draft.kind].numbers}
    for name in draft.assumed():
        q = quantities.get(name)
        what = f"{q.meaning}, {q.unit}" if q else _MEANING.get(name, "")

        def usable(answer: str, name: str = name) -> None:
            if answer:
                draft.numbers |= given_numbers({name: answer}, draft.kind)

        ask.text(f"{name} ({what}; SI or with a unit, empty: assume a typical one)", "", usable)


def _assign(draft: Draft, pair: str) -> None:
    signal, equals, rest = pair.partition("=")
    if not equals or not signal or not rest:
        raise ParameterError(
            f"--signal got {pair!r}.", "signal=column:unit", "Write for instance --signal P=pressure:bar:gauge."
        )
    column, reference = rest, ""
    if rest.rpartition(":")[2] in ("gauge", "absolute"):
        column, _, reference = rest.rpartition(":")
    column, colon, unit = column.rpartition(":")
    column, unit = (column, unit) if colon else (unit, "")
    column, star, factor = column.rpartition("*")
    try:
        column, scale = (column, float(factor)) if star else (factor, 1.0)
    except ValueError:
        raise ParameterError(
            f"--signal got the factor {factor!r}.", "a number", "Write for instance kp*0.005."
        ) from None
    draft.assign(signal.strip(), column, unit, reference, scale)


def _pairs(texts: list[str], option: str) -> dict[str, str]:
    found = {}
    for text in texts:
        name, equals, value = text.partition("=")
        if not equals or not name.strip() or not value.strip():
            raise ParameterError(f"{option} got {text!r}.", "name=value", f"Write for instance {option} bore='25 mm'.")
        found[name.strip()] = value.strip().strip("\"'")
    return found


# --- writing ------------------------------------------------------------------------------------------------
def _checked_folder(args: argparse.Namespace) -> Path:
    folder = Path(args.out)
    if folder.exists() and not folder.is_dir():
        raise OutputError(f"{folder} is a file.", "a folder", "Choose another --out.")
    there = [name for name in FILES if (folder / name).exists()]
    if there and not args.force:
        raise OutputError(
            f"{' and '.join(str(folder / name) for name in there)} exist already.",
            "a folder without them",
            "Choose another --out, or add --force to replace them.",
        )
    return folder


def _tried(draft: Draft) -> Any:
    """Read the logs with the new mapping, before anything is written."""
    from ...signals import read_log

    try:
        return read_log(draft.paths, draft.mapping(), nan="keep", sampling="ignore")
    except PamidError as error:
        raise type(error)(
            f"With the proposed mapping: {error.found}",
            error.expected,
            f"{error.remedy} --signal names column and unit.",
        ) from None


def _write(draft: Draft, folder: Path) -> list[Path]:
    from ...files import write_whole

    texts = {"columns.toml": draft.columns_text(), "sim.toml": draft.page_text()}
    new = [name for name in FILES if not (folder / name).exists()]
    written: list[Path] = []
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name, text in texts.items():
            written.append(write_whole(folder / name, text))
    except OSError as error:
        for path in written:
            if path.name in new:
                with contextlib.suppress(OSError):
                    path.unlink()
        if isinstance(error, OutputError):
            raise
        raise OutputError(
            f"{folder} cannot be made: {error.strerror}.", "a folder that can be written to", "Choose another --out."
        ) from None
    return written


def _tell(args: argparse.Namespace, draft: Draft, log: Any, files: list[Path]) -> None:
    unsure = [g.signal for g in draft.guesses if g.signal and not g.sure]
    assumed = list(draft.assumed())
    names = [Path(p) for p in args.log]
    options = f"--columns {shlex.quote(str(files[0]))} --sim {shlex.quote(str(files[1]))}"
    follow = f"pamid check {' '.join(shlex.quote(str(p)) for p in names)} {options}"
    if args.json:
        print_json(
            {
                "kind": draft.kind,
                "files": {path.name: str(path) for path in files},
                "signals": draft.mapping()["signals"],
                "assumed": {"units": unsure, "numbers": assumed},
                "rows": len(log),
                "trajectories": [str(name) for name in log["trajectory"].unique()],
                "next": follow,
            }
        )
        return
    rows = [
        [name, f"{log[name].min():.5g}", f"{log[name].max():.5g}", _shown_unit(draft, name)]
        for name in log.columns
        if name != "trajectory"
    ]
    print(f"{len(log):,} rows in {log['trajectory'].nunique()} run(s) of a {draft.kind}, read as:")
    print(table(["signal", "lowest", "highest", "unit"], rows) + "\n")
    for path in files:
        print(f"wrote {path}")
    if unsure or assumed:
        what = ", ".join([*(f"the unit of {s}" for s in unsure), *assumed])
        note(args, f"assumed: {what}. Look for ASSUMED in the files and correct it.")
    print(f"\nnext: {follow}")


def _shown_unit(draft: Draft, name: str) -> str:
    return next((i.unit for i in draft.inputs() if i.name == name), "")
