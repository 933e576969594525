"""``pamid fit``: fit an estimator to a log, say how well it holds on unseen runs, save it."""

import argparse
import time
from typing import Any

from ...errors import ParameterError
from .._fitting import (
    fitted_parameters,
    held_out,
    hold_causes,
    hybrid_for,
    parameter_lines,
    pipeline,
    read_causes,
    with_rates,
)
from .._progress import progress
from ..common import (
    add_command,
    add_log_options,
    checked_output,
    load_log,
    number,
    page_numbers,
    page_of,
    parse_settings,
    print_json,
    table,
)

_DESCRIPTION = """\
Fit an estimator to a log and save it: force or mass flow of a muscle, force of a cylinder, drive of a joint.

First a grouped cross-validation fits the estimator to most runs and scores it on the others: the error to expect on
unseen runs. Then it is fitted to all runs and written to --out.
Rates (deps, dP) are not logged; if the estimator needs them they are estimated within each run, and this becomes the
first step of the saved pipeline. --sim gives the contraction (from the joint angle) and the initial geometry of the
estimator. The default --estimator depends on the simulator file: GeometricForce for a muscle or a bench,
CylinderForce for a cylinder, JointDrive for a joint.
"""
_EXAMPLES = """\
  pamid fit log.parquet --estimator StaticPIHM --sim sim.toml --out force.pamid
  pamid fit log.parquet --estimator GeometricFlow --sim sim.toml --out flow.pamid --set model=tondu_lopez
  pamid fit run*.csv --columns columns.toml --sim cylinder.toml --out cylinder.pamid
  pamid fit festo/*.csv --columns columns.toml --estimator MLP --equation force --set max_iter=50 --out mlp.pamid
"""


_CORRELATED = ("cylinder", "drive")
"""Targets whose standard errors count blocks of runs instead of rows."""
_BLOCKS = 10


def add_parser(subparsers: Any) -> None:
    """Add the command."""
    parser = add_command(subparsers, "fit", "fit an estimator to a log and save it", _DESCRIPTION, _EXAMPLES)
    add_log_options(parser)
    parser.add_argument(
        "--estimator", metavar="NAME", help="name of the estimator, such as StaticPIHM (default: depends on SIM.toml)"
    )
    parser.add_argument(
        "--equation", choices=("force", "flow"), help="what to predict, if the estimator leaves it open"
    )
    parser.add_argument("--sim", metavar="SIM.toml", help="simulator file; needed unless the log has eps and P")
    parser.add_argument("--out", metavar="MODEL.pamid", required=True, help="file to write the model to")
    parser.add_argument(
        "--set", metavar="NAME=VALUE", action="append", default=[], help="parameter of the estimator; repeatable"
    )
    parser.add_argument(
        "--checkpoint",
        metavar="DIR",
        help="folder for the state of the training: after a crash, the same command resumes from it",
    )
    parser.add_argument(
        "--diagnosis",
        metavar="DIR",
        help="output folder of 'pamid diagnose': its causes become effects of a hybrid model",
    )
    parser.add_argument("--folds", type=int, default=3, metavar="K", help="folds of the held-out check, 0 for none")
    parser.add_argument("--thin", type=int, default=1, metavar="N", help="fit on every N-th sample only (default: all)")


