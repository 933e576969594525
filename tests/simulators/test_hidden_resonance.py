"""A rigid model of a drive whose load is on a spring: the load is named, and the mass that is left for the drive."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

import pamid
from pamid.gap.at_ports import otherwise
from pamid.gap.residuals.direct import DirectEvidence
from pamid.gap.simulated import evidence_of
from pamid.simulators import EquationSimulator, Port
from pamid.simulators.ports import ModelParameter

DT, DRIVE, LOAD, STIFFNESS, DAMPER = 2e-3, 1.5, 0.5, 4000.0, 4.0  # s, kg, kg, N/m, N s/m
LIBRARY = ["resonance", "parameter_deviation", "actuator_delay", "actuator_gain", "actuator_lag", "coulomb_friction"]


def log_of(seed: int) -> pd.DataFrame:
    """Return readings of the drive under held forces, two runs."""
    rng, runs = np.random.default_rng(seed), []
    for run in range(2):
        t = np.arange(0.0, 8.0, DT)
        u = np.repeat(rng.uniform(-8.0, 8.0, len(t) // 200 + 1), 200)[: len(t)]
        u = u + sum(
            2 * np.sin(2 * np.pi * f * t + p) for f, p in zip((0.7, 2.3, 6.1), rng.uniform(0, 6, 3), strict=True)
        )
        x, rows = np.zeros(4), []

        def rate(x: np.ndarray, force: float) -> np.ndarray:
            pull = STIFFNESS * (x[2] - x[0]) + DAMPER * (x[3] - x[1])
            return np.array([x[1], (force - 6.0 * x[1] + pull) / DRIVE, x[3], -pull / LOAD])

        for force in u:
            rows.append(x[:2])
            for _ in range(4):
                h = DT / 4.0
                a = rate(x, force)
                b = rate(x + h / 2 * a, force)
                c = rate(x + h / 2 * b, force)
                x = x + h / 6 * (a + 2 * b + 2 * c + rate(x + h * c, force))
        read = np.array(rows) + rng.standard_normal((len(t), 2)) * [5e-6, 2e-3]
        runs.append(pd.DataFrame(read, columns=["x", "v"]).assign(F=u, time=t, trajectory=f"run {run}"))
    return pd.concat(runs, ignore_index=True)


@pytest.fixture(scope="module")
def rigid() -> EquationSimulator:
    """Return the drive with the whole mass, and no spring."""
    ports = [Port("F", "input", "N"), Port("x", "state", "m"), Port("v", "state", "m/s")]
    sizes = {"m": ModelParameter(DRIVE + LOAD, 0.03, "kg"), "b": ModelParameter(6.0, 0.1, "N s/m")}
    return EquationSimulator({"dx/dt": "v", "dv/dt": "(F-b*v)/m"}, ports, sizes)


@pytest.mark.parametrize("seed", [1, 2])
def test_the_load_on_a_spring_and_the_mass_without_it_are_named(seed: int, rigid: EquationSimulator) -> None:
    found = pamid.diagnose(log_of(seed), rigid, LIBRARY)
    sizes = {cause.effects[0]: {k: p.value for k, p in cause.parameters.items()} for cause in found.causes}
    assert set(sizes) == {"resonance", "parameter_deviation"}, "a delay of half a sample says that inputs are held"
    assert sizes["resonance"]["mass"] == pytest.approx(LOAD, rel=0.05)
    assert sizes["resonance"]["frequency"] == pytest.approx(np.sqrt(STIFFNESS / LOAD), rel=0.02)
    assert sizes["parameter_deviation"]["deviation"] == pytest.approx(-LOAD / (DRIVE + LOAD), abs=0.04)


def test_how_inputs_act_within_a_sample_is_asked_again_beside_the_causes(rigid: EquationSimulator) -> None:
    """With inputs in lines, as the evidence began here, a delay of half a sample makes them held."""
    log = log_of(1)
    lines = evidence_of(log, rigid, refit=True, lines=True)
    held = evidence_of(log, rigid, refit=True, lines=False)
    assert isinstance(lines, DirectEvidence) and lines.lines and isinstance(held, DirectEvidence) and not held.lines
    found = pamid.diagnose(log, rigid, LIBRARY)
    other = otherwise(lines, found, log)
    assert other is not None and not other.lines
    assert otherwise(held, found, log) is None
