"""Simulators with ports on the command line: reading them, with trust or without."""

from __future__ import annotations

import argparse
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

    code, _, name = str(page).rpartition(":")
    if code.endswith(".py"):
        raise ParameterError(
            f"--sim names the function {name} of {code}; its signals and their units must come from a simulator file.",
            "a simulator file beside it",
            'Write sim.toml with kind = "ode" (rates of states) or "function", '
            f'[ode] function = "{Path(code).name}:{name}", [ports] such as u = {{ kind = "input", unit = "V" }} and '
            'x = { kind = "state", unit = "m" }, states in the order of their rates, and [parameters]; then: '
            "pamid init LOG --sim sim.toml.",
        )
    if page.suffix.lower() != ".toml":
        raise ParameterError(
            f"--sim names {page}.",
            f"a model or a simulator file: {', '.join(MODELS)} or .toml",
            "Name the model itself, or write a simulator file for it: docs/simulators.md.",
        )
    return read_simulator(page, trust=True) if trust else read_outline(page)
