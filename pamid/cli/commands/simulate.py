"""``pamid simulate``: a log of the bench, with its simulator file."""

from __future__ import annotations

import argparse
import inspect
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ...errors import LogFormatError, ParameterError, UnknownOptionError, among
from ...names import require_one_of
from .._progress import progress
from ..common import add_command, checked_output, load_simulator, parse_settings, print_json

if TYPE_CHECKING:
    from ...effects import EffectSpec

_KINDS = ("sine", "triangle", "step", "multisine", "hold", "sealed_hold", "isobaric", "isometric")
_PERIOD = 1e-3  # s: the simulated rig samples at 1 kHz
_DESCRIPTION = f"""\
Simulate the antagonistic bench (two muscles on one pulley, servo valves, pressure control, noisy and quantised
sensors at 1 kHz) and write its log.

Choose a data set by name (--dataset) or your own runs (--trajectory, repeatable): KIND:NAME=VALUE,... with
KIND one of {", ".join(_KINDS)}.
Frequencies are in rad/s, angles in degrees, seconds gives the length.

It also writes LOG.sim.toml, the nominal simulator, and, if --effect is used, LOG.true.toml, the simulator with the
effects that the log contains.
"""
_EXAMPLES = """\
  pamid simulate --muscle B --dataset D_B --out log.parquet --seed 0
  pamid simulate --muscle B --out friction.parquet --effect hysteresis --effect coulomb_friction:amplitude=5 \\
      --trajectory sine:frequency=4,amplitude=20,seconds=6 --trajectory step:start=0,end=15
  pamid simulate --sim my_bench.toml --trajectory triangle:frequency=1,amplitude=10 --out log.csv
"""


def add_parser(subparsers: Any) -> None:
    """Add the command."""
    parser = add_command(subparsers, "simulate", "write a log of the simulated bench", _DESCRIPTION, _EXAMPLES)
    bench = parser.add_mutually_exclusive_group()
    bench.add_argument("--muscle", metavar="A|B|C", help="size of the muscles (default: that of the data set, or B)")
    bench.add_argument("--sim", metavar="SIM.toml", help="simulator file of the bench instead of a size of its muscles")
    parser.add_argument("--dataset", metavar="NAME", help="data set: D_A to D_C, D_tri, D_step, paper_like")
    parser.add_argument(
        "--trajectory", metavar="KIND:NAME=VALUE,...", action="append", default=[], help="a run; repeatable"
    )
    parser.add_argument(
        "--effect",
        metavar="NAME[:PARAMETER=VALUE,...]",
        action="append",
        default=[],
        help="an effect that the log contains and the simulator file lacks; repeatable",
    )
    parser.add_argument("--runs", metavar="RUNS.toml", help="file of runs, as written by 'pamid next'")
    parser.add_argument("--out", metavar="LOG", required=True, help="log to write: .parquet, .csv or .h5")


