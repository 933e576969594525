"""``pamid next``: the run, or a few, that best distinguish what a diagnosis left undecided."""

from __future__ import annotations

import argparse
import json
import os
import re
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ...errors import ParameterError
from ...file_sets import check_folder, replacing_together
from ...files import write_whole
from .._drafting import quoted
from .._progress import progress
from .._simulators import add_trust_option
from ..common import DONE, add_command, note, number, print_json, table, wrapped

if TYPE_CHECKING:
    from ...gap.design.plan import Plan
    from ...gap.several.history import History

FILES = ("plan.json", "runs.toml", "set_points.csv")
"""What --out receives."""
_ROOM = 1 << 22
_DESCRIPTION = """\
Design the next run after 'pamid diagnose --out DIR': the run for which the remaining explanations, each refitted,
differ most. If only one explanation remains, it is the run that best determines its parameters; if none remains, the
run that would show effects that the logs could not show. With --runs, up to five runs share the time.

For the bench the runs are sines, triangles, steps, multisines, holds, one muscle at constant pressure, pressures that
rise together, or valves shut; amplitude, frequency, offset and mean pressure stay within the limits of the bench.

The plan says in advance what each outcome would mean, and whether any run within the limits can decide.

For any other simulator the inputs are designed (sines, triangles, steps, multisines, chirps and holds), each within its
range in the logs or within --limit and --rate: for a cylinder, stroke and pressure; for a joint, its angle; for a
muscle, contraction and pressure. Readings of a simulator with ports stay near their range in the logs. --change names a
possible change of the system, such as another mass: the plan then says whether a run after that change would
decide more than any run without it.

--out (default: DIR/next) receives runs.toml, set_points.csv for the real system (time and each input; for a bench the
reference angle, the pressure added, the role of each muscle, and whether valves are shut), and plan.json. Record the
runs, then continue with 'pamid diagnose LOG --since DIR --out SECOND'. 'pamid simulate --runs' takes a bench's
runs.toml, too.
"""
_EXAMPLES = """\
  pamid next diagnosis
  pamid next diagnosis --seconds 6 --runs 3 --angle 20 --no-shut
  pamid next diagnosis --trust --limit u=-2:2 --rate u=50 --change load=0.5
  pamid simulate --sim bench.toml --runs diagnosis/next/runs.toml --out more.parquet
  pamid diagnose more.parquet --since diagnosis --sim sim.toml --out second
"""


def add_parser(subparsers: Any) -> None:
    """Add the command."""
    summary = "propose the run that best distinguishes the causes that a diagnosis left open"
    parser = add_command(subparsers, "next", summary, _DESCRIPTION, _EXAMPLES)
    parser.add_argument("folder", metavar="DIR", help="output folder of 'pamid diagnose'")
    parser.add_argument("--out", metavar="DIR", help="folder for the plan (default: DIR/next)")
    parser.add_argument("--sim", metavar="SIM", help="the simulator (default: that of the diagnosis)")
    add_trust_option(parser)
    limits = parser.add_argument_group("limits")
    limits.add_argument(
        "--seconds",
        type=float,
        metavar="S",
        help="total time of all runs (default: 4; with ports, as long as the logs' runs)",
    )
    limits.add_argument("--runs", type=int, default=1, metavar="N", help="largest number of runs, 1 to 5 (default: 1)")
    limits.add_argument(
        "--rate", action="append", default=[], metavar="DEG/S|NAME=RATE",
        help="largest rate of a bench's angle (default: 200), or of an input, per second; repeatable",
    )  # fmt: skip
    ports = parser.add_argument_group("a simulator with ports")
    ports.add_argument(
        "--limit",
        action="append",
        default=[],
        metavar="NAME=LOW:HIGH",
        help="range of an input, in its unit; repeatable",
    )
    ports.add_argument(
        "--keep", action="append", default=[], metavar="NAME=LOW:HIGH",
        help="allowed range of a reading (default: twice that of the logs); repeatable",
    )  # fmt: skip
    ports.add_argument(
        "--change", action="append", default=[], metavar="NAME=VALUE,...",
        help="a possible change of the system: other values of parameters, inputs held at a value; repeatable",
    )  # fmt: skip
    limits = parser.add_argument_group("the bench")
    limits.add_argument(
        "--angle", type=float, metavar="DEG", help="largest angle to either side (default: that of the logs)"
    )
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
    parser.add_argument(
        "--designs",
        type=int,
        metavar="N",
        help="number of designs to try (default: 200, fewer for long runs of MuJoCo models and FMUs)",
    )
    parser.add_argument(
        "--for",
        dest="purpose",
        choices=("auto", "discriminate", "parameters"),
        default="auto",
        help="purpose of the runs (default: discriminate if something is undecided, else parameters)",
    )


def run(args: argparse.Namespace) -> int:
    """Run the command."""
    from ...any_simulator import read_simulator
    from ...gap.several.history import read_history

    out = check_folder(args.out or str(Path(args.folder) / "next"), FILES, size=_ROOM, parents=True)
    if args.designs is not None and not 8 <= args.designs <= 20_000:
        raise ParameterError(f"--designs is {args.designs}.", "8 to 20000", "Leave it out.")

    read = partial(read_simulator, trust=args.trust)
    history = read_history(args.folder, read(args.sim) if args.sim else None, read=read)
    started = time.perf_counter()
    with progress(args, "Designing") as step:
        plan = _planned(args, history, step)
    files = _write(plan, out)
    if args.json:
        print_json({**plan.as_dict(), "files": {f.name: str(f) for f in files}})
        return DONE
    _tell(plan)
    print()
    for file in files:
        print(f"wrote {file}")
    if plan.runs:
        print(f"\nonce recorded as LOG: {_following(args, history)}")
    note(args, f"took {time.perf_counter() - started:.0f} s, {plan.designs} designs looked at")
    return DONE


