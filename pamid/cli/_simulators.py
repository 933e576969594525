"""Simulators with ports on the command line: reading them, with trust or without, and writing them corrected."""

from __future__ import annotations

import argparse
import contextlib
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..files import write_whole

if TYPE_CHECKING:
    from ..simulators import Simulator

MODELS = (".xml", ".fmu")
"""Endings of models that --sim may name itself, with a page of the same name beside them or without."""
CORRECTED = ("corrected.toml", "corrected.xml", "corrected.py", "corrected.fmu", "start_values.json")
"""What a corrected simulator may consist of."""
_CALLBACK = '''"""corrected.xml with what MJCF has no element for, as callbacks of MuJoCo. Written by pamid.

model, acting = load()
data = mujoco.MjData(model)
with acting:
    mujoco.mj_step(model, data)
"""

from pathlib import Path

from pamid.simulators.mujoco_callback import corrected


def load():
    """Return the model, and the effects of corrected.toml that act while they are a context."""
    return corrected(Path(__file__).with_name("corrected.toml"))
'''


def add_trust_option(parser: argparse.ArgumentParser) -> None:
    """Add the user's word that a simulator's code may run."""
    parser.add_argument(
        "--trust",
        action="store_true",
        help="the code that SIM names (a Python function, an FMU) may run; pamid never runs any without this",
    )


def port_simulator_of(args: argparse.Namespace) -> Simulator | None:
    """Read the simulator with ports that --sim names; None where it names another kind of page, or nothing."""
    if not args.sim:
        return None
    from ..simulators import read_simulator, simulator_kinds
    from ..systems import kind_of_file

    path, trust = Path(args.sim), bool(getattr(args, "trust", False))
    if path.suffix.lower() in MODELS:
        page = path.with_suffix(".toml")
        return read_simulator(page, trust=trust) if page.is_file() else bare_model(path, trust)
    return read_simulator(path, trust=trust) if kind_of_file(path) in simulator_kinds() else None


def runs_code(sim: str) -> bool:
    """Tell whether diagnosing with a simulator runs code of its own, which the user must allow."""
    from ..simulators import simulator_kinds
    from ..systems import kind_of_file

    path = Path(sim)
    if path.suffix.lower() in MODELS:
        return path.suffix.lower() == ".fmu"
    kind = simulator_kinds().get(kind_of_file(path))
    return kind is not None and kind.executes


def bare_model(path: Path, trust: bool = False) -> Simulator:
    """Return a model without a page: its ports stand in columns of their own names."""
    from ..simulators import FmuSimulator, MujocoSimulator

    return FmuSimulator(path, trust=trust) if path.suffix.lower() == ".fmu" else MujocoSimulator(path)


def outline(page: Path, trust: bool = False) -> Simulator:
    """Return the ports that a page says; without trust nothing runs."""
    from ..errors import ParameterError
    from ..simulators import read_simulator
    from ..simulators.page import read_outline

    code, _, name = str(page).rpartition(":")
    if code.endswith(".py"):
        raise ParameterError(
            f"--sim names the function {name} of {code}; which signals it has, in which units, only a page can say.",
            "a page beside it",
            'Write sim.toml with kind = "ode" (rates of states) or "function", '
            f'[ode] function = "{Path(code).name}:{name}", [ports] such as u = {{ kind = "input", unit = "V" }} and '
            'x = { kind = "state", unit = "m" }, states in the order of their rates, and [parameters]; then: '
            "pamid init LOG --sim sim.toml.",
        )
    if page.suffix.lower() != ".toml":
        raise ParameterError(
            f"--sim names {page}.",
            f"a model or a page: {', '.join(MODELS)} or .toml",
            "Name the model itself, or write a page for it: docs/simulators.md.",
        )
    return read_simulator(page, trust=True) if trust else read_outline(page)


def write_corrected(simulator: Simulator, stage: Path, folder: Path) -> None:
    """Write a corrected simulator into a stage that becomes a folder.

    Parameters
    ----------
    simulator : Simulator
        The simulator with the causes.
    stage : Path
        Where files are written.
    folder : Path
        Where they will lie: what the page refers to is named from there.
    """
    from ..errors import ExportError
    from ..simulators import FmuSimulator, MujocoSimulator, page_text
    from ..simulators.fmu_wrapper import wrapped

    if isinstance(simulator, MujocoSimulator):
        text, rest = simulator.corrected_xml()
        write_whole(stage / "corrected.xml", text)
        page = page_text(simulator.with_({}, rest), folder)
        home = page.split('model = "', 1)[1].split('"', 1)[0]
        write_whole(stage / "corrected.toml", page.replace(f'model = "{home}"', 'model = "corrected.xml"', 1))
        if rest:
            write_whole(stage / "corrected.py", _CALLBACK)
        return
    if isinstance(simulator, FmuSimulator):
        write_whole(stage / "start_values.json", json.dumps(simulator.start_values(), indent=1) + "\n")
        with contextlib.suppress(ExportError):  # the page does without
            write_whole(stage / "corrected.fmu", wrapped(simulator))
    write_whole(stage / "corrected.toml", page_text(simulator, folder))


def evaluation(log: Any, simulator: Simulator) -> list[dict[str, Any]]:
    """Return how far a simulator is off, one entry an equation."""
    import numpy as np

    from ..gap.simulated import evidence_of

    evidence = evidence_of(log, simulator)
    found = []
    for equation, part in zip(evidence.equations, evidence.parts, strict=True):
        rmse = float(np.sqrt(np.mean(np.square(evidence.value[part]))))
        noise = float(np.sqrt(np.mean(np.square(evidence.noise[part]))))
        spread = float(np.std(evidence.measured[part])) or np.nan
        found.append(
            {"equation": equation, "rmse": rmse, "nrmse": rmse / spread, "noise_floor": noise,
             "unit": evidence.units[equation]}
        )  # fmt: skip
    return found
