"""What inputs do between rows is asked again once a large cause is known, of predictions as well."""

import numpy as np
import pandas as pd
import pytest

from pamid.gap.at_ports import diagnose_evidence
from pamid.gap.inference.gauss_newton import Fitter
from pamid.gap.residuals.shooting import ShootingEvidence
from pamid.gap.simulated import otherwise
from pamid.simulators import EquationSimulator, Port
from pamid.simulators.port_log import port_log

STAGE = EquationSimulator(
    {"dx/dt": "v", "dv/dt": "1000*(u - x) - 3*v"},
    [Port("u", "input", "V"), Port("x", "state", "V"), Port("v", "state", "V/s")],
    {},
)


def moved(gain, rows=300, dt=2e-2, noise=3e-4):
    """A stage with a resonance under a smooth drive, whose sensor has a wrong gain."""
    rng, runs = np.random.default_rng(0), []
    for run, w in enumerate((4.0, 6.3)):
        t = dt * np.arange(rows)
        parts = [(2.5, w, 0.0), (1.2, 3.3 * w, 1.0)]
        # The response to each sine, after what the beginning leaves has died away.
        x = sum(np.imag(a * np.exp(1j * (k * t + p)) * 1000 / (1000 - k * k + 3j * k)) for a, k, p in parts)
        u = sum(a * np.sin(k * t + p) for a, k, p in parts)
        read = gain * x + noise * rng.standard_normal(rows)
        runs.append(pd.DataFrame({"trajectory": str(run), "time": t, "u": u, "x": read}))
    return pd.concat(runs, ignore_index=True)


def test_a_large_cause_does_not_hide_that_inputs_go_in_lines():
    log = moved(1.06)
    held = ShootingEvidence(port_log(log, STAGE), STAGE, refit=True)
    found = diagnose_evidence(held, ["sensor_gain", "actuator_lag"], seed=0).found
    lines = otherwise(held, found, log)
    assert not held.lines
    assert lines.lines
    least = Fitter(lines).refine({"sensor_gain@x": {"deviation": 0.05}})
    assert least.spec["sensor_gain@x"]["deviation"] == pytest.approx(0.06, rel=0.02)
    assert least.scales == pytest.approx(1.0, abs=0.05)
