"""A draft of a mapping and a simulator file: what is asked, what is shown, what is written."""

from __future__ import annotations

import argparse
import shlex
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import (
    MappingError,
    MissingColumnError,
    OutputError,
    PamidError,
    ParameterError,
    PressureReferenceError,
    TimeOrderError,
    UnitError,
)
from ..file_sets import check_folder, replacing_together
from ..files import write_whole
from ..signals.headers import read_header
from ..signals.unit_names import parse_quantity
from .common import note, print_json, table

if TYPE_CHECKING:
    from ..signals.guess import Guess
    from ..systems.base import Input
    from ..systems.draft import Draft

FILES = ("columns.toml", "sim.toml")


def hold(draft: Draft, constants: dict[str, str]) -> None:
    """Take the signals that stand still, in all files or in those that a pattern names."""
    if period := constants.pop("sampling_period", ""):
        parse_quantity(period, "time")
        draft.settings["sampling_period"] = period
    for name, text in constants.items():
        for entry in text.split("\0"):
            value, at, pattern = entry.partition("@")
            place = draft.file_constants.setdefault(pattern.strip(), {}) if at else draft.constants
            place[name] = value.strip()


class Asker:
    """Asks a person, or takes the defaults."""

    def __init__(self, interactive: bool) -> None:
        self.interactive = interactive

    def text(self, question: str, default: str, check: Callable[[str], object] | None = None) -> str:
        """Ask for a text until it passes a check; return the default where nobody answers."""
        while self.interactive:
            sys.stderr.write(f"{question}{f' [{default}]' if default else ''}: ")
            sys.stderr.flush()
            line = sys.stdin.readline()
            if not line:  # the input has ended
                break
            answer = line.strip() or default
            if check is None:
                return answer
            try:
                check(answer)
            except PamidError as error:
                sys.stderr.write(f"  {error}\n")
                continue
            return answer
        return default

    def choice(self, question: str, offered: Sequence[str], default: str) -> str:
        """Ask for one of several words."""

        def known(answer: str) -> None:
            if answer not in offered:
                raise PamidError(f"{answer!r} is not one of them.", ", ".join(offered), "")

        return self.text(f"{question} ({', '.join(offered)})", default, known)


# --- asking -------------------------------------------------------------------------------------------------
def show(draft: Draft) -> None:
    named = draft.table.named
    rows = [
        [
            str(g.column)[:30] if named else str(g.column),
            f"{g.low:.4g}" if g.low == g.low else "text",
            f"{g.high:.4g}" if g.high == g.high else "",
            g.signal or "-",
            unit(g),
            _how(draft, g),
        ]
        for g in draft.guesses
    ]
    print(table(["column" if named else "position", "lowest", "highest", "signal", "unit", ""], rows) + "\n")


def _how(draft: Draft, guess: Guess) -> str:
    from ..simulators.written_units import in_si

    if guess.signal in draft.supposed:
        return draft.supposed[guess.signal]
    said = read_header(guess.column).unread if isinstance(guess.column, str) and guess.unit is None else ""
    return (
        f"given; '{said}' is not a known unit"
        if guess.why == "given" and guess.signal and guess.scale == 1.0 and said and not in_si(said)
        else "given"
        if guess.why == "given"
        else "?"
        if guess.question
        else ""
        if guess.sure or not guess.signal
        else "assumed"
    )


def unit(guess: Any) -> str:
    if not guess.signal:
        return ""
    reference = {True: " gauge", False: " absolute"}.get(guess.gauge, "")
    return (guess.unit or ("as it is" if guess.scale == 1.0 else f"times {guess.scale:.4g}")) + reference


def names(draft: Draft) -> str:
    return ", ".join(str(g.column) for g in draft.guesses[:12])


