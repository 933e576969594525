"""A contact sets in between two rows: what the log cannot show of that step is noise there, and no gap."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from pamid.gap import diagnose_simulator
from pamid.gap.residuals.direct import DirectEvidence
from pamid.gap.simulated import evidence_of
from pamid.simulators import FunctionSimulator, Port

MASS, SPRING, FLOOR, STIFFNESS, DAMPING, STEP, WITHIN = 0.5, 60.0, -0.25, 300.0, 4.0, 0.005, 40


def acceleration(z, v, force):
    """Return that of a mass on a spring, which hits a soft floor at times."""
    push = np.where(z < FLOOR, np.maximum(-STIFFNESS * (z - FLOOR) - DAMPING * v, 0.0), 0.0)
    return (force + push - SPRING * z) / MASS


def ball() -> FunctionSimulator:
    ports = [Port("f", "input", "N"), Port("z", "state", "m"), Port("dz", "state", "m/s")]
    return FunctionSimulator(lambda t, x, u, p: [x.dz, acceleration(x.z, x.dz, u.f)], ports, {})


@pytest.fixture(scope="module")
def log() -> pd.DataFrame:
    """Three runs of a mass that is pushed about and hits the floor about once a second."""
    rng, runs, h = np.random.default_rng(4), [], STEP / WITHIN
    for run in range(3):
        t, (a, b) = STEP * np.arange(1000), rng.uniform(0.0, 6.0, 2)
        f = 9.0 * np.sin(2.3 * t + a) + 6.0 * np.sin(9.1 * t + b)
        z, v, rows = 0.0, 0.0, []
        for force in f:
            rows.append((z, v))
            for _ in range(WITHIN):
                v += 0.5 * h * acceleration(z, v, force)
                z += h * v
                v += 0.5 * h * acceleration(z, v, force)
        z, v = np.transpose(rows) + rng.standard_normal((2, len(t))) * [[2e-5], [2e-3]]
        runs.append(pd.DataFrame({"trajectory": run, "time": t, "f": f, "z": z, "dz": v}))
    return pd.concat(runs, ignore_index=True)


def test_what_happens_between_rows_is_noise_of_the_windows_there(log: pd.DataFrame) -> None:
    found = evidence_of(log.drop(columns="dz"), ball())
    z = found.without_causes().z
    assert np.sqrt(np.mean(np.square(z))) < 1.4
    assert np.max(np.abs(z)) < 8.0


def test_a_mass_that_hits_a_floor_has_no_gap(log: pd.DataFrame) -> None:
    found = diagnose_simulator(log.drop(columns="dz"), ball(), ["viscous_friction", "coulomb_friction", "actuator_lag"])
    assert found.verdict == "none"


def test_a_smooth_motion_has_the_noise_of_its_readings(log: pd.DataFrame, monkeypatch: pytest.MonkeyPatch) -> None:
    ports = [Port("f", "input", "N"), Port("z", "state", "m"), Port("dz", "state", "m/s")]
    swing = FunctionSimulator(lambda t, x, u, p: [x.dz, u.f - 30.0 * np.sin(x.z) - 2.0 * x.dz], ports, {})
    x, rows = np.array([0.1, 0.0]), []
    f = log["f"].to_numpy()[:1000]
    for force in f:
        rows.append(x.copy())
        for _ in range(WITHIN):
            x[1] += STEP / WITHIN * (force - 30.0 * np.sin(x[0]) - 2.0 * x[1])
            x[0] += STEP / WITHIN * x[1]
    z, v = np.transpose(rows) + np.random.default_rng(0).standard_normal((2, 1000)) * [[2e-5], [2e-3]]
    table = pd.DataFrame({"trajectory": 0, "time": STEP * np.arange(1000), "f": f, "z": z, "dz": v})
    noise = evidence_of(table, swing).noise
    monkeypatch.setattr(DirectEvidence, "_between", lambda self: 0.0)
    assert noise == pytest.approx(evidence_of(table, swing).noise, rel=2e-3)
