"""``pamid adapt``: make a model of another muscle from a saved one and a short log."""

from __future__ import annotations

import argparse
import time
import warnings
from typing import TYPE_CHECKING, Any

from ...errors import ExtrapolationWarning, ParameterError
from ...requirements import last_step
from .._fitting import held_out, pipeline, with_rates
from .._progress import progress
from .._tables import equation_of, predict_table, score_by_trajectory, signal_table
from ..common import (
    add_command,
    add_log_options,
    checked_output,
    load_log,
    note,
    number,
    page_numbers,
    page_of,
    print_json,
    table,
)

if TYPE_CHECKING:
    from ...bench.parameters import BenchParameters
    from ...systems import System

METHODS = ("q", "scales", "full", "partial", "lora")

_DESCRIPTION = """\
Adapt a model of one muscle, saved by 'pamid fit', to another muscle with a short log of that muscle.

First a grouped cross-validation estimates the error: in each fold the source is adapted to most runs, and scored on the
others with and without the adaptation. Then it is adapted to all runs and written to --out together with the source.
The size of the target muscle, which gives the initial value of the volume factor, comes from --muscle or from the
simulator file (--sim, or the one beside the log); without these, only the data decide.
"""
_EXAMPLES = """\
  pamid adapt flow-A.pamid log-B.parquet --muscle B --out flow-B.pamid
  pamid adapt force.pamid festo.csv --columns columns.toml --muscle 0.182,0.01 --samples 100 --out festo.pamid
  pamid adapt flow-A.pamid log-B.parquet --method scales --out flow-B.pamid --json
"""

_FACTORS = {
    "Q": "q_", "Q0": "q0_", "Q_uncertainty": "q_uncertainty_", "length_factor": "length_factor_",
    "diameter_factor": "diameter_factor_", "dead_volume": "dead_volume_",
}  # fmt: skip
"""What is reported of the size of the target, and the attribute that holds it."""


def add_parser(subparsers: Any) -> None:
    """Add the command."""
    parser = add_command(subparsers, "adapt", "adapt a saved model to another muscle", _DESCRIPTION, _EXAMPLES)
    parser.add_argument(
        "model", metavar="MODEL", help="model file of 'pamid fit' or 'pamid adapt', of the source muscle"
    )
    add_log_options(parser)
    parser.add_argument(
        "--muscle", metavar="NAME or L0,D0", help="target muscle: A, B, C, or its rest length and diameter in m"
    )
    parser.add_argument("--sim", metavar="SIM.toml", help="simulator file of the target's bench")
    parser.add_argument(
        "--method",
        choices=METHODS,
        default="q",
        help="q: factor on the volume and a correction kept near the source (default); scales: length, diameter, dead "
        "volume; full, partial, lora: fine-tuning without a factor",
    )
    parser.add_argument(
        "--trainer",
        choices=("levenberg_marquardt", "adam"),
        default="levenberg_marquardt",
        help="training algorithm (default: levenberg_marquardt)",
    )
    parser.add_argument("--samples", type=int, default=1000, metavar="N", help="adapt on about N samples, 0 for all")
    parser.add_argument("--folds", type=int, default=3, metavar="K", help="folds of the held-out check, 0 for none")
    parser.add_argument("--out", metavar="MODEL.pamid", required=True, help="file to write the adapted model to")


