"""A delay contains when within a sample its command acts: a fit of both would give each any share of their sum."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from pamid.gap import diagnose_simulator
from pamid.simulators import FunctionSimulator, Port

INERTIA, WEIGHT, STEP, WITHIN = 0.02, 1.5, 0.01, 20


def arm() -> FunctionSimulator:
    ports = [Port("u", "input", "N m"), Port("q", "state", "rad"), Port("dq", "state", "rad/s")]
    numbers = {"J": (INERTIA, 0.02, "kg m^2"), "w": (WEIGHT, 0.0, "N m")}

    def rates(t, x, u, p):
        return [x.dq, (u.u - p.w * np.sin(x.q) - 0.05 * x.dq) / p.J]

    return FunctionSimulator(rates, ports, numbers)


def late(delay: float) -> pd.DataFrame:
    rng, runs, h = np.random.default_rng(3), [], STEP / WITHIN
    for run in range(3):
        t, phase = STEP * np.arange(400), rng.uniform(0.0, 6.0, 3)
        tones = zip((0.9, 0.6, 0.3), (2.0 + run, 5.3, 13.0), phase, strict=True)
        u = np.sum([a * np.sin(w * t + p) for a, w, p in tones], axis=0)
        q, v, rows = 0.0, 0.0, []
        for k in range(len(t)):
            rows.append((q, v))
            for i in range(WITHIN):
                given = int(np.floor(k + i / WITHIN - delay / STEP + 1e-9))
                v += h * ((u[given] if given >= 0 else 0.0) - WEIGHT * np.sin(q) - 0.05 * v) / INERTIA
                q += h * v
        q, v = np.transpose(rows) + rng.standard_normal((2, len(t))) * [[2e-4], [5e-3]]
        runs.append(pd.DataFrame({"trajectory": run, "time": t, "u": u, "q": q, "dq": v}))
    return pd.concat(runs, ignore_index=True)


@pytest.mark.parametrize("delay", [0.006, 0.013, 0.02])
@pytest.mark.parametrize("columns", [["q"], ["q", "dq"]], ids=["position", "position and speed"])
def test_a_delay_is_known_to_much_less_than_half_a_sample(delay: float, columns: list[str]) -> None:
    log = late(delay)[["trajectory", "time", "u", *columns]]
    [cause] = diagnose_simulator(log, arm(), ["actuator_delay", "viscous_friction"]).causes
    assert cause.effects[0] == "actuator_delay"
    assert cause.parameters["delay"].value == pytest.approx(delay, abs=5e-4)