def ask_for_columns(draft: Draft, ask: Asker) -> None:
    for wanted in draft.lacking():

        def known(answer: str, wanted: Input = wanted) -> None:
            if answer != "none":
                assign(draft, f"{wanted.name}={answer}")

        ask.text(f"Which column is {wanted.name}, the {wanted.meaning}? (column[:unit], or none)", "none", known)
    if lacking := draft.lacking():
        against = [
            f"{g.column!r} does not fit: {g.why}"
            for g in draft.guesses
            if not g.signal and g.why.startswith("its unit")
        ]
        raise MissingColumnError(
            f"No column is known to be {', '.join(f'{i.name} ({i.meaning})' for i in lacking)}; the log has "
            f"{names(draft)}.{' ' + '; '.join(against) + '.' if against else ''}",
            f"the signals of {draft.title}: {', '.join(i.name for i in draft.inputs() if i.needed)}",
            way_out(draft, lacking),
        )


def way_out(draft: Draft, lacking: list[Input]) -> str:
    """Return the remedy for signals without a known column."""
    wanted = lacking[0]
    if wanted.name == "time":
        return (
            "Say which it is: --signal time=COLUMN:UNIT; if the log has no clock, give the time between its rows: "
            "--constant sampling_period='10 ms'."
        )
    if draft.kind == "muscle" and wanted.name == "eps":
        each = (
            "'length=17.45 cm@*25*' for each file, with the pattern of its name"
            if draft.paths[1:]
            else "length='17.45 cm'"
        )
        return (
            "Say which it is, for instance --signal length=COLUMN:mm; if the muscle is held still, give its length by "
            f"--constant {each}, and --set rest_length='18.2 cm'."
        )
    if draft.kind == "joint" and wanted.name in ("drive", "gain"):
        return (
            "Say what drives it: --signal drive=COLUMN, or the reference angle of a controller and its gain: "
            f"--signal q_ref=COLUMN --set gain=NUMBER.{_beside(draft)}"
        )
    each = " ".join(f"--signal {i.name}=COLUMN:UNIT" for i in lacking)
    return f"Say which it is: {each}{'' if draft.ports else ', or choose another --kind'}."


def _beside(draft: Draft) -> str:
    """Return the numbers in a file beside its samples, such as the gain of a controller."""
    held = {k: v for k, v in draft.table.head.items() if isinstance(v, int | float) and not isinstance(v, bool)}
    if not held:
        return ""
    shown = ", ".join(f"{k} = {v:g}" for k, v in list(held.items())[:8])
    return f" Besides the samples, the file holds {shown}. If one is the gain, add --signal gain=NAME*FACTOR."


def ask_for_units(draft: Draft, ask: Asker) -> None:
    for guess in [g for g in draft.guesses if g.signal and (g.question or not g.sure)]:
        shown = f"{guess.signal} (column {guess.column}) goes from {guess.low:.4g} to {guess.high:.4g}. Unit?"
        if guess.question:
            shown = f"{sentence(guess.question)}. Unit of column {guess.column} as {guess.signal}?"

        def usable(answer: str, guess: Any = guess) -> None:
            unit, _, reference = (
                answer.rpartition(" ") if answer.endswith((" gauge", " absolute")) else (answer, "", "")
            )
            assign(draft, f"{guess.signal}={guess.column}:{unit}:{reference}".rstrip(":"))

        if ask.interactive:
            ask.text(shown, guess.unit or "", usable)
    if left := [g for g in draft.guesses if g.signal and g.question]:
        raise MappingError(
            f"{'; '.join(sentence(g.question) for g in left)}.",
            "one column with a known unit for each signal",
            f"State it, for instance {option(left[0])}.",
        )


def sentence(text: str) -> str:
    return text[:1].upper() + text[1:]


def option(guess: Guess, unit: str = "") -> str:
    return f"--signal {shlex.quote(f'{guess.signal}={guess.column}')}:{unit or guess.unit or 'UNIT'}"


