"""Undoing a lag of a sensor hides the rest in noise, undoing a delay does not: that is no evidence for the delay."""

import numpy as np
import pandas as pd

import pamid
from pamid.simulators import FunctionSimulator, Port


def rates(t, x, u, p):
    """Two tanks in series."""
    first = p.a1 * np.sqrt(2.0 * 9.81 * np.maximum(x.h1, 0.0))
    return [
        (4e-5 * u.V - first) / p.A1, (first - p.a2 * np.sqrt(2.0 * 9.81 * np.maximum(x.h2, 0.0))) / p.A2
    ]  # fmt: skip


TANKS = FunctionSimulator(
    rates,
    [Port("V", "input", "V"), Port("h1", "state", "m", start=0.25), Port("h2", "state", "m", start=0.2)],
    {"A1": (0.03, 0.02), "A2": (0.02, 0.02), "a1": (1e-4, 0.05), "a2": (1.1e-4, 0.05)},
)
LAG, FINE = 6.0, 8


def logged() -> pd.DataFrame:
    """Return three runs whose second level is read late."""
    rng, runs = np.random.default_rng(5), []
    for run in range(3):
        V = np.repeat(rng.uniform(2.5, 8.5, 10), 120)
        h1, h2, late, rows = 0.25, 0.2, 0.2, []
        for now in V:
            rows.append((h1, late))
            for _ in range(FINE):
                first, second = 1.01e-4 * np.sqrt(19.62 * max(h1, 0.0)), 1.1e-4 * np.sqrt(19.62 * max(h2, 0.0))
                h1, h2, late = (h1 + (4e-5 * now - first) / 0.0303 / FINE, h2 + (first - second) / 0.0202 / FINE,
                                late + (h2 - late) / LAG / FINE)  # fmt: skip
        read = np.array(rows) + 1e-3 * rng.standard_normal((len(V), 2))
        runs.append(pd.DataFrame({"trajectory": str(run), "time": np.arange(len(V)), "V": V,
                                  "h1": read[:, 0], "h2": read[:, 1]}))  # fmt: skip
    return pd.concat(runs, ignore_index=True)


def test_a_lag_is_not_ruled_out_by_the_noise_that_undoing_it_brings() -> None:
    [cause] = pamid.diagnose(logged(), TANKS, ["sensor_lag", "sensor_delay", "parameter_deviation"]).causes
    assert cause.effects[0] == "sensor_lag" and set(cause.where) == {"h2"}
    low, high = cause.parameters["time_constant"].ci90
    assert low < LAG < high
