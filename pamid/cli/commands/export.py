"""``pamid export``: a saved model as C99, ONNX or an FMU."""

import argparse
from pathlib import Path
from typing import Any

from ...errors import ExportError, PamidError
from ...file_sets import check_folder
from ..common import add_command, load_simulator, note, print_json

_DESCRIPTION = """\
Write a fitted model in another language: dependency-free C99 (fixed memory, no heap, analytic derivatives, a
self-test with reference values), an ONNX graph, or an FMU (FMI 3.0, co-simulation) built from the C code.

Inputs of a hybrid model are eps, deps, P (Pa, absolute) and dP; outputs are the predictions, the gas volume and its
derivatives. Models that are formulas (geometric, polynomial, empirical, inverse, residual hybrid) have the columns of
the training data as inputs. A model that cannot be exported is refused, and the message names the part that prevents
it.
"""
_EXAMPLES = """\
  pamid export force.pamid --to c --out controller --name force
  pamid export flow.pamid --to onnx --dtype float32 --out graphs --name flow
  pamid export force.pamid --to fmu --out fmus --effect viscous_friction:coefficient=40 --sim sim.toml
"""


def add_parser(subparsers: Any) -> None:
    """Add the command."""
    parser = add_command(subparsers, "export", "write a saved model as C, ONNX or an FMU", _DESCRIPTION, _EXAMPLES)
    parser.add_argument("model", metavar="MODEL", help="model file of 'pamid fit'")
    parser.add_argument("--to", choices=("c", "onnx", "fmu"), default="c", help="what to write (default: c)")
    parser.add_argument("--out", metavar="DIR", required=True, help="folder to write to; created if missing")
    parser.add_argument(
        "--name",
        default="muscle",
        metavar="NAME",
        help="name of the files and prefix of all names in the code (default: muscle)",
    )
    parser.add_argument(
        "--dtype", choices=("float64", "float32"), default="float64", help="floating type (default: float64)"
    )
    parser.add_argument(
        "--effect",
        metavar="NAME[:PARAMETER=VALUE,...]",
        action="append",
        default=[],
        help="an effect without memory to add to the predictions; repeatable",
    )
    parser.add_argument("--sim", metavar="SIM.toml", help="simulator file that the effects refer to")


def run(args: argparse.Namespace) -> int:
    """Run the command."""
    from ...export import export
    from ...export.write import any_plan_of
    from ...persistence import load
    from .simulate import spec_of

    check_folder(args.out, parents=True)
    effects = [spec_of(text).make() for text in args.effect]
    plant = load_simulator(args.sim).plant() if args.sim else None
    model = load(args.model)
    try:
        files = export(model, args.out, args.to, name=args.name, dtype=args.dtype, effects=effects, plant=plant)
        plan = any_plan_of(model, args.name, effects, plant)
    except PamidError:
        raise
    except Exception as error:  # a file may describe a model whose parts do not belong together
        raise ExportError(
            f"{Path(args.model).name} holds inconsistent parts: {type(error).__name__}: {str(error)[:120]}",
            "a whole fitted model",
            "Fit and save it again.",
        ) from error
    for text in plan.notes:
        note(args, text)
    outputs = {o.name: o.unit for o in plan.outputs}
    if args.json:
        print_json({"to": args.to, "dtype": args.dtype, "files": [str(f) for f in files], "outputs": outputs})
        return 0
    print(f"{plan.estimator} as {args.to}: {', '.join(f'{name} ({unit})' for name, unit in outputs.items())}")
    for file in files:
        print(f"wrote: {file}")
    if args.to == "c":
        test = f"{args.name}_selftest"
        print(f"test it: cd {args.out} && cc -std=c99 -O3 {args.name}.c {test}.c -lm -o {test} && ./{test}")
    return 0