def refer(draft: Draft, ask: Asker, assume: str | None) -> None:
    """Settle whether pressures are gauge or absolute: by what they say, by their force, or by asking."""
    open_ = [g for g in draft.pressures() if not g.settled]
    named = [g for g in draft.pressures() if g.gauge is not None and g.why == "its name" and g.signal == "P"]
    found = tried(draft, draft.reference) if open_ or named else None
    doubtful = [g for g in named if found is not None and g.gauge != found]
    if found is not None and not doubtful:
        draft.refer(found, f"{'gauge' if found else 'absolute'}, judged by the measured force")
    open_ = doubtful or [g for g in draft.pressures() if not g.settled]
    if not open_:
        return
    if assume is not None:
        draft.refer(assume == "gauge", "given", doubtful)
        return
    first = open_[0]
    unit = "Pa" if first.unit is None else first.unit
    said = (
        " is gauge or absolute: its name says one, but the measured force suggests the other"
        if doubtful
        else " may be gauge or absolute: both are possible"
    )
    text = f"{first.signal} (column {first.column!r}, {first.low:.4g} to {first.high:.4g} {unit}){said}"
    answer = ask.choice(f"{text}. Which?", ("gauge", "absolute"), "") if ask.interactive else ""
    if not answer:
        raise PressureReferenceError(
            f"{text}.",
            "gauge (0 at ambient pressure) or absolute (1.013 bar there)",
            f"Add --assume gauge or --assume absolute, or state it for the column: {option(first, unit)}:gauge.",
        )
    draft.refer(answer == "gauge", "given", doubtful)


def ask_for_numbers(draft: Draft, ask: Asker) -> None:
    from ..systems import all_systems
    from ..systems.bench_page import MEANING
    from ..systems.draft import given_numbers

    if not ask.interactive:
        return
    quantities = {} if draft.kind == "bench" else {q.name: q for q in all_systems()[draft.kind].quantities}
    for name in draft.assumed():
        q = quantities.get(name)
        what = f"{q.meaning}, {q.unit}" if q else MEANING.get(name, "")

        def usable(answer: str, name: str = name) -> None:
            if answer:
                draft.numbers |= given_numbers({name: answer}, draft.kind)

        ask.text(f"{name} ({what}; SI or with a unit, empty: assume a typical one)", "", usable)


def assign(draft: Draft, pair: str) -> None:
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
    own = column in map(str, draft.table.frame.columns)  # a * may be part of a name
    column, star, factor = ("", "", column) if own else column.rpartition("*")
    try:
        column, scale = (column, float(factor)) if star else (factor, 1.0)
    except ValueError:
        raise ParameterError(
            f"--signal got the factor {factor!r}.", "a number", "Write for instance kp*0.005."
        ) from None
    draft.assign(signal.strip(), column, unit, reference, scale)


def pairs(texts: list[str], option: str) -> dict[str, str]:
    found: dict[str, str] = {}
    for text in texts:
        name, equals, value = text.partition("=")
        if not equals or not name.strip() or not value.strip():
            raise ParameterError(f"{option} got {text!r}.", "name=value", f"Write for instance {option} bore='25 mm'.")
        clean = value.strip().strip("\"'")
        found[name.strip()] = f"{found[name.strip()]}\0{clean}" if "@" in value and name.strip() in found else clean
    return found


# --- writing ------------------------------------------------------------------------------------------------
def checked_folder(args: argparse.Namespace, files: Sequence[str] = FILES) -> Path:
    folder = check_folder(args.out, tuple(files), parents=True)
    there = [name for name in files if (folder / name).exists()]
    if there and not args.force:
        raise OutputError(
            f"{' and '.join(str(folder / name) for name in there)} already exist.",
            "a folder without them",
            "Choose another --out, or add --force to replace them.",
        )
    return folder


def tried(draft: Draft, read: Callable[[], Any]) -> Any:
    """Read the logs with the new mapping, before anything is written."""
    try:
        return read()
    except PamidError as error:
        runs = [f"--signal trajectory={shlex.quote(str(n))}" for n in draft.run_names()]
        numbered = isinstance(error, TimeOrderError) and runs
        remedy = f"If a column contains the number of the run: {' or '.join(runs)}." if numbered else ""
        raise type(error)(
            f"With the proposed mapping: {error.found}",
            error.expected,
            remedy or f"{error.remedy} --signal names column and unit.",
        ) from None


