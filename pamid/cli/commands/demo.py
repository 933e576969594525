"""``pamid demo``: the main job on simulated data, command by command."""

from __future__ import annotations

import argparse
import shlex
import time
from pathlib import Path
from typing import Any

from ...errors import OutputError
from ..common import add_command

_RUNS = (
    "sine:frequency=1,amplitude=20,seconds=3",
    "sine:frequency=2,amplitude=10,seconds=1.6",
    "sine:frequency=4,amplitude=5,seconds=1.6",
    "sine:frequency=4,amplitude=25,seconds=1.6",
    "sine:frequency=10,amplitude=10,seconds=1.2",
    "sine:frequency=10,amplitude=20,seconds=1.2",
    "triangle:frequency=2,amplitude=15,seconds=2",
    "triangle:frequency=4,amplitude=20,seconds=1.6",
    "step:start=0,end=10,seconds=1.6",
    "step:start=0,end=-20,seconds=1.6",
)
_ESTIMATORS = {
    "force": "StaticPIHM,GeometricForce,PolynomialForce,SINDyRegressor,MLP",
    "flow": "ThermodynamicPIHM,GeometricFlow,PolynomialFlow,SINDyRegressor,MLP",
}
_DESCRIPTION = """\
Do the main job from end to end on simulated data, and show each command before it runs: simulate a bench whose muscles
have hysteresis and threads that stretch, hold its log against the nominal simulator that knows of neither, fit the
hybrid models of force and flow, and compare them with the classical ones on runs that they have not seen.

It takes about a minute and needs no data. Everything is written to --out.
"""


def add_parser(subparsers: Any) -> None:
    """Add the command."""
    parser = add_command(
        subparsers, "demo", "the main job on simulated data, step by step", _DESCRIPTION, "  pamid demo\n"
    )
    parser.add_argument(
        "--out", metavar="DIR", default="demo-output", help="folder for all results (default: demo-output)"
    )


def run(args: argparse.Namespace) -> int:
    """Run the command."""
    from .. import main

    folder = Path(args.out)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(
            f"The folder {folder} cannot be made: {error.strerror or error}.", "a folder", "Choose another one."
        ) from error
    started = time.perf_counter()
    common = ["--seed", str(args.seed), *(["--quiet"] if args.quiet else []), *(["--json"] if args.json else [])]
    for words, command in steps(folder):
        if not args.json:
            print(f"\n# {words}\n$ {shlex.join(['pamid', *command])}", flush=True)
        code = main([*command, *common])
        if code:
            return code
    if not args.json:
        pictures = sorted(folder.glob("*.png"))
        print(f"\nDone in {time.perf_counter() - started:.0f} s. The pictures:")
        print("\n".join(f"  {picture}" for picture in pictures))
    return 0


def steps(folder: Path) -> list[tuple[str, list[str]]]:
    """Return what each step does, and its command."""
    log, sim = folder / "log.parquet", folder / "log.sim.toml"
    simulate = ["simulate", "--muscle", "B", "--effect", "hysteresis", "--effect", "thread_extensibility"]
    for run_text in _RUNS:
        simulate += ["--trajectory", run_text]
    found = [
        ("Simulate the bench: muscle B with hysteresis and threads that stretch", [*simulate, "--out", str(log)]),
        (
            "Hold the log against the nominal simulator: where rmse is far above the noise floor, physics is missing",
            ["evaluate", str(log), "--sim", str(sim)],
        ),
    ]
    for equation, estimator in (("force", "StaticPIHM"), ("flow", "ThermodynamicPIHM")):
        model = folder / f"{equation}.pamid"
        fit = ["fit", str(log), "--estimator", estimator, "--sim", str(sim), "--out", str(model)]
        found.append((f"Fit the hybrid model of the {equation} and save it", [*fit, "--folds", "0", "--thin", "5"]))
    for equation, estimators in _ESTIMATORS.items():
        command = ["compare", str(log), "--sim", str(sim), "--equation", equation, "--estimators", estimators]
        found.append(
            (
                f"Compare estimators of the {equation} on runs that they have not seen",
                [*command, "--folds", "3", "--rows", "3000", "--out", str(folder)],
            )
        )
    return found
