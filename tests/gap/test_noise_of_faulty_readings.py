"""The noise that undoing a fault of a reading leaves is counted with that of inputs that are heard."""

import numpy as np
import pandas as pd

from pamid.gap.simulated import evidence_of
from pamid.simulators import EquationSimulator, Port


def heater_log(seed=0):
    rng, runs, dt = np.random.default_rng(seed), [], 0.02
    for k in range(3):
        t, T, rows = dt * np.arange(400), 1.0, []
        u = 2.0 + np.sin((1.0 + 0.7 * k) * t)
        for now in u:
            rows.append(T)
            for _ in range(10):
                T += dt / 10 * (now - T)
        T = np.array(rows) + 1e-4 * rng.standard_normal(len(t))
        u = u + 0.02 * rng.standard_normal(len(t))  # read by a sensor
        runs.append(pd.DataFrame({"trajectory": str(k), "time": t, "u": u, "T": T}))
    return pd.concat(runs, ignore_index=True)


def test_a_tiny_fault_leaves_the_noise_as_it_is_once_the_noise_of_inputs_is_heard():
    heater = EquationSimulator({"dT/dt": "k*(u - T)"}, [Port("u", "input"), Port("T", "state")], {"k": (1.0, 0.05)})
    evidence = evidence_of(heater_log(), heater, refit=True)
    tiny = {"sensor_gain@T": {"deviation": 1e-6}}
    np.testing.assert_allclose(evidence.spread(tiny, np.zeros(len(evidence.free))), 1.0, rtol=1e-3)
    assert evidence.hears_inputs or evidence.hear_inputs()
    np.testing.assert_allclose(evidence.spread(tiny, np.zeros(len(evidence.free))), 1.0, rtol=1e-3)
    evidence.widen({"T": 2.0})
    np.testing.assert_allclose(evidence.spread(tiny, np.zeros(len(evidence.free))), 1.0, rtol=1e-3)