def disagreement(draft: Draft, log: Any) -> str:
    """Return the contradiction between force, pressure and size; raise where a unit was only assumed."""
    doubt = draft.doubt(log)
    unsure = [g for g in draft.guesses if g.signal in ("P", "F") and not g.sure]
    if doubt and unsure:
        raise UnitError(
            f"{doubt}; the unit of {' and '.join(g.signal for g in unsure)} is only assumed.",
            "units with which force, pressure and size agree",
            f"State them: {' '.join(option(g, 'UNIT') for g in unsure)}.",
        )
    return doubt


def write(draft: Draft, folder: Path) -> list[Path]:
    texts = {"columns.toml": draft.columns_text()}
    if draft.own_page is None:
        texts["sim.toml"] = draft.page_text()
    with replacing_together(folder, tuple(texts), parents=True) as stage:
        for name, text in texts.items():
            write_whole(stage / name, text)
    return [folder / name for name in texts]


def quoted(paths: Sequence[str | Path]) -> str:
    return " ".join(shlex.quote(str(Path(p))) for p in paths)


def trusted(draft: Draft) -> str:
    """Return the option by which a model's own code may run."""
    return " --trust" if draft.runs_code else ""


def tell(
    args: argparse.Namespace, draft: Draft, log: Any, files: list[Path], doubt: str, missing: Sequence[str] = ()
) -> None:
    unsure = [g.signal for g in draft.guesses if g.signal and not g.sure]
    guessed = list(draft.supposed)
    assumed = list(draft.assumed())
    follow: list[str] = []
    if not missing:
        options = f"--columns {quoted([files[0]])} --sim {quoted([draft.own_page or files[1]])}{trusted(draft)}"
        follow = [f"pamid check {quoted(args.log)} {options}"]
        follow = following(args.log, options, files[0].parent) if draft.ports else follow
    if args.json:
        print_json(
            {
                "kind": draft.kind,
                "files": {path.name: str(path) for path in files},
                "signals": draft.mapping()["signals"],
                "assumed": {"units": unsure, "numbers": assumed, **({"signals": draft.supposed} if guessed else {})},
                **({"missing": list(missing)} if missing else {}),
                "rows": len(log),
                "trajectories": [str(name) for name in log["trajectory"].unique()],
                "doubts": [doubt] if doubt else [],
                "next": follow[-1] if follow else "",
                **({"commands": follow} if follow else {}),
            }
        )
        return
    rows = [
        [name, f"{log[name].min():.5g}", f"{log[name].max():.5g}", shown_unit(draft, name)]
        for name in log.columns
        if name != "trajectory"
    ]
    print(f"{len(log):,} rows in {log['trajectory'].nunique()} run(s) of {draft.title}, read as:")
    print(table(["signal", "lowest", "highest", "unit"], rows) + "\n")
    for path in files:
        print(f"wrote {path}")
    if unsure or assumed or guessed:
        what = ", ".join([*(f"the unit of {s}" for s in unsure), *assumed, *(f"the column of {s}" for s in guessed)])
        note(args, f"assumed: {what}. Look for ASSUMED in the files; correct or confirm it.")
    if doubt:
        note(args, f"{doubt}. Correct it before you use this log.")
    if missing:
        print("\nThis log and simulator cannot be compared yet. Run init again with --force:", *missing, sep="\n  ")
        return
    print()
    show_commands(follow)


def following(logs: Sequence[str | Path], options: str, folder: Path) -> list[str]:
    """Return the commands for logs and a simulator with ports: first how far off it is, then why."""
    given = f"{quoted(logs)} {options}"
    return [f"pamid evaluate {given}", f"pamid diagnose {given} --out {quoted([folder / 'diagnosis'])}"]


def show_commands(commands: Sequence[str]) -> None:
    for command in commands:
        print(f"next: {command}")


def shown_unit(draft: Draft, name: str) -> str:
    return next((i.unit for i in draft.inputs() if i.name == name), "")