def _following(args: argparse.Namespace, history: History) -> str:
    """Return the command that continues with the recorded run."""
    given = [
        f" --{name} {quoted([os.path.relpath(value) if name == 'columns' else value])}"
        for name, value in (("columns", history.columns), ("encoding", history.encoding), ("sim", args.sim))
        if value
    ]
    folder, trust = Path(args.folder), " --trust" if args.trust else ""
    out = folder.with_name(f"{re.sub(r'-[0-9]+$', '', folder.name)}-{len(history.rounds) + 1}")
    return f"pamid diagnose LOG --since {quoted([folder])}{''.join(given)}{trust} --out {quoted([out])}"


def _planned(args: argparse.Namespace, history: History, step: Callable[[str], None]) -> Plan:
    """Return the plan for a simulator of any kind that has inputs."""
    from ...bench.parameters import BenchParameters
    from ...gap.design.next_run import next_run_after

    given: dict[str, Any] = {} if args.designs is None else {"designs": args.designs}
    if isinstance(history.simulator, BenchParameters):
        for option, value in (("--limit", args.limit), ("--keep", args.keep), ("--change", args.change)):
            if value:
                raise ParameterError(
                    f"{option} is given for a bench.", "--angle, --pressure, --rise and the like", "Leave it out."
                )
        given["limits"] = _limits(args, history)
    else:
        given |= {
            "limits": dict(_pair(text, "--limit", _range) for text in args.limit),
            "keep": dict(_pair(text, "--keep", _range) for text in args.keep),
            "rates": dict(_pair(text, "--rate", float) for text in args.rate),
            "changes": [dict(_pair(t, "--change", float) for t in text.split(",")) for text in args.change],
            "seconds": args.seconds,
            "runs": args.runs,
        }
    return next_run_after(history, purpose=args.purpose, seed=args.seed, progress=step, **given)


def _pair(text: str, option: str, value: Callable[[str], Any]) -> tuple[str, Any]:
    name, equals, rest = text.partition("=")
    try:
        if not (equals and name.strip()):
            raise ValueError
        return name.strip(), value(rest)
    except ValueError:
        expected = "NAME=LOW:HIGH, such as u=-2:2" if option in ("--limit", "--keep") else "NAME=NUMBER, such as u=50"
        raise ParameterError(f"{option} got {text[:60]!r}.", expected, "Correct it.") from None


def _range(text: str) -> tuple[float, float]:
    low, _, high = text.partition(":")
    return float(low), float(high)


def _limits(args: argparse.Namespace, history: History) -> Any:
    """Return the limits of a bench, the largest angle that of its logs."""
    import numpy as np

    from ...gap.design.family import Limits

    swing = max(float(np.nanmax(np.abs(log["q"]))) for log in history.logs.values())
    try:
        rate = float(args.rate[-1]) if args.rate else 200.0
    except ValueError:
        raise ParameterError(f"--rate is {args.rate[-1]!r}.", "a number in degrees/s", "Correct it.") from None
    return Limits(
        seconds=4.0 if args.seconds is None else args.seconds, runs=args.runs,
        angle=args.angle or float(np.clip(np.degrees(swing), 5.0, 45.0)), rate=rate, frequency=args.frequency,
        pressure=args.pressure, rise=args.rise, shut=not args.no_shut, single=not args.no_single,
    )  # fmt: skip


def _write(plan: Plan, out: Path) -> list[Path]:
    from ...gap.design.runs_file import runs_text

    with replacing_together(out, FILES, parents=True) as stage:
        write_whole(stage / "plan.json", json.dumps(plan.as_dict(), indent=1, allow_nan=False) + "\n")
        if plan.runs:
            write_whole(stage / "runs.toml", runs_text(plan.runs, plan.names, plan.limits.header))
            plan.set_points().to_csv(stage / "set_points.csv", index=False)
        written = [name for name in FILES if (stage / name).exists()]
    return [out / name for name in written]


# --- words --------------------------------------------------------------------------------------------------
def _tell(plan: Plan) -> None:
    from ...report.next_run import headroom, named, outcomes, parameter_named, summary

    print(f"{summary(plan)}\n")
    if text := headroom(plan):
        print(wrapped("choice", text))
    for k, run_ in enumerate(plan.runs, start=1):
        print(wrapped(f"run {k}", run_.words[:1].upper() + run_.words[1:] + "."))
    for text in outcomes(plan):
        print(wrapped("then", text))
    if plan.expected:
        rows = [
            [
                named(e.truth),
                named(e.rival),
                number(round(e.nats, 1)),
                f"{e.low:.3g} to {e.high:.3g}",
                f"{e.belief:.0%}",
            ]
            for e in plan.expected
        ]
        print("\n" + table(["if this is true", "against", "nats", "80 % interval", "belief then"], rows))
    if plan.shrinks:
        rows = [[parameter_named(name), number(round(factor, 2))] for name, factor in plan.shrinks.items()]
        print("\n" + table(["parameter", "interval shrinks by"], rows))
