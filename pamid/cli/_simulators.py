"""Simulators with ports on the command line: reading them, with trust or without, and writing them corrected."""

from __future__ import annotations

import argparse
import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from ..files import write_whole

if TYPE_CHECKING:
    import numpy as np

    from ..simulators import FmuSimulator, MujocoSimulator, Simulator

CORRECTED = ("corrected.toml", "corrected.xml", "corrected.py", "corrected.fmu", "start_values.json")
"""What a corrected simulator may consist of."""
_STEPS = 10
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


def runs_code(sim: str) -> bool:
    """Return whether diagnosing with a simulator runs code of its own, which the user must allow."""
    from ..simulators import simulator_kinds
    from ..simulators.page import MODELS
    from ..systems import kind_of_file

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


def write_corrected(simulator: Simulator, stage: Path, folder: Path) -> list[str]:
    """Write a corrected simulator into a stage that becomes a folder; what does not load and run there is left out."""
    from ..simulators import FmuSimulator, MujocoSimulator

    if isinstance(simulator, MujocoSimulator):
        names = ("corrected.xml", "corrected.toml", "corrected.py")
        return _unless_it_fails(stage, names, lambda: _write_mujoco(simulator, stage, folder))
    left = _unless_it_fails(stage, ("corrected.toml",), lambda: _write_page(simulator, stage, folder))
    if isinstance(simulator, FmuSimulator):
        write_whole(stage / "start_values.json", json.dumps(simulator.start_values(), indent=1) + "\n")
        left += _unless_it_fails(stage, ("corrected.fmu",), lambda: _write_fmu(simulator, stage / "corrected.fmu"))
    return left


def _unless_it_fails(stage: Path, names: tuple[str, ...], make: Callable[[], None]) -> list[str]:
    """Make files; where that fails, remove them and say why. A diagnosis is worth having without them."""
    from ..errors import OutputError

    try:
        make()
    except OutputError:
        raise
    except Exception as error:  # whatever MuJoCo, an FMU or a function raises
        for name in names:
            (stage / name).unlink(missing_ok=True)
        return [f"{' and '.join(names)} left out, since it could not be made, loaded and run: {error}"]
    return []


def _write_mujoco(simulator: MujocoSimulator, stage: Path, folder: Path) -> None:
    """Write a corrected MuJoCo model, its simulator file and callbacks, and let it make some steps."""
    import mujoco
    import numpy as np

    from ..errors import SimulatorRunError
    from ..simulators import page_text
    from ..simulators.mujoco_callback import corrected

    text, rest = simulator.corrected_xml()
    write_whole(stage / "corrected.xml", text)
    page = page_text(simulator.with_({}, rest), folder)
    write_whole(stage / "corrected.toml", re.sub(r"(?m)^model = .*$", 'model = "corrected.xml"', page, count=1))
    if rest:
        write_whole(stage / "corrected.py", _CALLBACK)
    model, acting = corrected(stage / "corrected.toml")
    data = mujoco.MjData(model)
    with acting:
        mujoco.mj_step(model, data, nstep=_STEPS)
    if not np.isfinite(data.qpos).all():
        raise SimulatorRunError("corrected.xml gives no finite positions.", "a model that runs", "Look at the causes.")


def _write_page(simulator: Simulator, stage: Path, folder: Path) -> None:
    """Write the simulator file of a simulator, which read again is the same one."""
    import numpy as np

    from ..errors import SimulatorRunError
    from ..simulators import page_text, read_simulator

    path = stage / "corrected.toml"
    write_whole(path, page_text(simulator, stage))
    again = read_simulator(path, trust=True)  # its code has run in this diagnosis
    known, shown = _few(simulator), _few(again)
    same = known is None or (shown is not None and np.allclose(known, shown, rtol=1e-9, equal_nan=True))
    if list(again.effects) != list(simulator.effects) or not same:
        raise SimulatorRunError(
            "corrected.toml, read again, is another simulator.", "the one of the report", "Tell pamid's authors."
        )
    write_whole(path, page_text(simulator, folder))


def _write_fmu(simulator: FmuSimulator, path: Path) -> None:
    """Pack a corrected FMU, and let it make some steps where the original can."""
    from ..errors import SimulatorRunError
    from ..simulators import FmuSimulator
    from ..simulators.fmu_wrapper import wrapped

    path.write_bytes(wrapped(simulator))
    if _few(simulator) is not None and _few(FmuSimulator(path, trust=True, seconds=simulator.seconds)) is None:
        raise SimulatorRunError("corrected.fmu does not run.", "an FMU that runs as the original does", "Use the page.")


def _few(simulator: Simulator) -> np.ndarray | None:
    """Return what a simulator answers at a few instants at rest; None where it has no answer there."""
    import numpy as np

    from ..errors import PamidError

    t = 0.01 * np.arange(_STEPS)
    x, u = (np.zeros((len(names), len(t))) for names in (simulator.states, simulator.inputs))
    try:
        if simulator.form == "run":
            return simulator.run(t, u, simulator.numbers, x[:, 0])
        p = np.repeat(np.asarray(simulator.numbers, dtype=float)[:, None], len(t), axis=1)
        ask = simulator.rate if simulator.form == "ode" else simulator.output
        return ask(t, x, u, p)
    except PamidError:
        return None
