"""``pamid resid``: is the residual of a simulator or a model white and uncorrelated with the inputs?"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ...errors import ParameterError
from ...file_sets import replacing_together
from ...files import PROBE
from ...names import require_one_of
from .._progress import progress
from .._residuals import Left, residual_tables
from .._simulators import add_trust_option
from ..common import DONE, add_command, add_log_options, checked_output, number, print_json, table, wrapped

if TYPE_CHECKING:
    from ...compare.whiteness import ResidualTest

_DESCRIPTION = """\
Test the residual of a simulator (--sim) or a saved model (--model) on a log: is it white, and uncorrelated with the
inputs? A residual that is predictable from its own past contains something that a model could still learn; correlation
with an input means that the model misses part of that input's effect. At negative lags the residual leads, which
indicates feedback.

Bands are 99 % intervals at each lag; those of an input allow for the autocorrelation of both signals (Ljung). The
probabilities are for the whole curve: Ljung-Box for whiteness, lags from 0 on for an input. Lags do not cross the
boundaries of runs. A simulator is tested in windows (20 ms on the bench), a model row by row. Windows of equations with
derivatives (flow, joint) overlap, so noise alone makes neighbouring windows negatively correlated.
"""
_EXAMPLES = """\
  pamid resid log.parquet --sim sim.toml
  pamid resid run*.csv --columns columns.toml --sim cylinder.toml --lags 50 --out resid.png
  pamid resid new.csv --columns columns.toml --sim sim.toml --model force.pamid
"""


def add_parser(subparsers: Any) -> None:
    """Add the command."""
    parser = add_command(
        subparsers,
        "resid",
        "test whether a residual is white and uncorrelated with the inputs",
        _DESCRIPTION,
        _EXAMPLES,
    )
    add_log_options(parser)
    parser.add_argument("--sim", metavar="SIM.toml", help="simulator file (default: the one beside LOG)")
    parser.add_argument("--model", metavar="MODEL", help="model file of 'pamid fit' instead")
    parser.add_argument("--equation", metavar="NAME", help="equation to test (default: all that the log allows)")
    parser.add_argument("--lags", type=int, default=25, metavar="N", help="largest lag in rows (default: 25)")
    parser.add_argument("--out", metavar="FILE", help="picture, .png or .svg; with several equations one file each")
    add_trust_option(parser)


def run(args: argparse.Namespace) -> int:
    """Run the command."""
    from ...plots.style import checked_ending

    if args.lags < 1:
        raise ParameterError(f"--lags is {args.lags}.", "at least 1", "Correct the number.")
    if args.out is not None:
        checked_output(str(checked_ending(args.out)), [*args.log, args.sim, args.model], PROBE)
    with progress(args, "Simulating"):
        found = residual_tables(args)
    if args.equation is not None and args.model is None:
        require_one_of(args.equation, found, f"--equation is {args.equation}.")
        found = {args.equation: found[args.equation]}
    tests = {name: _test(left, args.lags) for name, left in found.items()}
    files = _draw(tests, args.out)
    if args.json:
        said = {k: {**t.as_dict(), "left_out": _left_out(t, found[k])} for k, t in tests.items()}
        print_json({"equations": said, "files": [str(f) for f in files]})
        return DONE
    for name, test in tests.items():
        _tell(name, test, found[name])
    for file in files:
        print(f"wrote {file}")
    return DONE


def _test(left: Left, lags: int) -> ResidualTest:
    import numpy as np

    from ...compare.whiteness import residual_test

    data = left.table
    inputs = {name: data[name] for name in _inputs(left)}
    steps = [np.diff(run["time"].to_numpy(dtype=float)) for _, run in data.groupby("trajectory", sort=False)]
    interval = float(np.median(np.concatenate(steps)))
    names = data["trajectory"].to_numpy()
    return residual_test(data["residual"], inputs, names, lags=lags, interval=interval)


def _inputs(left: Left) -> list[str]:
    return [str(c) for c in left.table.columns if c not in ("trajectory", "time", "residual")]


def _left_out(test: ResidualTest, left: Left) -> list[str]:
    """Return the inputs of which nothing can be said."""
    return [name for name in _inputs(left) if name not in test.cross]


def _draw(tests: dict[str, ResidualTest], out: str | None) -> list[Path]:
    if out is None:
        return []
    from ...plots import ResidualTestDisplay, save_figure

    target = Path(out)
    several = len(tests) > 1
    names = {e: f"{target.stem}-{e}{target.suffix}" if several else target.name for e in tests}
    with replacing_together(target.parent, list(names.values())) as stage:
        for equation, test in tests.items():
            save_figure(ResidualTestDisplay(test).plot().figure_, stage / names[equation])
    return [target.with_name(name) for name in names.values()]


def _tell(name: str, test: ResidualTest, left: Left) -> None:
    import numpy as np

    print(f"residual of the {name}: {test.n_rows:,} rows, one each {1e3 * test.interval:.4g} ms")
    lags = len(test.lags) - 1
    at = 1 + int(np.argmax(np.abs(test.auto[1:])))
    rows = [
        [
            "its own past",
            f"{test.outside()} of {lags}",
            number(test.auto[at]),
            _seconds(at, test),
            _chance(test.p_white),
        ]
    ]
    for key, values in test.cross.items():
        later = values[lags:]
        at = int(np.argmax(np.abs(later)))
        outside = f"{test.outside(key)} of {lags + 1}"
        rows.append([key, outside, number(later[at]), _seconds(at, test), _chance(test.p_input[key])])
    print(table(["correlated with", "lags outside", "largest", "at lag", "chance"], rows))
    print(wrapped("", _verdict(test, left)))
    if silent := _left_out(test, left):
        print(wrapped("", f"Not tested, since constant or mostly missing: {', '.join(silent)}."))
    print()


def _seconds(lag: int, test: ResidualTest) -> str:
    return f"{lag * test.interval:.3g} s"


def _chance(p: float) -> str:
    return "< 0.001" if p < 0.001 else f"{p:.3f}"


def _verdict(test: ResidualTest, left: Left) -> str:
    """Return the result of the test in a sentence."""
    from ...report.quantities import listed

    limit = 1.0 - test.level
    guilty = [name for name, p in test.p_input.items() if p < limit]
    if left.within_noise and (guilty or test.p_white < limit):  # a residual contains the noise of what it is made from
        return "No larger than the noise explains: correlations may come from this noise, not from the model."
    if guilty:
        return f"The model misses part of the effect of {listed(guilty)}, from which its residual can be predicted."
    if test.p_white < limit:
        return "Not white, but unrelated to the inputs: coloured noise, or a cause that no signal here shows."
    return "White and unrelated to the inputs: a linear model cannot learn anything more from these signals."
