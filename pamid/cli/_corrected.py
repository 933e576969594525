"""The corrected simulator of a diagnosis as files: each is read again, run, and tried on the log, before it counts."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import OutputError, SimulatorRunError
from ..files import write_whole

if TYPE_CHECKING:
    import pandas as pd

    from ..gap.diagnosis.result import Diagnosis
    from ..simulators import FmuSimulator

CORRECTED = ("corrected.toml", "corrected.xml", "corrected.py", "corrected.fmu", "start_values.json")
"""What a corrected simulator may consist of."""
_STEPS = 10
_ROUNDED = 0.005
"""A share of a gap is said to whole per cents."""


def write_corrected(d: Diagnosis, stage: Path, folder: Path, log: pd.DataFrame | None = None) -> list[str]:
    """Write the corrected simulator of a diagnosis into a stage, as far as it loads and runs; return notes."""
    from ..any_simulator import read_simulator

    simulator = d.corrected
    if simulator is None:
        return []
    names, again = simulator.corrected_files, list[Any]()

    def write(but: Sequence[str] = ()) -> None:
        # Its code has run in this diagnosis.
        again[:] = [simulator.write_corrected(stage, folder, lambda page: read_simulator(page, trust=True), but)]
        if (stage / "corrected.xml").exists():
            _run_some_steps(stage / names[0])

    notes = _unless_it_fails(stage, names, write)
    if log is not None and d.added and not notes:
        short: dict[str, float] = {}
        notes = _unless_it_fails(stage, names, lambda: short.update(_short(d, log, again[0])))
        if short and simulator.inexact:
            notes = [f"{_told(short, names[1])}: MuJoCo's frictionloss differs from the friction of this log. "
                     f"{names[0]} and {names[2]} contain the identified friction."]  # fmt: skip
            notes += _unless_it_fails(stage, names, lambda: write(simulator.inexact))
            short = _short(d, log, again[0]) if len(notes) == 1 else {}
        notes += [f"{_told(short, names[0])} on this log, less than the report says."] if short else []
    if (values := simulator.start_values()) is not None:
        write_whole(stage / "start_values.json", json.dumps(values, indent=1) + "\n")
        notes += _unless_it_fails(stage, ("corrected.fmu",), lambda: _write_fmu(simulator, stage / "corrected.fmu"))
    return notes


def _short(d: Diagnosis, log: pd.DataFrame, simulator: Any) -> dict[str, float]:
    """Return the equations of whose gap a simulator closes less than the report says, with the share that it closes."""
    from ..gap.rerun import closes

    shares = closes(d, log, simulator)
    said = {c.equation: c.ci90[0] for c in d.closure}
    return {equation: share for equation, share in shares.items() if share < said[equation] - _ROUNDED}


def _told(short: dict[str, float], name: str) -> str:
    from ..report.quantities import listed, percent
    from ..report.words import BENCH

    return (
        f"{name} closes {listed([f'{percent(share)} of the gap in {BENCH.equation(e)}' for e, share in short.items()])}"
    )


def _unless_it_fails(stage: Path, names: tuple[str, ...], make: Callable[[], None]) -> list[str]:
    """Make files; where that fails, remove them and say why. A diagnosis is worth having without them."""
    try:
        make()
    except OutputError:
        raise
    except Exception as error:  # whatever MuJoCo, an FMU or a function raises
        for name in names:
            (stage / name).unlink(missing_ok=True)
        return [f"{' and '.join(names)} left out, since it could not be made, loaded and run: {error}"]
    return []


def _run_some_steps(page: Path) -> None:
    """Run a few steps of a corrected MuJoCo model, with its callbacks."""
    import mujoco
    import numpy as np

    from ..simulators.mujoco_callback import corrected

    model, acting = corrected(page)
    data = mujoco.MjData(model)
    with acting:
        mujoco.mj_step(model, data, nstep=_STEPS)
    if not np.isfinite(data.qpos).all():
        raise SimulatorRunError("corrected.xml gives no finite positions.", "a model that runs", "Check the causes.")


def _write_fmu(simulator: FmuSimulator, path: Path) -> None:
    """Pack a corrected FMU, and let it make some steps where the original can."""
    from ..simulators import FmuSimulator
    from ..simulators.fmu_wrapper import wrapped

    path.write_bytes(wrapped(simulator))
    if simulator.at_rest() is not None and FmuSimulator(path, trust=True, seconds=simulator.seconds).at_rest() is None:
        raise SimulatorRunError(
            "corrected.fmu does not run.", "an FMU that runs as the original does", "Use corrected.toml."
        )