def run(args: argparse.Namespace) -> int:
    """Run the command."""
    from sklearn.base import clone

    from ...persistence import inspect, load, save

    out = checked_output(args.out, [*args.log, args.sim, args.columns])
    if args.samples < 0 or args.folds < 0 or args.folds == 1:
        raise ParameterError(
            f"--samples is {args.samples} and --folds is {args.folds}.",
            "--samples of at least 0, --folds 0 or at least 2",
            "Correct the number.",
        )
    head, source = inspect(args.model), load(args.model)
    target = equation_of(source, head["metadata"].get("equation"))
    params, sizes = _muscle(args)
    estimator = _adapter(args, source, sizes)
    signals = signal_table(load_log(args, nan="drop"), params, target)
    steps, features = with_rates(signals, estimator, target)
    columns = list(features.columns) if steps else ["trajectory", "eps", "deps", "P", "dP"]
    X, y = features[columns], signals[target.column]
    stride = max(1, len(X) // args.samples) if args.samples else 1
    rows = slice(None, None, stride)
    last = last_step(source)
    names = list(getattr(last, "feature_names_in_", [])) or columns
    with warnings.catch_warnings():
        # That another muscle moves outside the source's range is no news here.
        warnings.simplefilter("ignore", ExtrapolationWarning)
        raw = predict_table(last, features[[n for n in names if n in features]])
    before = score_by_trajectory(signals, raw, target)
    unseen = None
    with progress(args, "Adapting", 1) as step:
        if args.folds:
            predicted = held_out(args, lambda X, y: clone(estimator).fit(X, y), X, y, signals["run"], step, stride)
            unseen = score_by_trajectory(signals, predicted, target)
        started = time.perf_counter()
        fitted = estimator.fit(X.iloc[rows], y.iloc[rows])
    seconds = time.perf_counter() - started
    training = score_by_trajectory(signals, predict_table(fitted, X), target)
    about = {"equation": target.name, "unit": target.unit}
    save(pipeline(steps, fitted), out, {**about, "estimator": type(fitted).__name__, "logs": list(args.log)})
    found = {
        name: float(value)
        for name, attribute in _FACTORS.items()
        if (value := getattr(fitted, attribute, None)) is not None
    }
    report = {
        "model": str(out),
        "source": args.model,
        "method": args.method,
        **about,
        "parameters": found,
        "n_parameters": fitted.n_parameters_,
        "n_samples": len(X.iloc[rows]),
        "before": _short(before),
        "after": _short(training),
        "held_out": None if unseen is None else _short(unseen),
        "adapt_seconds": seconds,
        "n_iter": fitted.n_iter_,
    }
    if args.json:
        print_json(report)
        return 0
    for name, value in found.items():
        print(f"{name} = {number(value)}")
    lines = [["source as it is", *_cells(before)], ["adapted, on the log", *_cells(training)]]
    if unseen is not None:
        lines.append(["adapted, held-out runs", *_cells(unseen)])
    print(table([type(fitted).__name__, f"rmse / {target.unit}", "nrmse", "samples"], lines))
    print(f"saved: {out} (adapted on {report['n_samples']} samples in {seconds:.2f} s)")
    return 0


def _short(score: dict[str, Any]) -> dict[str, Any]:
    return {name: score[name] for name in ("rmse", "nrmse", "n_samples")}


def _cells(score: dict[str, Any]) -> list[str]:
    return [number(score["rmse"]), number(score["nrmse"]), str(score["n_samples"])]


def _muscle(args: argparse.Namespace) -> tuple[BenchParameters | System | None, tuple[float, float] | None]:
    """Return the bench of the target, if there is one, and its muscle's sizes."""
    from ...bench.parameters import BenchParameters

    page = page_of(args)
    numbers = page_numbers(page)
    sizes = None if page is None else (numbers["rest_length"], numbers["rest_diameter"])
    if args.muscle is None:
        return page, sizes
    if "," not in args.muscle:
        named = BenchParameters.for_muscle(args.muscle)
        own = (named.muscle.rest_length, named.muscle.rest_diameter)
        if sizes is not None and sizes != own:
            note(args, f"--muscle {args.muscle} and the simulator file give different sizes; --muscle is used")
        return page if page is not None else named, own
    try:
        length, diameter = (float(part) for part in args.muscle.split(","))
    except ValueError:
        raise ParameterError(
            f"--muscle is {args.muscle!r}.", "A, B, C, or rest length and diameter in m", "Write --muscle 0.2,0.02."
        ) from None
    return page, (length, diameter)


def _adapter(args: argparse.Namespace, source: Any, sizes: tuple[float, float] | None) -> Any:
    """Return the estimator of a method; the estimators say themselves which method they are."""
    from pamid.estimators import all_estimators
    from sklearn.frozen import FrozenEstimator

    kind = next(c for _, c in all_estimators() if getattr(c, "method", None) == args.method)
    settings: dict[str, Any] = {"trainer": args.trainer, "random_state": args.seed}
    if sizes is not None:
        settings |= {"rest_length": sizes[0], "rest_diameter": sizes[1]}
    return kind(FrozenEstimator(source), **settings)
