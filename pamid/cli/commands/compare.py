"""``pamid compare``: every estimator of one equation on unseen runs, as one table and its plots."""

from __future__ import annotations

import argparse
import contextlib
import re
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ...errors import ExcitationError, MissingParameterError, ParameterError
from ...file_sets import check_folder, replacing_together
from ...requirements import WithVolume
from .._progress import progress
from ..common import add_command, add_log_options, load_log, note, page_numbers, page_of, print_json
from ..rows import add_where, rows_where

if TYPE_CHECKING:
    from ...compare import CandidateModel, Comparison
    from ...systems import System

_ROOM = 1 << 20
_DESCRIPTION = """\
Compare all estimators of one equation (or those of --estimators) on unseen runs, and print one table: root mean square
error over the held-out runs with its 90 % interval (bootstrap over runs), fit in per cent (100 % less the error divided
by the target's standard deviation, as in MATLAB's compare), difference to the best and whether it is significant (*),
time of a fit, time to predict 1000 rows, number of fitted parameters, and the noise floor of a perfect model.

Both muscles of a run stay in one fold. Rates are estimated within each run before the split. Estimators are fitted to
--rows rows, evenly thinned; the whole table takes a few minutes. An estimator that fails gets a line with its error.

A flow is compared over windows of 20 ms, because its law uses rates, which are mostly noise at single samples.

SIM.toml may also be the file of a muscle, a cylinder or a joint. For a cylinder or a joint, five models are compared:
the nominal equation, the same with gain and offset, the same with friction, and two without physics.

The inverse problem is the pressure for a measured force and contraction. The dynamic problem is a free run from the
first sample: the contraction of a muscle under its pressure and load, or the pressure under the valve's command.
"""
_EXAMPLES = """\
  pamid compare log.parquet --sim sim.toml --out results
  pamid compare log.parquet --sim sim.toml --equation flow --estimators ThermodynamicPIHM,GeometricFlow,MLP
  pamid compare festo/*.mat --columns festo.toml --rest-length 0.282 --rest-diameter 0.01 --where "F > 5"
  pamid compare festo/*.mat --columns festo.toml --sim festo.sim.toml --where "F > 5" --split kind
  pamid compare run*.csv --columns columns.toml --sim cylinder.toml
  pamid compare log.parquet --sim sim.toml --problem inverse
  pamid compare log.parquet --sim sim.toml --problem dynamic --split kind --out results
  pamid compare log.parquet --sim sim.toml --dask tcp://10.0.0.1:8786
"""


def add_parser(subparsers: Any) -> None:
    """Add the command."""
    parser = add_command(
        subparsers, "compare", "compare all estimators of one equation in one table", _DESCRIPTION, _EXAMPLES
    )
    add_log_options(parser)
    parser.add_argument(
        "--equation",
        "--problem",
        choices=("force", "flow", "inverse", "dynamic"),
        default="force",
        help="what is predicted: force, flow, the pressure for a force and contraction (inverse), or an output in free "
        "run (dynamic) (default: force)",
    )
    parser.add_argument(
        "--predict",
        choices=("eps", "P"),
        help="output of the dynamic problem: contraction under pressure and load, or pressure under the command of the "
        "valve (default: eps if the log has a load)",
    )
    parser.add_argument(
        "--sim",
        metavar="SIM.toml",
        help="simulator file, needed unless the log has eps and P (default: LOG.sim.toml or sim.toml beside LOG)",
    )
    parser.add_argument(
        "--estimators",
        metavar="A,B,...",
        default="all",
        help="names such as StaticPIHM,MLP; one setting: 'GeometricForce(tondu_lopez)'; a pattern: 'StaticPIHM*' "
        "(default: all)",
    )
    parser.add_argument("--folds", type=int, default=5, metavar="K", help="folds of whole runs (default: 5)")
    parser.add_argument(
        "--split",
        choices=("run", "kind"),
        default="run",
        help="hold out single runs, or one kind of run at a time: sines, steps, one contraction (default: run)",
    )
    parser.add_argument(
        "--rows", type=int, default=5000, metavar="N", help="largest number of rows of a fit (default: 5000)"
    )
    parser.add_argument(
        "--score-rows",
        type=int,
        default=50_000,
        metavar="N",
        help="largest number of held-out rows to score (default: 50000)",
    )
    add_where(parser)
    parser.add_argument(
        "--cutoff", type=float, metavar="HZ", help="cut-off frequency of the rates (default: chosen from the signals)"
    )
    parser.add_argument(
        "--window",
        type=float,
        metavar="S",
        help="average over windows of S seconds, 0 for none (default: 0.02 for a flow)",
    )
    for name, unit in (("rest-length", "M"), ("rest-diameter", "M"), ("ambient", "PA")):
        parser.add_argument(
            f"--{name}",
            type=float,
            metavar=unit,
            help=f"{name.replace('-', ' ')} of the muscle, if there is no --sim"
            if name != "ambient"
            else "ambient pressure, absolute, if there is no --sim",
        )
    parser.add_argument(
        "--jobs", type=int, default=1, metavar="N", help="fits that run at once on this machine (default: 1)"
    )
    parser.add_argument(
        "--dask",
        metavar="ADDRESS|N",
        help="spread the fits over the dask cluster at an address, or over N worker processes of this machine",
    )
    parser.add_argument("--out", metavar="DIR", help="folder for the table (csv, json) and the plots (png)")


