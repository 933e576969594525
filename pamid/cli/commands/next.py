"""``pamid next``: the run, or a few, that best distinguish what a diagnosis left undecided."""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ...errors import ParameterError
from ...file_sets import check_folder, replacing_together
from ...files import write_whole
from ..common import DONE, add_command, note, number, print_json, progress, table, wrapped

if TYPE_CHECKING:
    from ...gap.design.plan import Plan

FILES = ("plan.json", "runs.toml", "set_points.csv")
"""What --out receives."""
_ROOM = 1 << 22
_DESCRIPTION = """\
Design the next run after 'pamid diagnose --out DIR': of a continuous family of runs (sines, triangles, steps,
multisines, holds, one muscle at constant pressure, pressures that rise together, valves shut; amplitude, frequency,
offset and mean pressure within the limits of the bench) the one under which the explanations that are left, each
refitted, differ most. Up to five runs share the time. Where one explanation is left, the run that best determines its
parameters; where no effect is left, the run that shows those which could not have shown.

It says beforehand what each outcome would mean, and when no run within the limits could tell.

--out (default: DIR/next) receives runs.toml for 'pamid simulate --runs', set_points.csv for a real bench (time,
wanted angle, pressure to add, what each muscle takes, valves shut), and plan.json. Record them, then go on with
'pamid diagnose LOG --since DIR --out SECOND'.
"""
_EXAMPLES = """\
  pamid next diagnosis
  pamid next diagnosis --seconds 6 --runs 3 --angle 20 --no-shut
  pamid simulate --sim bench.toml --runs diagnosis/next/runs.toml --out more.parquet
  pamid diagnose more.parquet --since diagnosis --sim sim.toml --out second
"""


def add_parser(subparsers: Any) -> None:
    """Add the command."""
    summary = "the run that best distinguishes what a diagnosis left undecided"
    parser = add_command(subparsers, "next", summary, _DESCRIPTION, _EXAMPLES)
    parser.add_argument("folder", metavar="DIR", help="what --out of 'pamid diagnose' named")
    parser.add_argument("--out", metavar="DIR", help="folder for the plan (default: DIR/next)")
    limits = parser.add_argument_group("limits of the bench")
    limits.add_argument(
        "--seconds", type=float, default=4.0, metavar="S", help="time of all runs together (default: 4)"
    )
    limits.add_argument("--runs", type=int, default=1, metavar="N", help="most runs, 1 to 5 (default: 1)")
    limits.add_argument(
        "--angle", type=float, metavar="DEG", help="largest angle to either side (default: that of the logs)"
    )
    limits.add_argument("--rate", type=float, default=200.0, metavar="DEG/S", help="largest rate (default: 200)")
    limits.add_argument(
        "--frequency", type=float, default=15.0, metavar="RAD/S", help="largest frequency (default: 15)"
    )
    limits.add_argument(
        "--pressure", type=float, default=8e4, metavar="PA", help="change of the mean pressure (default: 80000)"
    )
    limits.add_argument(
        "--rise", type=float, default=1.2e5, metavar="PA", help="rise of both pressures together (default: 120000)"
    )
    limits.add_argument("--no-shut", action="store_true", help="the valves cannot be shut")
    limits.add_argument("--no-single", action="store_true", help="one muscle cannot be kept at constant pressure")
    parser.add_argument("--designs", type=int, default=200, metavar="N", help="designs to look at (default: 200)")
    parser.add_argument(
        "--for",
        dest="purpose",
        choices=("auto", "discriminate", "parameters"),
        default="auto",
        help="what the runs are for (default: what is undecided; parameters where nothing is)",
    )


def run(args: argparse.Namespace) -> int:
    """Run the command."""
    from ...gap.design.search import plan_next

    out = check_folder(args.out or str(Path(args.folder) / "next"), FILES, size=_ROOM, parents=True)
    if not 8 <= args.designs <= 20_000:
        raise ParameterError(f"--designs is {args.designs}.", "8 to 20000", "Leave it at 200.")
    rivals, logs, params, library, angle = _undecided(Path(args.folder))
    limits = _limits(args, angle)
    started = time.perf_counter()
    with progress(args, "Designing") as step:
        plan = plan_next(
            rivals, logs, params, limits, designs=args.designs, purpose=args.purpose, library=library, seed=args.seed,
            progress=step,
        )  # fmt: skip
    files = _write(plan, out)
    if args.json:
        print_json({**plan.as_dict(), "files": {f.name: str(f) for f in files}})
        return DONE
    _tell(plan)
    print()
    for file in files:
        print(f"wrote {file}")
    note(args, f"took {time.perf_counter() - started:.0f} s, {plan.designs} designs looked at")
    return DONE


def _limits(args: argparse.Namespace, angle: float) -> Any:
    from ...gap.design.family import Limits

    return Limits(
        seconds=args.seconds, runs=args.runs, angle=args.angle or angle, rate=args.rate, frequency=args.frequency,
        pressure=args.pressure, rise=args.rise, shut=not args.no_shut, single=not args.no_single,
    )  # fmt: skip


def _undecided(folder: Path) -> tuple[list[Any], dict[str, Any], Any, list[str], float]:
    """Return what a diagnosis left open, the logs of its last day, simulator, library and largest angle in degrees."""
    import numpy as np

    from ...gap.several.history import read_history

    history = read_history(folder)
    last = list(history.held.values())[-1]
    now = {name: log for name, log in history.logs.items() if history.held[name].day == last.day}
    swing = max(float(np.nanmax(np.abs(log["q"]))) for log in history.logs.values())
    angle = float(np.clip(np.degrees(swing), 5.0, 45.0))
    return history.rivals, now, last.under(history.params), history.library, angle


def _write(plan: Plan, out: Path) -> list[Path]:
    from ...gap.design.runs_file import runs_text

    with replacing_together(out, FILES, parents=True) as stage:
        write_whole(stage / "plan.json", json.dumps(plan.as_dict(), indent=1, allow_nan=False) + "\n")
        if plan.runs:
            write_whole(stage / "runs.toml", runs_text(plan.runs, plan.names))
            plan.set_points().to_csv(stage / "set_points.csv", index=False)
        written = [name for name in FILES if (stage / name).exists()]
    return [out / name for name in written]


# --- words --------------------------------------------------------------------------------------------------
def _tell(plan: Plan) -> None:
    from ...gap.design.words import outcomes, summary

    print(f"{summary(plan)}\n")
    for k, run_ in enumerate(plan.runs, start=1):
        print(wrapped(f"run {k}", run_.words[:1].upper() + run_.words[1:] + "."))
    for text in outcomes(plan):
        print(wrapped("then", text))
    if plan.expected:
        rows = [
            [
                _named(e.truth),
                _named(e.rival),
                number(round(e.nats, 1)),
                f"{e.low:.3g} to {e.high:.3g}",
                f"{e.belief:.0%}",
            ]
            for e in plan.expected
        ]
        print("\n" + table(["if this is true", "against", "nats", "80 % interval", "belief then"], rows))
    if plan.shrinks:
        rows = [[name, number(round(factor, 2))] for name, factor in plan.shrinks.items()]
        print("\n" + table(["parameter", "interval shrinks by"], rows))


def _named(names: tuple[str, ...]) -> str:
    return " and ".join(names) or "no effect"
