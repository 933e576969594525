"""Initial states fitted to a changed simulator, and what inputs do between rows where motion is fast."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pandas as pd
import pytest

from pamid.gap.inference.gauss_newton import Fitter
from pamid.gap.residuals.shooting import ShootingEvidence
from pamid.simulators import FunctionSimulator, Port
from pamid.simulators.port_log import port_log

FINE = 40


def rates(t, x, u, p):
    """Return the rates of a mass on a stiff spring."""
    return [x.v, (u.F - p.d * x.v - p.k * x.x) / p.m]


def spring(stiffness: float, damping: float) -> FunctionSimulator:
    """Return the simulator of a mass whose position is read."""
    ports = [
        Port("F", "input", "N"), Port("x", "state", "m", column="position"),
        Port("v", "state", "m/s", column="not logged"),
    ]  # fmt: skip
    return FunctionSimulator(rates, ports, {"m": (1.0, 0.05), "d": (damping, 0.1), "k": (stiffness, 0.1)})


def spring_log(stiffness: float, damping: float, hold: int, lines: bool, rows: int) -> pd.DataFrame:
    """Return runs from states that nobody reads, under forces that are held or go straight from row to row."""
    rng, runs, dt = np.random.default_rng(1), [], 0.01
    for run in range(3):
        x, v, read = rng.normal(0.0, 0.05), rng.normal(0.0, 1.0), []
        force = np.repeat(rng.normal(0.0, 0.01 * stiffness, rows // hold + 1), hold)[: rows + 1]
        for now, then in pairwise(force):
            read.append(x)
            for j in range(FINE):
                f = now + (j + 0.5) / FINE * (then - now) * lines
                v += dt / FINE * (f - damping * v - stiffness * x)
                x += dt / FINE * v
        position = np.array(read) + 1e-4 * rng.standard_normal(rows)
        time = dt * np.arange(rows)
        runs.append(pd.DataFrame({"trajectory": str(run), "time": time, "F": force[:rows], "position": position}))
    return pd.concat(runs, ignore_index=True)


def test_with_its_true_parameters_a_simulator_explains_a_log_to_the_noise() -> None:
    """Initial states that fit the given spring would let the true one ring with another phase."""
    log, simulator = spring_log(412.0, 0.1, hold=50, lines=False, rows=1500), spring(400.0, 0.1)
    evidence = ShootingEvidence(port_log(log, simulator), simulator)
    true = evidence.raw(evidence.z({}, {"k": 0.3}))
    assert np.sqrt(np.mean(np.square(evidence.z0))) > 100.0
    assert np.sqrt(np.mean(np.square(true))) < 1.5


@pytest.mark.parametrize(("lines", "stiffness"), [(False, 1000.0), (True, 4000.0)], ids=["held", "lines"])
def test_held_inputs_and_lines_are_within_reach_of_each_other(
    lines: bool, stiffness: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Which of them a log has may be told wrong, but is no cause: jumps of the force come every third row."""
    monkeypatch.setattr("pamid.gap.residuals.shooting.go_in_lines", lambda *_: not lines)
    log, simulator = spring_log(stiffness, 12.0, hold=3, lines=lines, rows=700), spring(stiffness, 12.0)
    evidence = ShootingEvidence(port_log(log, simulator), simulator, refit=True)
    fit = Fitter(evidence).base()
    assert np.all(fit.scales < 1.05)
    assert abs((evidence.about + fit.x)[evidence.free.index("bend of F")]) < 0.8
