"""Play between a command and its actuator has a name of its own, beside hysteresis of another form."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from pamid.gap import diagnose_simulator
from pamid.simulators import Port
from pamid.simulators.equation_model import EquationSimulator


def follows(drive: np.ndarray, half: float) -> np.ndarray:
    """Return what goes on standing still until the play is used up, by a loop of its own."""
    at, out = drive[0], []
    for u in drive:
        at = min(max(at, u - half), u + half)
        out.append(at)
    return np.array(out)


def test_play_is_told_from_other_hysteresis() -> None:
    rng, t, runs = np.random.default_rng(3), np.arange(0, 4, 5e-3), []
    for k, (slow, fast) in enumerate(((1.0, 3.3), (1.7, 5.1), (0.6, 4.0))):
        drive = 7.0 * np.sin(2 * np.pi * slow * t) + 3.0 * np.sin(2 * np.pi * fast * t + k)
        x = 2.0 * follows(drive, 0.4) + 0.05 * rng.standard_normal(len(t))
        runs.append(pd.DataFrame({"trajectory": f"run {k}", "time": t, "drive": drive, "x": x}))
    stage = EquationSimulator(
        {"x": "gain*drive"}, [Port("x", "output", "um"), Port("drive", "input", "V")], {"gain": (2.0, 0.02, "um/V")}
    )
    library = ["actuator_backlash", "actuator_hysteresis", "actuator_lag", "actuator_delay", "actuator_dead_zone"]
    found = diagnose_simulator(pd.concat(runs), stage, library)
    assert found.causes[0].effects[0] == "actuator_backlash"
    assert found.causes[0].parameters["half_width"].value == pytest.approx(0.4, rel=0.1)
    assert found.causes[0].parameters["half_width"].unit == "V"
