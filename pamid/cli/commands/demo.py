"""``pamid demo``: the main commands on simulated data, one by one."""

import argparse
import json
import shlex
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from ...file_sets import check_folder
from ..common import add_command

Step = tuple[str, list[str]]
"""What a step does, and its command."""

_RUNS = {
    "sine": ((1, 10, 1.5), (1, 20, 1.5), (2, 5, 1), (2, 15, 1), (2, 25, 1), (4, 10, 0.8), (4, 20, 0.8), (10, 5, 0.6),
             (10, 15, 0.6), (10, 25, 0.6)),
    "triangle": ((1, 15, 1.5), (1, 25, 1.5), (2, 10, 1), (2, 20, 1), (4, 15, 0.8), (4, 25, 0.8), (10, 10, 0.6),
                 (10, 20, 0.6)),
}  # fmt: skip
"""Frequency (Hz), amplitude (degrees) and seconds of the runs: several of each kind, so that none is like no other."""

_RECORDED = {"sine": ((2, 20, 3), (4, 10, 1.6), (10, 15, 1.2)), "triangle": ((2, 15, 3), (4, 20, 1.6))}
_WITHHELD = ("coulomb_friction", {"amplitude": 5.0})
"""The log that is diagnosed: its runs, and the effect that the diagnosis is not told of."""

_ESTIMATORS = {
    "force": "StaticPIHM,GeometricForce,PolynomialForce,SINDyRegressor,MLP",
    "flow": "ThermodynamicPIHM,GeometricFlow,PolynomialFlow,SINDyRegressor",
}
_ROOM = 1 << 23
_DESCRIPTION = """\
Run the main commands on simulated data, and show each command before it runs: simulate a bench whose muscles have
hysteresis and threads that stretch, compare its log with the nominal simulator, which has neither, fit the hybrid model
of the force and save it, compare the hybrid models of force and flow with the classical ones on unseen runs, adapt a
model of the flow from one muscle to another, and diagnose a log whose effect is withheld. If that log cannot
distinguish two effects, a run that can is designed and recorded, and the diagnosis continues.

It takes about a minute on one core and needs no data. Everything is written to --out.
"""


def add_parser(subparsers: Any) -> None:
    """Add the command."""
    parser = add_command(
        subparsers, "demo", "run the main commands on simulated data, step by step", _DESCRIPTION, "  pamid demo\n"
    )
    parser.add_argument(
        "--out", metavar="DIR", default="demo-output", help="folder for all results (default: demo-output)"
    )


def run(args: argparse.Namespace) -> int:
    """Run the command."""
    from .. import main

    folder = check_folder(args.out, parents=True, size=_ROOM)
    folder.mkdir(parents=True, exist_ok=True)
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
        reports = sorted(folder.glob("diagnosis*/report.html"))
        print("The report of the diagnosis, for a browser:\n" + "\n".join(f"  {report}" for report in reports))
    return 0


def steps(folder: Path) -> Iterator[Step]:
    """Go through all steps in their order; a part is asked for its own when those before it are done."""
    for part in PARTS:
        yield from part(folder)


def _simulation(folder: Path) -> list[Step]:
    command = ["simulate", "--muscle", "B", "--effect", "hysteresis", "--effect", "thread_extensibility"]
    command += _trajectories(_RUNS)
    words = "Simulate the bench: muscle B with hysteresis and threads that stretch"
    return [(words, [*command, "--out", str(folder / "log.parquet")])]


def _evaluation(folder: Path) -> list[Step]:
    words = "Compare the log with the nominal simulator: where rmse is far above the noise floor, physics is missing"
    return [(words, ["evaluate", str(folder / "log.parquet"), "--sim", str(folder / "log.sim.toml")])]


def _fit(folder: Path) -> list[Step]:
    command = ["fit", str(folder / "log.parquet"), "--estimator", "StaticPIHM", "--sim", str(folder / "log.sim.toml")]
    command += ["--folds", "0", "--thin", "10", "--set", "max_iter=60", "--out", str(folder / "force.pamid")]
    return [("Fit the hybrid model of the force to all runs and save it", command)]