def run(args: argparse.Namespace) -> int:
    """Run the command."""
    if args.folds < 2:
        raise ParameterError(f"--folds is {args.folds}.", "at least 2", "Correct the number.")
    if args.jobs < 1:
        raise ParameterError(f"--jobs is {args.jobs}.", "at least 1", "Correct the number.")
    folder = check_folder(args.out, parents=True, size=_ROOM) if args.out else None
    with _workers(args.dask):
        return _run(args, folder)


def _workers(dask: str | None) -> contextlib.AbstractContextManager[Any]:
    """Return where fits run: here, or on a cluster."""
    from ...distributed import on_dask

    if dask is None:
        return contextlib.nullcontext()
    return on_dask(n_workers=int(dask)) if dask.isdecimal() else on_dask(dask)


def _run(args: argparse.Namespace, folder: Path | None) -> int:
    from ...compare import candidates, compare
    from ...compare.entries import target_of
    from .._tables import TARGETS, Target, signal_table

    started = time.perf_counter()
    page = page_of(args)
    if page is not None and page.kind not in TARGETS["force"].kinds:
        return _compare_system(args, page, folder, started)
    log = load_log(args, nan="drop")
    output = args.predict or ("eps" if "load" in log.columns else "P")
    target = TARGETS.get(args.equation) or Target(args.equation, *target_of(args.equation, output))
    signals = signal_table(log, page, target)
    parameters = page_numbers(page, args.columns)
    own = {"rest_length": args.rest_length, "rest_diameter": args.rest_diameter, "atmospheric_pressure": args.ambient}
    parameters |= {name: value for name, value in own.items() if value is not None}
    chosen = _names(args.estimators)
    measured = [target.column, *(t.column for t in (TARGETS["force"], TARGETS["flow"]) if t.column in signals)]
    entries = candidates(
        args.equation, chosen, parameters=parameters, targets=measured, random_state=args.seed, output=output
    )
    _require_sizes(entries, parameters)
    rows = rows_where(signals, args.where)
    with progress(args, "Comparing") as step:
        result = compare(
            signals,
            args.equation,
            chosen,
            rows=rows,
            parameters=parameters,
            tuning=args.cutoff if args.cutoff is not None else "auto",
            window=args.window if args.window is not None else "auto",
            output=output,
            progress=step,
            **_how(args),
            n_jobs=None if args.dask else args.jobs,
        )
    files: list[Path] = []
    if folder is not None:
        names = [f"{kind}-{result.equation}.png" for kind in ("comparison", "fit", "volume")]
        names += [f"comparison-{result.equation}.{ending}" for ending in ("csv", "json")]
        with replacing_together(folder, names, parents=True) as stage:
            drafts = [*result.write(stage), *draw(result, stage, parameters)]
        files = [folder / draft.name for draft in drafts]
    return _tell(args, result, files, started)


