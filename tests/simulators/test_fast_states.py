"""Fast states between rows: a simulator that takes several steps a sample is not compared with runs of fewer."""

import numpy as np
import pandas as pd

from pamid.gap.simulated import evidence_of
from pamid.simulators import EquationSimulator, ModelParameter, Port

RLC = EquationSimulator(
    {"dvc/dt": "i/C", "di/dt": "(e - R*i - vc)/L"},
    [Port("e", "input", "V"), Port("vc", "state", "V"), Port("i", "state", "A")],
    {"R": ModelParameter(4.0, 0.1), "L": ModelParameter(0.012, 0.1), "C": ModelParameter(9e-5, 0.1)},
)


def test_predictions_are_those_of_the_present_steps():
    rng, dt, rows = np.random.default_rng(0), 2e-4, 900
    e = np.interp(np.arange(rows), np.arange(0, 925, 25), rng.uniform(-10, 10, 37))
    vc, i, read = 0.0, 0.0, []
    for k in range(rows):
        read.append(vc)
        for j in range(20):
            now = e[k] + j / 20 * (e[min(k + 1, rows - 1)] - e[k])
            i += dt / 20 * (now - 4.1 * i - vc) / 0.0121
            vc += dt / 20 * i / 9.1e-5
    log = pd.DataFrame({"trajectory": "1", "time": dt * np.arange(rows), "e": e, "vc": read})
    log["vc"] += 2e-3 * rng.standard_normal(rows)
    evidence = evidence_of(log, RLC, refit=True)
    numbers = evidence.simulator.numbers
    found = {}
    for steps in (1, 8, 1):
        evidence.substeps = steps
        evidence._along.clear()
        found.setdefault(steps, evidence._predict(evidence._x0, [], numbers))
    one, eight = (np.concatenate(found[steps], axis=1) for steps in (1, 8))
    assert 1e-6 < np.max(np.abs(one - eight)) < 1.0
