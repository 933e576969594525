"""Logs that a coarse integrator made, one step a sample: its steps are no cause, and hide none."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from pamid.gap import diagnose_simulator
from pamid.gap.residuals.between_rows import SEMI_IMPLICIT, STEPS
from pamid.simulators import FunctionSimulator, Port

DT, MASS, STIFFNESS, DAMPING = 0.05, 2.0, 40.0, 1.5
NAMED = ["parameter_deviation", "coulomb_friction", "viscous_friction", "steady_force", "sensor_gain", "actuator_gain"]


def rates(t, x, u, p):
    """Return the rates of a mass on a spring."""
    return [x.v, (u.force - p.k * x.x - p.d * x.v) / p.m]


def oscillator() -> FunctionSimulator:
    """Return the simulator, exact between the rows."""
    ports = [Port("force", "input", "N"), Port("x", "state", "m"), Port("v", "state", "m/s")]
    return FunctionSimulator(rates, ports, {"m": (MASS, 0.02, "kg"), "k": (STIFFNESS, 0.02, "N/m"), "d": DAMPING})


def stepped(new_speed: bool, columns: str, friction: float = 0.0) -> pd.DataFrame:
    """Return logs by Euler's method, one step a sample; positions go with the new or with the old speed."""
    rng, frames = np.random.default_rng(3), []
    for run in range(3):
        force = np.repeat(10.0 * rng.standard_normal(50), 8)
        x, v, rows = 0.0, 0.0, []
        for f in force:
            rows.append((x, v))
            faster = v + DT * (f - STIFFNESS * x - DAMPING * v - friction * np.sign(v)) / MASS
            x, v = x + DT * (faster if new_speed else v), faster
        x, v = np.transpose(rows) + rng.standard_normal((2, len(force))) * [[1e-4], [1e-3]]
        t = DT * np.arange(len(force))
        frames.append(pd.DataFrame({"trajectory": f"run {run}", "time": t, "force": force, "x": x, "v": v}))
    return pd.concat(frames, ignore_index=True)[["trajectory", "time", "force", *columns]]


@pytest.mark.parametrize("columns", ["xv", "x"])
@pytest.mark.parametrize("new_speed", [False, True])
def test_one_step_a_sample_is_no_gap(new_speed: bool, columns: str) -> None:
    found = diagnose_simulator(stepped(new_speed, columns), oscillator(), NAMED)
    assert found.verdict == "none"
    method = SEMI_IMPLICIT if new_speed and columns == "x" else STEPS  # of speeds that are read both say the same
    assert found.deviations[method] == pytest.approx(1.0, abs=0.3)  # tolerances draw it towards none


@pytest.mark.parametrize("columns", ["xv", "x"])
def test_friction_is_named_alone_beside_such_steps(columns: str) -> None:
    found = diagnose_simulator(stepped(True, columns, friction=1.5), oscillator(), NAMED)
    assert [cause.effects[0] for cause in found.causes] == ["coulomb_friction"]
    assert found.causes[0].parameters["amplitude"].value == pytest.approx(1.5, rel=0.1)