def run(args: argparse.Namespace) -> int:
    """Run the command."""
    from sklearn.base import clone

    from ...persistence import save
    from .._tables import equation_of, make_estimator, predict_table, score_by_trajectory, settle, signal_table

    out = checked_output(args.out, [*args.log, args.sim, args.columns])
    if args.thin < 1 or args.folds < 0 or args.folds == 1:
        raise ParameterError(
            f"--thin is {args.thin} and --folds is {args.folds}.",
            "--thin of at least 1, --folds 0 or at least 2",
            "Correct the number.",
        )
    page = page_of(args)
    given, causes = parse_settings(args.set), read_causes(args.diagnosis) if args.diagnosis else None
    args.estimator = args.estimator or (hybrid_for(args.equation) if causes is not None else _of_page(page))
    estimator = make_estimator(args.estimator, given, args.seed, lambda kinds: page_numbers(page, args.columns, kinds))
    target = equation_of(estimator, args.equation)
    if causes is not None:
        hold_causes(estimator, causes, args)
    trainer = _keep_state(estimator, args) if args.checkpoint is not None else None
    if args.thin > 1 and "one_trajectory" in estimator.get_params():
        raise ParameterError(
            f"--thin is {args.thin}, and {args.estimator} learns from the sequence of samples.",
            "every sample, as in a prediction",
            "Leave --thin out, or resample the log first.",
        )
    log = load_log(args, nan="drop")
    signals = signal_table(log, page, target)
    steps, features = with_rates(signals, estimator, target)
    known = signals[target.column].notna()
    features, signals = features[known], signals[known]
    speed = features.get("dx", features.get("dq"))
    settle(estimator, speed, "" if page is None else page.unit_of(log.columns), given)
    target = equation_of(estimator, args.equation)
    # After a step of rates the estimator sees all that this step gives, as it will when the saved pipeline predicts.
    columns = list(features.columns) if steps else ["trajectory", *_inputs(features, estimator)]
    scores = None
    rows = slice(None, None, args.thin)
    with progress(args, f"Fitting {args.estimator}", 1) as step:
        if args.folds:
            y = signals[target.column]
            predicted = held_out(
                args, lambda X, y: _fit_every(args.thin, clone(estimator), X, y), features[columns], y, signals["run"],
                step,
            )  # fmt: skip
            scores = score_by_trajectory(signals, predicted, target)
        started = time.perf_counter()
        given_runs = {"groups": _blocks(signals["trajectory"].iloc[rows])} if target.name in _CORRELATED else {}
        fitted = _fit_every(args.thin, estimator, features[columns], signals[target.column], **given_runs)
    seconds = time.perf_counter() - started
    if args.checkpoint is not None:
        fitted.set_params(trainer=trainer)  # a path of this machine is no part of the model
    model = pipeline(steps, fitted)
    predicted = predict_table(fitted, features[columns])
    training = score_by_trajectory(signals, predicted, target)
    metadata = {"equation": target.name, "unit": target.unit, "estimator": args.estimator, "logs": list(args.log)}
    metadata["training"] = {"rmse": training["rmse"], "nrmse": training["nrmse"]}
    if scores is not None:
        metadata["held_out"] = {"rmse": scores["rmse"], "nrmse": scores["nrmse"], "folds": args.folds}
    save(model, out, metadata)
    found = fitted_parameters(fitted)
    report = {
        "model": str(out),
        "estimator": args.estimator,
        "equation": target.name,
        "unit": target.unit,
        "training": {k: training[k] for k in ("rmse", "nrmse", "n_samples")},
        "held_out": scores,
        "fit_seconds": seconds,
        "n_iter": getattr(fitted, "n_iter_", None),
        "parameters": found,
    }
    if args.json:
        print_json(report)
        return 0
    lines = [_line("training", training)]
    if scores is not None:
        lines.append(_line("held out", scores))
    print(table([args.estimator, f"rmse / {target.unit}", "fit / %", "samples"], lines))
    if found:
        print(parameter_lines(found))
    if (bore := getattr(fitted, "bore_", None)) is not None and page is not None:
        print(
            f"the area is that of a bore of {1e3 * bore:.4g} mm; the simulator file says "
            f"{1e3 * page.number('bore'):.4g} mm"
        )
    print(f"saved: {out} (fitted in {seconds:.2f} s)")
    return 0


def _of_page(page: Any) -> str:
    """Return the estimator that fits the parameters of a page."""
    if page is None:
        raise ParameterError(
            "Neither --estimator nor --sim is given.",
            "an estimator, or the simulator file of a system, which has a default one",
            "Add --estimator NAME ('pamid compare' compares them), or --sim SIM.toml ('pamid init' writes one).",
        )
    return str(page.estimator)


def _line(name: str, scores: dict[str, Any]) -> list[str]:
    return [name, number(scores["rmse"]), number(100.0 * (1.0 - scores["nrmse"])), str(scores["n_samples"])]


def _keep_state(estimator: Any, args: argparse.Namespace) -> Any:
    """Make the estimator's trainer keep its state in a folder; return the original trainer."""
    from sklearn.base import clone

    from ...training import trainer_named

    parameters = estimator.get_params()
    if "trainer" not in parameters:
        raise ParameterError(
            f"--checkpoint is given, and {args.estimator} has no trainer that keeps its state.",
            "a hybrid model, such as StaticPIHM",
            "Leave --checkpoint out: the fit takes seconds.",
        )
    if parameters.get("random_state") is None:
        estimator.set_params(random_state=args.seed)  # a training is known again by its random numbers
    estimator.set_params(trainer=clone(trainer_named(parameters["trainer"])).set_params(checkpoint=args.checkpoint))
    return parameters["trainer"]


def _inputs(features: Any, estimator: Any) -> list[str]:
    from .._tables import needed_signals

    return [name for name in needed_signals(estimator) if name in features.columns]


def _blocks(runs: Any) -> Any:
    """Number tenths of runs, within which residuals are correlated: standard errors over them are batch means."""
    place, rows = runs.groupby(runs, sort=False).cumcount(), runs.map(runs.value_counts())
    return (runs.astype(str) + "/" + (_BLOCKS * place // rows).astype(str)).to_numpy()


def _fit(estimator: Any, X: Any, y: Any, **given: Any) -> Any:
    """Fit, with scikit-learn's complaints about parameters turned into pamid's."""
    from sklearn.utils._param_validation import InvalidParameterError

    try:
        return estimator.fit(X, y, **given)
    except InvalidParameterError as error:
        raise ParameterError(str(error), "a value that the estimator takes", "Correct the --set option.") from None


def _fit_every(step: int, estimator: Any, X: Any, y: Any, **given: Any) -> Any:
    """Fit on every so many rows; those between carry what effects remember, and count for nothing else."""
    import numpy as np

    if step > 1 and getattr(estimator, "effects", None):
        return _fit(estimator, X, y, sample_weight=(np.arange(len(X)) % step == 0).astype(float))
    return _fit(estimator, X.iloc[::step], y.iloc[::step], **given)
