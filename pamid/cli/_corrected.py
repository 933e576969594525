"""The corrected simulator of a diagnosis as files: each is read again, run, and tried on the log, before it counts."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..files import write_whole

if TYPE_CHECKING:
    import numpy as np
    import pandas as pd

    from ..gap.diagnosis.result import Diagnosis
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
_INEXACT = ("coulomb_friction",)
"""Effects that MJCF has an element for which is not quite the same: it has no displacement before sliding."""
_ROUNDED = 0.005
"""A share of a gap is said to whole per cents."""


def write_corrected(d: Diagnosis, stage: Path, folder: Path, log: pd.DataFrame | None = None) -> list[str]:
    """Write the corrected simulator of a diagnosis into a stage, as far as it loads and runs; return notes."""
    from ..simulators import FmuSimulator, MujocoSimulator, Simulator

    simulator = d.corrected
    names: tuple[str, ...] = CORRECTED[:1]
    if simulator is None:
        return []
    if isinstance(simulator, MujocoSimulator):
        names = CORRECTED[:3]
        notes = _unless_it_fails(stage, names, lambda: _write_mujoco(simulator, stage, folder))
    elif isinstance(simulator, Simulator) and not simulator.states_equation:
        notes = _unless_it_fails(stage, names, lambda: _write_page(simulator, stage, folder))
    else:
        notes = _unless_it_fails(stage, names, lambda: simulator.to_toml(stage / names[0]))
    if log is not None and d.added and not notes:
        inexact = isinstance(simulator, MujocoSimulator) and any(name in _INEXACT for name, *_ in simulator.effects)
        short: dict[str, float] = {}
        notes = _unless_it_fails(stage, names, lambda: short.update(_short(d, log, _again(simulator, stage))))
        if short and inexact:
            notes = [f"{_told(short, names[1])}: MuJoCo's frictionloss is not quite the friction of this log. "
                     f"{names[0]} and {names[2]} have it as it was identified."]  # fmt: skip
            notes += _unless_it_fails(stage, names, lambda: _write_mujoco(simulator, stage, folder, _INEXACT))
            short = _short(d, log, _again(simulator, stage)) if len(notes) == 1 else {}
        notes += [f"{_told(short, names[0])} on this log, less than the report says."] if short else []
    if isinstance(simulator, FmuSimulator):
        write_whole(stage / "start_values.json", json.dumps(simulator.start_values(), indent=1) + "\n")
        notes += _unless_it_fails(stage, ("corrected.fmu",), lambda: _write_fmu(simulator, stage / "corrected.fmu"))
    return notes


def _again(simulator: Any, stage: Path) -> Any:
    """Return a corrected simulator as its file says it; that of a page has been compared with its file."""
    from ..any_simulator import read_simulator
    from ..simulators import MujocoSimulator, Simulator

    paged = isinstance(simulator, Simulator) and not isinstance(simulator, MujocoSimulator)
    return simulator if paged and not simulator.states_equation else read_simulator(stage / CORRECTED[0])


def _short(d: Diagnosis, log: pd.DataFrame, simulator: Any) -> dict[str, float]:
    """Return the equations of whose gap a simulator closes less than the report says, with the share that it closes."""
    from ..any_simulator import evaluate

    found, short = evaluate(log, simulator), {}
    for c in d.closure:
        if c.equation in found and not c.allowed:  # the report says what else it takes
            closed = c.closed_by(found[c.equation].rmse)
            if closed < c.ci90[0] - _ROUNDED:
                short[c.equation] = closed
    return short


def _told(short: dict[str, float], name: str) -> str:
    from ..report.quantities import listed, percent
    from ..report.words import BENCH

    return (
        f"{name} closes {listed([f'{percent(share)} of the gap in {BENCH.equation(e)}' for e, share in short.items()])}"
    )


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


def _write_mujoco(simulator: MujocoSimulator, stage: Path, folder: Path, but: tuple[str, ...] = ()) -> None:
    """Write a corrected MuJoCo model with its simulator file and callbacks, and run a few steps of it."""
    import mujoco
    import numpy as np

    from ..errors import SimulatorRunError
    from ..simulators import page_text
    from ..simulators.mujoco_callback import corrected

    text, rest = simulator.corrected_xml()
    shown = simulator.in_elements(but)
    rest = [*(e for e in shown.effects if e[0] in but), *rest]
    write_whole(stage / "corrected.xml", text)
    page = page_text(shown.with_({}, rest), folder)
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
    """Return the output of a simulator at a few instants at rest; None where it has none there."""
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