def run(args: argparse.Namespace) -> int:
    """Run the command."""
    from ...bench import BenchParameters, dataset, paper_like_bench, simulate
    from ...bench.datasets import DATASETS
    from ...file_sets import replacing_together
    from ...signals import write_log

    out = checked_output(args.out, [args.sim])
    if out.suffix.lower() not in (".parquet", ".csv", ".h5"):
        raise LogFormatError(
            f"{out.name} ends in '{out.suffix}'.", ".parquet, .csv or .h5", "Choose one of these endings."
        )
    files = {"log": out, "sim": _beside(out, "sim"), "true": _beside(out, "true")}
    for kind in ("sim", "true"):
        checked_output(str(files[kind]), [args.sim])
    own_runs = bool(args.trajectory or args.runs)
    if bool(args.dataset) == own_runs:
        raise ParameterError(
            "Both --dataset and runs of your own are given." if args.dataset else "No run is given.",
            "one of --dataset and --trajectory or --runs",
            "Pass for instance --dataset D_B, or --trajectory sine:frequency=4,amplitude=10.",
        )
    if args.dataset:
        require_one_of(args.dataset, DATASETS, f"There is no data set {args.dataset!r}.")
    effects = [spec_of(text) for text in args.effect]
    if args.sim:
        params = load_simulator(args.sim)
    else:
        own = {"D_A": "A", "D_C": "C"}.get(args.dataset, "B")
        like = (args.dataset or "").startswith("paper_like")
        params = (paper_like_bench if like else BenchParameters.for_muscle)(args.muscle or own)
    nominal = params.replace(effects=())
    actual = params.replace(effects=(*params.effects, *effects))
    runs = [_trajectory(text) for text in args.trajectory]
    if args.runs:
        from ...gap.design.runs_file import read_runs

        runs += read_runs(args.runs)
    started = time.perf_counter()
    with progress(args, "Simulating"):
        if args.dataset:
            log = dataset(args.dataset, seed=args.seed, params=actual)
        else:
            log = simulate(actual, runs, seed=args.seed)
    seconds = time.perf_counter() - started
    with replacing_together(out.parent, [file.name for file in files.values()]) as stage:
        write_log(log, stage / out.name)
        nominal.to_toml(stage / files["sim"].name)
        if actual.effects:
            actual.to_toml(stage / files["true"].name)
        else:
            del files["true"]
    simulated = len(log) * _PERIOD
    if args.json:
        print_json(
            {
                "files": {kind: str(file) for kind, file in files.items()},
                "rows": len(log),
                "trajectories": list(log["trajectory"].unique()),
                "effects": [{"name": name, "parameters": values} for name, values in actual.effects],
                "seconds": seconds,
                "simulated_seconds": simulated,
            }
        )
        return 0
    print(f"log: {out} ({len(log)} rows, {log['trajectory'].nunique()} runs, {simulated:.1f} s in {seconds:.2f} s)")
    print(f"simulator: {files['sim']}")
    if "true" in files:
        print(f"simulator with the effects of the log: {files['true']}")
    return 0


def _beside(out: Path, kind: str) -> Path:
    return out.with_name(f"{out.stem}.{kind}.toml")


def _numbers(text: str, option: str, example: str) -> dict[str, float]:
    """Read ``name=value,name=value`` with numbers for values."""
    settings = parse_settings([part for part in text.split(",") if part.strip()], option) if text else {}
    for name, value in settings.items():
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            raise ParameterError(
                f"{option} sets {name} to {value!r}.", "a number in SI units", f"Write for instance {example}."
            )
    return settings


def spec_of(text: str) -> EffectSpec:
    """Return name and values of an effect that a user writes."""
    from ...effects import EffectSpec, make_effect

    name, _, rest = text.partition(":")
    values = _numbers(rest, "--effect", "coulomb_friction:amplitude=5")
    return EffectSpec.of(make_effect(name.strip(), **values))


def _trajectory(text: str) -> Any:
    from ...bench import references

    kind, _, rest = text.partition(":")
    kind = kind.strip()
    if kind not in _KINDS:
        raise UnknownOptionError(f"There is no kind of trajectory {kind!r}.", *among(kind, _KINDS))
    values: dict[str, Any] = dict(_numbers(rest, "--trajectory", "sine:frequency=4,amplitude=10"))
    make = getattr(references, kind)
    seconds = values.pop("seconds", 4.0)
    accepted = [p for p in inspect.signature(make).parameters if p != "samples"]
    needed = [n for n, p in inspect.signature(make).parameters.items() if p.default is p.empty and n != "samples"]
    unknown, missing = sorted(set(values) - set(accepted)), [n for n in needed if n not in values]
    if unknown or missing:
        raise ParameterError(
            f"The trajectory {text!r} has {'no' if missing else 'an unknown'} {', '.join(missing or unknown)}.",
            f"{', '.join(needed)} (optional: {', '.join(a for a in accepted if a not in needed)}, seconds)",
            f"Write for instance {kind}:{','.join(f'{n}=10' for n in needed)},seconds=4.",
        )
    if not 0.01 <= seconds <= 100_000:
        raise ParameterError(f"The trajectory {text!r} lasts {seconds:g} s.", "0.01 to 100000 s", "Correct seconds.")
    return make(samples=round(seconds / _PERIOD), **values)