def _how(args: argparse.Namespace) -> dict[str, Any]:
    """Return how models are compared: folds, rows and seed."""
    rows = {"fit_rows": args.rows, "score_rows": args.score_rows}
    return {"cv": args.folds, "split": args.split, "random_state": args.seed, **rows}


def _tell(args: argparse.Namespace, result: Comparison, files: list[Path], started: float) -> int:
    """Print a comparison."""
    if args.json:
        print_json({**result.to_dict(), "files": [str(f) for f in files]})
        return 0
    print(result)
    for file in files:
        print(f"wrote {file}")
    warned = [s.estimator for s in result.scores if s.warnings]
    if warned:
        note(args, f"{', '.join(warned)} warned during fits; --json shows the warnings")
    note(args, f"took {time.perf_counter() - started:.0f} s")
    return 0


def _compare_system(args: argparse.Namespace, system: System, folder: Path | None, started: float) -> int:
    """Compare models of the one equation of a cylinder or a joint."""
    from ...plots import comparison_plot
    from ...systems.comparison import compare_system

    if args.equation != "force":
        raise ParameterError(
            f"--equation is {args.equation}, but SIM.toml is the file of a {system.kind}, which has one equation.",
            "no --equation",
            "Leave it out.",
        )
    log = load_log(args, nan="drop")
    with progress(args, "Comparing") as step:
        result = compare_system(
            log,
            system,
            _names(args.estimators),
            rows=lambda table: rows_where(table, args.where),
            progress=step,
            **_how(args),
        )
    files: list[Path] = []
    if folder is not None:
        names = [f"comparison-{result.equation}.{ending}" for ending in ("csv", "json", "png")]
        with replacing_together(folder, names, parents=True) as stage:
            result.write(stage)
            comparison_plot(result, stage / names[-1])
        files = [folder / name for name in names]
    return _tell(args, result, files, started)


def _require_sizes(entries: Sequence[CandidateModel], parameters: dict[str, Any]) -> None:
    """Raise where an estimator would fall back on the size of another muscle."""
    from .._tables import SIZES

    taken = {name for e in entries for name in e.estimator.get_params()}
    if lacking := [size for size in SIZES if size in taken and size not in parameters]:
        raise MissingParameterError(
            f"Missing: {' and '.join(lacking)} of the muscle, which some of the estimators need.",
            "the size of the muscle that was recorded",
            f"Add --sim SIM.toml, or --{lacking[0].replace('_', '-')} in m; or choose others with --estimators.",
        )


def draw(result: Any, folder: Path, parameters: dict[str, Any]) -> list[Path]:
    """Draw a comparison, its best fit, and the volume of the best estimator that identifies one."""
    from ...plots import comparison_plot, fit_plot, volume_plot

    name = result.equation
    files = [folder / f"comparison-{name}.png", folder / f"fit-{name}.png"]
    comparison_plot(result, files[0])
    fit_plot(result, None, files[1])
    geometry = {k: parameters[k] for k in ("rest_length", "rest_diameter", "braid_angle") if k in parameters}
    for score in result.scores:
        model = result.fitted.get(score.estimator)
        if isinstance(model, WithVolume) and getattr(model, "form", "area") == "area":
            level = name != "force" or hasattr(model, "rest_diameter")  # else a force tells the slope alone
            title = f"{'Volume' if level else 'Slope of the volume'} identified by {score.estimator}"
            file = folder / f"volume-{name}.png"
            with contextlib.suppress(ExcitationError):  # an isometric log tells no volume over the contraction
                volume_plot(model, result.rows, file, title=title, level=level, **geometry)
                files.append(file)
            break
    return files


def _names(text: str) -> str | list[str]:
    """Cut a list at its commas, those within brackets left alone; "all" stays as it is."""
    return "all" if text == "all" else [name.strip() for name in re.split(r",(?![^()]*\))", text) if name.strip()]
