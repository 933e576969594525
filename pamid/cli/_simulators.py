"""Simulators with ports on the command line: reading them, with trust or without."""

from __future__ import annotations

import argparse
import ast
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ..simulators import Simulator


def add_trust_option(parser: argparse.ArgumentParser) -> None:
    """Add the user's word that a simulator's code may run."""
    parser.add_argument(
        "--trust",
        action="store_true",
        help="let the code that SIM names (a Python function, an FMU) run; without this option pamid runs none",
    )


def runs_code(sim: str) -> bool:
    """Return whether diagnosing with a simulator runs code of its own, which the user must allow."""
    from ..simulators import simulator_kinds
    from ..simulators.page import MODELS
    from ..systems.file import kind_of_file

    path = Path(sim)
    if path.suffix.lower() in MODELS:
        return path.suffix.lower() == ".fmu"
    kind = simulator_kinds().get(kind_of_file(path))
    return kind is not None and kind.executes


def outline(page: Path, trust: bool = False) -> Simulator:
    """Return the ports that a simulator file says; without trust nothing runs."""
    from ..errors import ParameterError
    from ..simulators import read_simulator
    from ..simulators.page import MODELS, read_outline

    if page.suffix.lower() != ".toml":
        raise ParameterError(
            f"--sim names {page}.",
            f"a model or a simulator file: {', '.join(MODELS)} or .toml",
            "Name the model itself, or write a simulator file for it: docs/simulators.md.",
        )
    return read_simulator(page, trust=True) if trust else read_outline(page)


def coded(sim: str, trust: bool) -> Simulator | None:
    """Return the python-control system that ``FILE.py:NAME`` names; None where a simulator is no Python code."""
    from ..errors import ParameterError, SimulatorNotFoundError, UntrustedCodeError
    from ..simulators.control_model import ControlSimulator

    file, _, name = sim.rpartition(":") if ".py:" in sim else (sim, "", "")
    if not file.endswith(".py"):
        return None
    path = Path(file)
    if not path.is_file():
        raise SimulatorNotFoundError(f"{path} does not exist.", "a Python file", "Check the path.")
    takes = _top_level(path)
    if name not in takes:
        raise ParameterError(
            f"--sim names {f'{name!r}, which {path} does not define' if name else f'{path}, but no object in it'}.",
            f"--sim {path}:NAME with one of {', '.join(takes) or 'its functions'}",
            f"Name it, for instance --sim {path}:{next(iter(takes), 'system')}.",
        )
    if takes[name]:
        raise ParameterError(
            f"--sim names the function {name}({', '.join(takes[name])}) of {path}, which says neither the order nor "
            "the units of its signals.",
            "a simulator file beside it",
            'Write sim.toml with kind = "ode" (rates of states) or "function", '
            f'[ode] function = "{path.name}:{name}", [ports] such as u = {{ kind = "input", unit = "V" }} and '
            'x = { kind = "state", unit = "m" }, states in the order of their rates, and [parameters]; then: '
            "pamid init LOG --sim sim.toml.",
        )
    if not trust:
        raise UntrustedCodeError(
            f"The signals of {name} are known only once {path} runs.",
            "your permission to run it",
            "Read that code, then add --trust.",
        )
    return ControlSimulator.from_page("control", {"system": f"{path.name}:{name}"}, (), {}, (), path.parent)


def _top_level(path: Path) -> dict[str, list[str]]:
    """Return what a Python file defines, with the arguments that a function needs, without running it."""
    from ..errors import ParameterError

    try:
        body = ast.parse(path.read_bytes()).body
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        raise ParameterError(f"{path} is not valid Python: {error}.", "a Python file", "Correct it.") from None
    found: dict[str, list[str]] = {}
    for node in body:
        if isinstance(node, ast.FunctionDef):
            every = [a.arg for a in (*node.args.posonlyargs, *node.args.args)]
            found[node.name] = every[: len(every) - len(node.args.defaults)]
        elif isinstance(node, ast.Assign | ast.AnnAssign):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            found |= {n.id: [] for target in targets for n in ast.walk(target) if isinstance(n, ast.Name)}
    return {name: needs for name, needs in found.items() if not name.startswith("_")}
