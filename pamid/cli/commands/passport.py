"""``pamid passport``: test the parameters of a passport on the log of another system."""

import argparse
from pathlib import Path
from typing import Any

from ...file_sets import check_folder
from .._progress import progress
from .._simulators import add_trust_option
from ..common import DONE, add_command, add_log_options, any_simulator_of, load_log, print_json, table

_DESCRIPTION = """\
Test a parameter passport, written by 'pamid diagnose --after', on a log of another system, or of the same one on
another day: which parameters agree, which differ by more than the errors of both, which this log does not determine,
and which signals leave the range for which the passport is valid. SIM is the corrected simulator, corrected.toml, or
the fitted one if nothing was missing.

With --out, the passport is written there with this system added.
"""
_EXAMPLES = """\
  pamid passport opinion/passport.toml other.csv --sim opinion/corrected.toml --out second
  pamid passport opinion/passport.toml other.csv --columns columns.toml --sim arm.xml --json
"""


def add_parser(subparsers: Any) -> None:
    """Add the command."""
    summary = "test fitted parameters (a passport) on another system"
    parser = add_command(subparsers, "passport", summary, _DESCRIPTION, _EXAMPLES)
    parser.add_argument("passport", metavar="PASSPORT.toml", help="passport written by 'pamid diagnose --after'")
    add_log_options(parser)
    parser.add_argument("--sim", metavar="SIM", required=True, help="the corrected simulator")
    parser.add_argument("--name", metavar="NAME", help="name of the system in this log (default: the file's)")
    parser.add_argument("--out", metavar="DIR", help="folder for the passport with this system added")
    add_trust_option(parser)


def run(args: argparse.Namespace) -> int:
    """Run the command."""
    from ...opinion import Passport

    folder = check_folder(args.out, ("passport.toml", "passport.html")) if args.out else None
    known = Passport.read(args.passport)
    simulator = any_simulator_of(args)
    log = load_log(args, simulator=simulator)
    with progress(args, "Checking") as step:
        step("fit the passport's numbers to the log")
        found = known.check(log, simulator, args.name or Path(args.log[0]).stem)
    rig = found.rigs[-1]
    files = found.write(folder) if folder is not None else []
    if args.json:
        print_json({"rig": rig.name, "status": rig.status, "values": rig.values, "outside": rig.outside})
        return DONE
    rows = [
        [n, f"{known.numbers[n].value:.5g}", f"{value:.5g} ± {half:.2g}", known.numbers[n].unit, rig.status[n]]
        for n, (value, half) in rig.values.items()
    ]
    print(table(["number", "passport", rig.name, "unit", ""], rows))
    if rig.outside:
        print(f"\n{rig.name} leaves the range of {', '.join(rig.outside)}: the passport says nothing there.")
    for file in files:
        print(f"wrote {file}")
    return DONE
