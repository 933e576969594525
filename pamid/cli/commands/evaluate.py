"""``pamid evaluate``: compare a log with a simulator, or with a saved model."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

from ...errors import ParameterError
from .._progress import progress
from .._simulators import add_trust_option
from ..common import (
    DONE,
    UNTESTED,
    add_command,
    add_log_options,
    any_simulator_of,
    load_log,
    load_pieces,
    note,
    number,
    print_json,
    table,
)

if TYPE_CHECKING:
    from ...equations import LogEvaluation

_DESCRIPTION = """\
Compare a log with the equations of a simulator: force, flow, valve and joint, as far as the log has the columns.

For each equation you get the root mean square error over windows, of 20 ms on the bench (rmse), the same divided by the
standard deviation of the measurement (nrmse), and the noise floor: the rmse that a perfect simulator would have due to
sensor noise, which is estimated from the log. An rmse far above the floor is a gap, unless the parameters under
[tolerance] explain it: --refit first fits them within their tolerances.

--refit --instruments COLUMN is for logs recorded in closed loop, where noise returns through the controller and biases
a refit. COLUMN holds the reference that the controller followed; sizes of the simulator's own effects, such as the
causes in corrected.toml, are fitted, too. The log must contain all states, except speeds whose positions it contains.

The column fit is 100 % × (1 − nrmse), as in MATLAB's compare.

SIM.toml may also describe a cylinder, a joint or a muscle with its one equation, or your own simulator: a function,
equations, a MuJoCo model, an FMU. With --model, a model saved by 'pamid fit' predicts the log instead.
"""
_EXAMPLES = """\
  pamid evaluate log.parquet --sim sim.toml
  pamid evaluate log.parquet --sim sim.toml --refit --json
  pamid evaluate log.csv --sim diagnosis/corrected.toml --refit --instruments wanted      recorded in closed loop
  pamid evaluate new.csv --columns columns.toml --sim sim.toml --model force.pamid
"""


def add_parser(subparsers: Any) -> None:
    """Add the command."""
    parser = add_command(
        subparsers, "evaluate", "compute the errors of a simulator or a model on a log", _DESCRIPTION, _EXAMPLES
    )
    add_log_options(parser)
    parser.add_argument("--sim", metavar="SIM.toml", help="simulator file; needed unless --model reads a log with eps")
    parser.add_argument("--model", metavar="MODEL", help="model file of 'pamid fit' to evaluate on the log")
    parser.add_argument(
        "--equation", choices=("force", "flow"), help="what the model predicts, if its file does not say"
    )
    parser.add_argument(
        "--piece-rows",
        type=int,
        metavar="N",
        help="read a log that is larger than memory in pieces of about N rows, each of whole runs",
    )
    add_trust_option(parser)
    parser.add_argument("--refit", action="store_true", help="first refit the parameters within their tolerances")
    parser.add_argument(
        "--instruments",
        metavar="COLUMN",
        action="append",
        help="with --refit: the reference of the controller under which the log was recorded; repeatable",
    )


def run(args: argparse.Namespace) -> int:
    """Run the command."""
    if args.model is not None:
        return _evaluate_model(args)
    if args.refit and args.piece_rows is not None:
        raise ParameterError(
            "--refit reads the log several times, --piece-rows only once.", "one of the two", "Leave one out."
        )
    if args.instruments and not args.refit:
        raise ParameterError("--instruments is given without --refit.", "both", "Add --refit.")
    if args.sim is None:
        raise ParameterError(
            "Neither --sim nor --model is given.", "a simulator or a model", "Add --sim SIM.toml or --model MODEL."
        )
    return _evaluate_simulator(args)


def _evaluate_simulator(args: argparse.Namespace) -> int:
    from ...gap import evaluate, refit_with_instruments, refit_within_tolerance

    simulator: Any = any_simulator_of(args)
    extra: dict[str, Any] = {k: v for k, v in simulator.identity().items() if k == "kind"}
    if args.piece_rows is None:
        log: Any = load_log(args, simulator=simulator)
    else:
        log = load_pieces(args, args.piece_rows, simulator=simulator)
    said = simulator.doubts(log) if args.piece_rows is None else None
    if said is not None:
        extra["doubts"] = said
    if args.instruments:
        with progress(args, "Refitting with instruments"):
            found = refit_with_instruments(log, simulator, args.instruments)
        simulator = found.params
        extra["instruments"] = {
            "reference": args.instruments,
            "estimates": {name: one.as_dict() for name, one in found.estimates.items()},
            "beyond": list(found.beyond),
        }
    elif args.refit:
        with progress(args, "Refitting within tolerances"):
            refit = refit_within_tolerance(log, simulator)
        simulator = refit.params
        extra["refit"] = {
            "parameters": {name: simulator.get(name) for name in refit.changes},
            "relative_change": refit.changes,
            "at_bound": list(refit.at_bound),
        }
    count = log["trajectory"].nunique() if args.piece_rows is None and "trajectory" in log else None
    with progress(args, "Evaluating", count) as step:
        result = evaluate(log, simulator, progress=step)
    if args.json:
        print_json({**result.as_dict(), **extra})
        return DONE if result else UNTESTED
    _tell(result)
    for why in result.skipped.values():
        print(f"skipped: {why}")
    for name, change in extra.get("refit", {}).get("relative_change", {}).items():
        bound = ", at its bound" if name in extra["refit"]["at_bound"] else ""
        print(f"refitted: {name} {change:+.3%} to {simulator.get(name):.6g}{bound}")
    if args.instruments:
        for name, one in found.estimates.items():
            print(f"{one.sentence(name)}{', beyond its tolerance' if name in found.beyond else ''}")
    for text in said or ():
        note(args, text)
    if "refit" in extra and not extra["refit"]["relative_change"]:
        note(args, "nothing is refitted: no parameter of the simulator has a tolerance")
    if not args.refit and simulator.tolerance and any(e.rmse > 1.5 * e.noise_floor for e in result.values()):
        note(args, f"the tolerances of {', '.join(simulator.tolerance)} may explain part of this: try --refit")
    return DONE if result else UNTESTED


def _tell(result: LogEvaluation) -> None:
    """Print one line an equation; fit is 100 % less the error over the standard deviation."""
    rows = [
        [
            name,
            number(e.rmse),
            number(100 * (1 - e.nrmse)),
            number(e.nrmse),
            number(e.noise_floor),
            number(e.rmse / e.noise_floor) if e.noise_floor > 0 else "-",
            e.unit,
        ]
        for name, e in result.items()
    ]
    if rows:
        print(table(["equation", "rmse", "fit / %", "nrmse", "noise floor", "rmse/floor", "unit"], rows))


def _evaluate_model(args: argparse.Namespace) -> int:
    from .._tables import Scores, opened, predict_table, signal_table

    head, model, equation, page = opened(args)
    scores_ = Scores(equation)
    pieces = [load_log(args, nan="drop")] if args.piece_rows is None else load_pieces(args, args.piece_rows, nan="drop")
    with progress(args, "Predicting") as step:
        for piece in pieces:
            signals = signal_table(piece, page, equation)
            scores_.add(signals, predict_table(model, signals))
            step("")
    scores = scores_.result()
    if args.json:
        print_json({"model": {"class": head["class"], "steps": head["steps"]}, "equation": equation.name, **scores})
        return 0
    rows = [
        [name, number(s["rmse"]), number(100.0 * (1.0 - s["nrmse"])), str(s["n_samples"])]
        for name, s in {**scores["trajectories"], "all": scores}.items()
    ]
    print(table(["trajectory", f"rmse / {equation.unit}", "fit / %", "samples"], rows))
    return 0
