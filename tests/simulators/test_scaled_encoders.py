"""An encoder with a wrong scale makes a position and the speed that is derived from it wrong alike."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from pamid.gap import diagnose_simulator
from pamid.gap.simulated import evidence_of
from pamid.simulators import FunctionSimulator, Port

INERTIA, WEIGHT = 0.02, 1.5


def arm(weight: float = WEIGHT) -> FunctionSimulator:
    ports = [Port("u", "input", "N m"), Port("q", "state", "rad"), Port("dq", "state", "rad/s")]
    numbers = {"J": (INERTIA, 0.02, "kg m^2"), "w": (weight, 0.0, "N m")}

    def rates(t, x, u, p):
        return [x.dq, (u.u - p.w * np.sin(x.q) - 0.05 * x.dq) / p.J]

    return FunctionSimulator(rates, ports, numbers)


def recorded(scale: float, weight: float = WEIGHT) -> pd.DataFrame:
    rng, runs, h, m = np.random.default_rng(11), [], 0.01, 20
    for run in range(3):
        q, v, rows = 0.0, 0.0, []
        for k in range(500):
            t = k * h
            u = 0.9 * np.sin((2.0 + run) * t) + 0.6 * np.sin(5.3 * t + run)
            rows.append((t, u, scale * q, scale * v))
            for _ in range(m):
                v += h / m * (u - weight * np.sin(q) - 0.05 * v) / INERTIA
                q += h / m * v
        table = np.array(rows) + rng.standard_normal((500, 4)) * [0.0, 0.0, 2e-4, 5e-3]
        runs.append(pd.DataFrame(table, columns=["time", "u", "q", "dq"]).assign(trajectory=run))
    return pd.concat(runs, ignore_index=True)


def test_position_and_speed_of_one_encoder_are_scaled_alike() -> None:
    found = diagnose_simulator(recorded(1.05), arm(), ["sensor_gain", "encoder_gain", "actuator_gain", "sensor_bias"])
    [cause] = found.causes
    assert (cause.effects[0], cause.where[0]) == ("encoder_gain", "q")
    assert cause.parameters["deviation"].value == pytest.approx(0.05, abs=0.003)


@pytest.mark.parametrize("columns", [["q"], ["dq"]], ids=["position", "speed"])
def test_one_reading_of_a_motion_has_a_gain_of_its_own_only(columns: list[str]) -> None:
    evidence = evidence_of(recorded(1.0)[["trajectory", "time", "u", *columns]], arm())
    assert not [k for k in evidence.library("all") if k.startswith("encoder_")]


def test_a_drive_and_an_encoder_are_one_class_where_no_weight_acts() -> None:
    twins = {w: evidence_of(recorded(1.0, w), arm(w)).twins.get("actuator_gain@u") for w in (0.0, WEIGHT)}
    assert twins == {0.0: "encoder_gain@q", WEIGHT: None}
