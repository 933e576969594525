"""The interval of a cause holds what a tolerance leaves open on every run alike."""

import numpy as np
import pandas as pd
import pytest

import pamid
from pamid.simulators import FunctionSimulator, ModelParameter, Port


@pytest.mark.parametrize("off", [0.93, 1.07])
def test_a_gain_is_known_no_better_than_the_parameter_beside_it(off):
    """Only the product of both is seen: what the parameter is off by is not in the spread over runs."""
    rng, t = np.random.default_rng(0), np.arange(0.0, 3.0, 0.01)
    runs = []
    for k in range(4):
        u = np.sin((1.0 + k) * t) + 0.5 * np.sin(7.0 * t + k)
        y = off * 1.3 * u + 0.01 * rng.standard_normal(len(t))
        runs.append(pd.DataFrame({"trajectory": f"r{k}", "time": t, "u": u, "y": y}))
    ports = [Port("u", "input", "V"), Port("y", "output", "m")]
    number = {"k": ModelParameter(1.0, 0.1, "m/V")}
    simulator = FunctionSimulator(lambda u, p, x0: [p.k * u.u], ports, number, form="run")
    found = pamid.diagnose(pd.concat(runs), simulator, effects=["actuator_gain"])
    (cause,) = found.causes
    low, high = cause.parameters["deviation"].ci90
    assert low < 0.3 < high
    assert high - low < 0.3
