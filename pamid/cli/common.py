"""What the commands share: common options, output for people and machines, progress."""

from __future__ import annotations

import argparse
import ast
import contextlib
import json
import math
import shutil
import sys
import textwrap
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import OutputError, ParameterError, UnknownOptionError
from ..files import PROBE, check_file
from ..json_data import json_ready
from ._style import plain

if TYPE_CHECKING:
    import pandas as pd

    from ..bench.parameters import BenchParameters
    from ..signals import LogMapping


DONE, OWN_ERROR, WRONG_USE, UNTESTED, INTERRUPTED, TERMINATED = 0, 1, 2, 3, 130, 143
"""Exit codes: done; an error of pamid itself; wrong use or input; nothing could be tested; interrupted; ended."""


def add_command(subparsers: Any, name: str, summary: str, description: str, examples: str) -> argparse.ArgumentParser:
    """Add a command with the common options."""
    parser = subparsers.add_parser(
        name,
        help=summary,
        description=description,
        epilog=f"examples:\n{examples.rstrip()}\n\n"
        "exit codes: 0 done, 1 a bug in pamid, 2 wrong usage or input, 3 nothing could be tested,\n"
        "130 interrupted, 143 terminated",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    common = parser.add_argument_group("common options")
    common.add_argument("--json", action="store_true", help="print the result as JSON on standard output, nothing else")
    common.add_argument("--quiet", action="store_true", help="no progress and no warnings")
    common.add_argument("--seed", type=_seed, default=0, metavar="N", help="random seed (default: 0)")
    common.add_argument("--debug", action="store_true", help="show the traceback of an error")
    return parser


def _seed(text: str) -> int:
    value = int(text)
    if not 0 <= value < 2**32:
        raise argparse.ArgumentTypeError(f"{text} is not a seed from 0 to {2**32 - 1}")
    return value


def add_log_options(parser: argparse.ArgumentParser) -> None:
    """Add the log and the mapping of its columns."""
    parser.add_argument(
        "log", metavar="LOG", nargs="+", help="log file(s) or folder: CSV, parquet, MATLAB 5 to 7.3, HDF5, JSON"
    )
    parser.add_argument(
        "--columns",
        metavar="MAPPING.toml",
        help="mapping of the log's columns and units to pamid's signals; not needed for SI units and pamid's names",
    )
    parser.add_argument("--encoding", metavar="NAME", help="encoding of text files, such as big5 (default: detected)")
    parser.add_argument(
        "--nan",
        choices=("raise", "drop", "keep"),
        default="keep",
        help="treatment of missing values (default: keep; time windows that contain one are not evaluated)",
    )


def mapping_of(args: argparse.Namespace, simulator: Any = None) -> LogMapping:
    """Read the mapping that the arguments name; ports of a simulator say themselves what their columns mean."""
    from ..signals.log import mapping_for

    mapping, _ = mapping_for(simulator, args.columns)
    return mapping if args.encoding is None else replace(mapping, encoding=args.encoding)


def load_log(
    args: argparse.Namespace, nan: str | None = None, simulator: Any = None, paths: Sequence[Path] | None = None
) -> pd.DataFrame:
    """Read the log that the arguments name; ports of a simulator say themselves what columns mean, and their units."""
    from ..signals import read_log

    return read_log(paths or args.log, args.columns, nan=nan or args.nan, encoding=args.encoding, simulator=simulator)


def load_pieces(
    args: argparse.Namespace, rows: int, nan: str | None = None, simulator: Any = None
) -> Iterator[pd.DataFrame]:
    """Read the log that the arguments name piece by piece, each of whole runs."""
    from ..signals import read_log_pieces

    return read_log_pieces(
        args.log, args.columns, rows=rows, nan=nan or args.nan, encoding=args.encoding, simulator=simulator
    )


def load_simulator(path: str) -> BenchParameters:
    """Read a simulator file of the bench."""
    from ..bench.parameters import BenchParameters
    from ..systems.file import kind_of_file

    if (kind := kind_of_file(path)) != "bench":
        raise UnknownOptionError(
            f"{path} is the simulator file of a {kind}.",
            "a simulator file of the bench, since this command simulates its joint and valves",
            "'check', 'evaluate', 'compare' and 'diagnose' take files of all kinds, 'fit' and 'adapt' those of "
            "muscles; 'pamid init --kind bench' writes one of the bench.",
        )
    return BenchParameters.from_toml(path)


def any_simulator_of(args: argparse.Namespace) -> Any:
    """Read the simulator of any kind that the arguments name, or the one in the log's folder; None without one."""
    from ..any_simulator import read_simulator

    _note_assumed(args)
    path = _page_path(args)
    return read_simulator(path, trust=bool(getattr(args, "trust", False))) if path else None


def page_of(args: argparse.Namespace) -> Any:
    """Read the simulator file of any kind that the arguments name, or the one in the log's folder; None without one."""
    from ..simulators import simulator_kinds
    from ..systems import read_system
    from ..systems.file import kind_of_file

    _note_assumed(args)
    path = _page_path(args)
    if path is None:
        return None
    if (kind := kind_of_file(path)) in simulator_kinds():
        raise UnknownOptionError(
            f"{path} is a simulator with ports, of the kind {kind}.",
            "the simulator file of a bench, a muscle, a cylinder or a joint",
            "'pamid diagnose' and 'pamid evaluate' take simulators with ports, and so do 'check' and 'resid'.",
        )
    return load_simulator(path) if kind == "bench" else read_system(path)


def _page_path(args: argparse.Namespace) -> str | None:
    """Return the simulator file that --sim names, or the one in the log's folder, saying so."""
    if args.sim:
        return str(args.sim)
    logs = [Path(p) for p in args.log]
    if len(logs) != 1 or args.columns:
        return None
    folder = logs[0] if logs[0].is_dir() else logs[0].parent
    for path in (logs[0].with_suffix(".sim.toml"), folder / "sim.toml"):
        if path.is_file():
            note(args, f"using the simulator {path}, found beside the log; --sim selects another")
            return str(path)
    return None


def page_numbers(page: Any, columns: str | None = None, kinds: Sequence[str] = ("muscle", "bench")) -> dict[str, Any]:
    """Return the numbers of a simulator file of a muscle, cylinder or joint; else the mapping's rest length."""
    from ..signals.mapping import LogMapping
    from ..signals.unit_names import parse_quantity

    if page is None:
        constants = LogMapping.load(columns).constants if columns else {}
        return {k: parse_quantity(constants[k], k) for k in ("rest_length",) if k in constants}
    if page.kind not in kinds:
        what = "contraction and pressure of a muscle" if "muscle" in kinds else f"the signals of a {kinds[0]}"
        raise UnknownOptionError(
            f"The simulator file is that of a {page.kind}.",
            f"the simulator file of a {' or a '.join(kinds)}, since this model reads {what}",
            f"For a {page.kind} fit {page.estimator} ('pamid fit LOG --sim SIM.toml --out MODEL.pamid').",
        )
    return {name: page.get(name) for name in page.names}


def _note_assumed(args: argparse.Namespace) -> None:
    """Remind of what 'pamid init' had to assume and nobody has replaced since."""
    for path in filter(None, (args.sim, args.columns)):
        if not Path(path).is_file():
            continue  # a reader of its content gives the better message
        try:
            with Path(path).open(encoding="utf-8") as stream:
                lines = [line.split("=")[0].strip() for line in stream if "ASSUMED" in line]
        except (OSError, UnicodeDecodeError):
            continue  # a reader of its content gives the better message
        if lines:
            note(args, f"{path} still assumes {', '.join(lines[:8])}: correct or confirm each, and remove ASSUMED")


def parse_settings(pairs: Sequence[str], option: str = "--set") -> dict[str, Any]:
    """Turn ``name=value`` texts into a dictionary; values are Python literals, anything else is text."""
    settings: dict[str, Any] = {}
    for pair in pairs:
        name, equals, text = pair.partition("=")
        if not equals or not name.strip():
            raise ParameterError(f"{option} got {pair[:60]!r}.", "name=value", "Write for instance max_iter=200.")
        try:
            settings[name.strip()] = ast.literal_eval(text.strip())
        except (ValueError, SyntaxError, MemoryError, RecursionError):
            settings[name.strip()] = {"true": True, "false": False, "none": None}.get(
                text.strip().lower(), text.strip()
            )
    return settings


# --- output -------------------------------------------------------------------------------------------------
def print_json(data: Any) -> None:
    """Print data as strict JSON."""
    print(json.dumps(json_ready(data), indent=2, ensure_ascii=False, allow_nan=False))


def table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return an aligned table: text to the left, numbers to the right."""
    header, rows = [plain(c) for c in header], [[plain(str(c)).replace("\n", " ") for c in row] for row in rows]
    widths = [max(len(str(row[k])) for row in [header, *rows]) for k in range(len(header))]
    right = [all(_is_number(row[k]) for row in rows) for k in range(len(header))]

    def line(cells: Sequence[str]) -> str:
        return "  ".join(c.rjust(w) if r else c.ljust(w) for c, w, r in zip(cells, widths, right, strict=True)).rstrip()

    return "\n".join([line(header), *(line(row) for row in rows)])


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return text in ("", "-")
    return True


def number(value: float) -> str:
    """Return a number with four digits, ``-`` for none."""
    return f"{value:.4g}" if math.isfinite(value) else "-"


def wrapped(word: str, text: str, width_of_word: int | None = None) -> str:
    """Return a text with a word before it, wrapped to the terminal; control characters of a log's names left out."""
    clean = "".join(c if c.isprintable() else " " for c in text)
    width = max(40, min(shutil.get_terminal_size((110, 24)).columns, 120))
    lines = textwrap.wrap(clean, width - 9) or [""]
    blank = " " * max(1, 9 - (len(word) if width_of_word is None else width_of_word))
    return "\n".join([word + blank + lines[0], *(" " * 9 + line for line in lines[1:])])


def note(args: argparse.Namespace, text: str) -> None:
    """Say something to people on standard error."""
    if not args.quiet:
        with contextlib.suppress(OSError):  # a note that nobody can read is no reason to fail
            print(f"pamid: {text}", file=sys.stderr, flush=True)


def checked_output(path: str, inputs: Iterable[str | None] = (), size: int = PROBE) -> Path:
    """Return the path of an output that can be written and is not an input, before anything expensive starts."""
    target = check_file(path, size)
    for read in inputs:
        if read and target.exists() and Path(read).exists() and target.samefile(read):
            raise OutputError(f"{target} is what this command reads.", "another file", "Choose another name.")
    return target
