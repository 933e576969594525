"""Accelerations of a noisy angle hide a dead zone in their noise; the swing that follows from it does not."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from pamid.gap import diagnose_simulator
from pamid.gap.at_ports import shown_by_predictions
from pamid.gap.residuals.direct import DirectEvidence
from pamid.gap.simulated import evidence_of
from pamid.simulators import FunctionSimulator, Port


def pendulum() -> FunctionSimulator:
    def rates(t, x, u, p):
        return [x.w, (u.torque - p.m * 9.81 * 0.25 * np.sin(x.q) - p.b * x.w) / (p.m * 0.0625)]

    ports = [Port("torque", "input", "N m"), Port("q", "state", "rad"), Port("w", "state", "rad/s")]
    return FunctionSimulator(rates, ports, {"m": (0.4, 0.05, "kg"), "b": (0.01, 0.2, "N m s/rad")})


def log(width: float) -> pd.DataFrame:
    rng, parts, dt, fine = np.random.default_rng(11), [], 0.005, 10
    for k in range(4):
        t = np.arange(700) * dt
        torque = 0.3 * np.sin((2.0 + k) * t + k) + 0.2 * np.sin(7.0 * t)
        q, w, read = rng.uniform(-1.0, 1.0), 0.0, []
        for u in np.sign(torque) * np.maximum(np.abs(torque) - width, 0.0):
            read.append(q)
            for _ in range(fine):
                w += dt / fine * (u - 0.981 * np.sin(q) - 0.01 * w) / 0.025
                q += dt / fine * w
        angle = np.array(read) + 4e-3 * rng.standard_normal(len(t))
        parts.append(pd.DataFrame({"trajectory": f"run{k}", "time": t, "torque": torque, "q": angle}))
    return pd.concat(parts, ignore_index=True)


EFFECTS = ["actuator_dead_zone", "viscous_friction", "sensor_gain"]


@pytest.mark.parametrize(("width", "shown"), [(0.02, True), (0.0, False)])
def test_what_noise_of_accelerations_hides_shows_in_predictions(width: float, shown: bool) -> None:
    evidence = evidence_of(log(width), pendulum(), refit=True)
    assert isinstance(evidence, DirectEvidence)
    assert (shown_by_predictions(evidence) is not None) == shown


def test_its_cause_is_found() -> None:
    [cause] = diagnose_simulator(log(0.02), pendulum(), EFFECTS).causes
    assert cause.effects == ("actuator_dead_zone",)
    assert cause.parameters["width"].value == pytest.approx(0.02, rel=0.1)


def test_where_predictions_leave_nothing_there_is_no_gap() -> None:
    assert diagnose_simulator(log(0.0), pendulum(), EFFECTS).verdict == "none"