def _comparison(folder: Path) -> list[Step]:
    common = ["compare", str(folder / "log.parquet"), "--sim", str(folder / "log.sim.toml")]
    common += ["--folds", "2", "--rows", "3000", "--out", str(folder)]
    return [
        (
            f"Compare estimators of the {equation} on unseen runs",
            [*common, "--equation", equation, "--estimators", estimators],
        )
        for equation, estimators in _ESTIMATORS.items()
    ]


def _adaptation(folder: Path) -> list[Step]:
    steps = []
    for muscle, runs in (("A", ((4, 20), (10, 10), (2, 15))), ("B", ((4, 15), (10, 15)))):
        command = ["simulate", "--muscle", muscle, "--out", str(folder / f"{muscle}.parquet")]
        for frequency, amplitude in runs:
            command += ["--trajectory", f"sine:frequency={frequency},amplitude={amplitude},seconds=0.8"]
        steps.append((f"Simulate muscle {muscle}", command))
    fit = ["fit", str(folder / "A.parquet"), "--estimator", "ThermodynamicPIHM", "--out", str(folder / "flow-A.pamid")]
    fit += ["--folds", "0", "--thin", "5", "--set", "hidden_layer_sizes=(32, 32)", "--set", "max_iter=15"]
    adapt = ["adapt", str(folder / "flow-A.pamid"), str(folder / "B.parquet"), "--muscle", "B", "--samples", "300"]
    return [
        *steps,
        ("Fit the hybrid model of the flow to muscle A", fit),
        (
            "Adapt it to muscle B, of twice the diameter, from 300 samples",
            [*adapt, "--folds", "2", "--out", str(folder / "flow-B.pamid")],
        ),
    ]


def _diagnosis(folder: Path) -> list[Step]:
    from ...bench import BenchParameters

    bench, log = folder / "bench.toml", folder / "bench.parquet"
    BenchParameters.for_muscle("B").replace(effects=(_WITHHELD,)).to_toml(bench)
    record = ["simulate", "--sim", str(bench), *_trajectories(_RECORDED), "--out", str(log)]
    diagnose = ["diagnose", str(log), "--sim", str(folder / "bench.sim.toml"), "--out", str(folder / "diagnosis")]
    return [
        (f"Record a log on another bench; only {bench} names the effect that its simulator file lacks", record),
        ("Diagnose the gap between the two: where it is, which effect causes it, how far it closes", diagnose),
    ]


def second_round(folder: Path) -> list[Step]:
    """Return the steps of a second round; none where the first diagnosis left nothing to distinguish."""
    first, last = folder / "diagnosis", folder / "diagnosis-2"
    found = json.loads((first / "diagnosis.json").read_text(encoding="utf-8"))
    if all(len(cause["effects"]) < 2 for cause in found["causes"]):
        return []
    log, simulator = folder / "second.parquet", folder / "bench.sim.toml"
    record = ["simulate", "--sim", str(folder / "bench.toml"), "--runs", str(first / "next" / "runs.toml")]
    return [
        (
            "The log cannot tell which effect it is: design the run that can",
            ["next", str(first), "--seconds", "2", "--designs", "20"],
        ),
        ("Record that run on the bench", [*record, "--out", str(log)]),
        (
            "Continue the diagnosis",
            ["diagnose", str(log), "--since", str(first), "--sim", str(simulator), "--out", str(last)],
        ),
    ]


def _trajectories(kinds: Mapping[str, Sequence[tuple[float, float, float]]]) -> list[str]:
    """Return the options that ask for runs."""
    return [
        word
        for kind, runs in kinds.items()
        for frequency, amplitude, seconds in runs
        for word in ("--trajectory", f"{kind}:frequency={frequency},amplitude={amplitude},seconds={seconds}")
    ]


PARTS = (_simulation, _evaluation, _fit, _comparison, _adaptation, _diagnosis, second_round)
"""The parts of the demo, each a function of the folder that says its steps; a new part goes to the end."""
