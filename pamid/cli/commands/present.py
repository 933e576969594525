"""``pamid present``: a saved model as a page of text: what it is, its parameters with errors, its fit, its poles."""

import argparse
import inspect
from typing import Any

from ...requirements import last_step, parameter_count
from .._fitting import fitted_parameters, parameter_lines
from .._style import plain
from ..common import DONE, add_command, number, print_json, table

_DESCRIPTION = """\
Show a model saved by 'pamid fit' or pamid.save: class and settings, parameters with standard errors and units, fit on
the training log and on unseen runs, and poles and order of a linear model.
"""
_EXAMPLES = """\
  pamid present force.pamid
  pamid present force.pamid --json
"""
_LONG = 60  # characters of a setting that are shown


def add_parser(subparsers: Any) -> None:
    """Add the command."""
    parser = add_command(
        subparsers,
        "present",
        "show a saved model's parameters, their standard errors and its fit",
        _DESCRIPTION,
        _EXAMPLES,
    )
    parser.add_argument("model", metavar="MODEL", help="model file")


def run(args: argparse.Namespace) -> int:
    """Run the command."""
    from ...persistence import inspect, load

    head, model = inspect(args.model), load(args.model)
    last = last_step(model)
    found = {
        "class": head["class"],
        "steps": head["steps"],
        "created": head["created"],
        "equation": head["metadata"].get("equation"),
        "unit": head["metadata"].get("unit"),
        "fits": _fits(head["metadata"]),
        "settings": _settings(last),
        "parameters": fitted_parameters(last),
        "n_parameters": parameter_count(last),
        "poles": [[float(p.real), float(p.imag)] for p in getattr(last, "poles_", [])],
        "orders": list(getattr(last, "orders_", [])),
    }
    if args.json:
        print_json(found)
        return DONE
    _tell(found, type(last).__name__)
    return DONE


def _fits(metadata: dict[str, Any]) -> dict[str, dict[str, float]]:
    """Return root mean square error and fit of each set of rows that the file tells of."""
    told = {"the log of the fit": metadata.get("training"), "runs not seen": metadata.get("held_out")}
    return {
        name: {"rmse": float(s["rmse"]), "fit": 100.0 * (1.0 - float(s["nrmse"]))}
        for name, s in told.items()
        if isinstance(s, dict) and all(isinstance(s.get(k), (int, float)) for k in ("rmse", "nrmse"))
    }


def _settings(model: Any) -> dict[str, str]:
    """Return the settings that differ from the defaults."""
    defaults = {k: p.default for k, p in inspect.signature(type(model)).parameters.items()}
    given = model.get_params(deep=False)
    return {k: str(v) for k, v in given.items() if str(v) != str(defaults.get(k))}


def _tell(found: dict[str, Any], name: str) -> None:
    steps = f", after {' and '.join(map(str, found['steps'][:-1]))}" if len(found["steps"]) > 1 else ""
    of = f" of the {found['equation']}" if found["equation"] else ""
    print(plain(f"{name}{of}{steps}; written {found['created']}"))
    if found["n_parameters"] is not None:
        print(f"{found['n_parameters']} fitted parameters")
    if found["settings"]:
        print(plain("settings  " + ", ".join(f"{k}={v[:_LONG]}" for k, v in found["settings"].items())))
    if found["fits"]:
        rows = [[where, number(s["rmse"]), number(s["fit"])] for where, s in found["fits"].items()]
        print("\n" + table(["on", f"rmse / {found['unit'] or 'unit of y'}", "fit / %"], rows))
    if found["parameters"]:
        print("\n" + parameter_lines(found["parameters"]))
    if found["poles"]:
        print("\npoles     " + ", ".join(f"{a:.4g}" + (f"{b:+.4g}i" if b else "") for a, b in found["poles"]))
    if found["orders"]:
        rows = [[str(r["order"]), number(r["correlation"]), number(r["fit"])] for r in found["orders"]]
        print("\n" + table(["order", "correlation", "fit / %"], rows))
