"""``pamid evaluate``: hold a log against a simulator, or against a saved model."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

from ...errors import ParameterError
from .._simulators import add_trust_option, evaluation, port_simulator_of
from ..common import (
    DONE,
    UNTESTED,
    add_command,
    add_log_options,
    load_log,
    load_pieces,
    note,
    number,
    page_numbers,
    page_of,
    print_json,
    progress,
    table,
)

if TYPE_CHECKING:
    from ...equations import LogEvaluation
    from ...simulators import Simulator
    from ...systems import System

_DESCRIPTION = """\
Hold a log against the equations of a simulator: force, flow, valve and joint, as far as the log has the columns.

For each equation you get the root mean square error over windows of 20 ms (rmse), the same over the standard
deviation of what was measured (nrmse), and the noise floor: the rmse that the sensors' own noise, estimated from the
log, would leave with a perfect simulator. An rmse far above the floor is a gap, unless the parameters under
[tolerance] explain it: --refit fits those within their tolerances first.

fit is 100 % less nrmse, as MATLAB's compare has it.

SIM.toml may also be the page of a cylinder, a joint or a muscle, whose one equation is then looked at. With --model, a
model saved by 'pamid fit' predicts the log instead.
"""
_EXAMPLES = """\
  pamid evaluate log.parquet --sim sim.toml
  pamid evaluate log.parquet --sim sim.toml --refit --json
  pamid evaluate new.csv --columns mapping.toml --sim sim.toml --model force.pamid
"""


def add_parser(subparsers: Any) -> None:
    """Add the command."""
    parser = add_command(subparsers, "evaluate", "errors of a simulator or a model on a log", _DESCRIPTION, _EXAMPLES)
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
        help="read the log in pieces of N rows, each of whole trajectories, where it is larger than memory",
    )
    add_trust_option(parser)
    parser.add_argument("--refit", action="store_true", help="refit the parameters under [tolerance] within it first")


def run(args: argparse.Namespace) -> int:
    """Run the command."""
    if args.model is not None:
        return _evaluate_model(args)
    if args.refit and args.piece_rows is not None:
        raise ParameterError(
            "--refit goes through the log several times, and --piece-rows once.", "one of the two", "Leave one out."
        )
    if args.sim is None:
        raise ParameterError(
            "Neither --sim nor --model is given.", "a simulator or a model", "Add --sim SIM.toml or --model MODEL."
        )
    return _evaluate_simulator(args)


def _evaluate_simulator(args: argparse.Namespace) -> int:
    from ...equations import evaluate_log
    from ...gap import refit_within_tolerance
    from ...systems import System

    if (ported := port_simulator_of(args)) is not None:
        return _evaluate_ported(args, ported)
    params = page_of(args)
    if isinstance(params, System):
        return _evaluate_system(args, params)
    assert params is not None
    extra: dict[str, Any] = {}
    log: Any = load_log(args) if args.piece_rows is None else load_pieces(args, args.piece_rows)
    if args.refit:
        with progress(args, "Refitting within tolerances"):
            refit = refit_within_tolerance(log, params)
        params = refit.params
        extra["refit"] = {
            "parameters": {name: params.get(name) for name in refit.changes},
            "relative_change": refit.changes,
            "at_bound": list(refit.at_bound),
        }
    count = log["trajectory"].nunique() if args.piece_rows is None else None
    with progress(args, "Evaluating", count) as step:
        result = evaluate_log(log, params, progress=step)
    if args.json:
        print_json({**result.as_dict(), **extra})
        return DONE if result else UNTESTED
    _tell(result)
    for why in result.skipped.values():
        print(f"skipped: {why}")
    for name, change in extra.get("refit", {}).get("relative_change", {}).items():
        bound = ", at its bound" if name in extra["refit"]["at_bound"] else ""
        print(f"refitted: {name} {change:+.3%} to {params.get(name):.6g}{bound}")
    if not args.refit and params.tolerance and any(e.rmse > 1.5 * e.noise_floor for e in result.values()):
        note(args, f"the tolerances of {', '.join(params.tolerance)} may explain part of this: try --refit")
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


def _evaluate_system(args: argparse.Namespace, system: System) -> int:
    """Hold a log against the one equation of a cylinder, a joint or a muscle."""
    from ...systems import evaluate_system
    from ...systems.reference import doubts

    for option, given in (("--refit", args.refit), ("--piece-rows", args.piece_rows is not None)):
        if given:
            raise ParameterError(
                f"{option} is given for the page of a {system.kind}.",
                "a simulator of the bench, whose [tolerance] and size they are for",
                "Leave it out.",
            )
    log = load_log(args)
    result = evaluate_system(log, system)
    said = doubts(log, system)
    if args.json:
        print_json({"kind": system.kind, **result.as_dict(), "doubts": said})
        return 0
    _tell(result)
    for text in said:
        note(args, text)
    return DONE


def _evaluate_ported(args: argparse.Namespace, simulator: Simulator) -> int:
    """Hold a log against a simulator with ports."""
    for option, given in (("--refit", args.refit), ("--piece-rows", args.piece_rows is not None)):
        if given:
            raise ParameterError(
                f"{option} is given for a simulator with ports.", "a simulator of the bench", "Leave it out."
            )
    found = evaluation(load_log(args, ported=simulator), simulator)
    if args.json:
        print_json({"kind": simulator.kind, "equations": found})
        return DONE
    rows = [
        [e["equation"], number(e["rmse"]), number(100.0 * (1.0 - e["nrmse"])), number(e["noise_floor"]), e["unit"]]
        for e in found
    ]
    print(table(["equation", "rmse", "fit / %", "noise floor", "unit"], rows))
    return DONE


def _evaluate_model(args: argparse.Namespace) -> int:
    from ...persistence import inspect, load
    from .._tables import Scores, equation_of, predict_table, signal_table

    head = inspect(args.model)
    model = load(args.model)
    equation = equation_of(model, args.equation or head["metadata"].get("equation"))
    page = page_of(args) if args.sim else None
    page_numbers(page, kinds=equation.kinds)
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
