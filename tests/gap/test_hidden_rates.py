"""Where noise hides in the equations whether there is a gap, predictions decide."""

import numpy as np
import pandas as pd
import pytest

import pamid
from pamid.gap.at_ports import BURIED
from pamid.gap.residuals.choice import HIDES
from pamid.gap.residuals.shooting import ShootingEvidence
from pamid.gap.simulated import evidence_of
from pamid.simulators import EquationSimulator, Port
from pamid.simulators.port_log import port_log

TANKS = EquationSimulator(
    {"dh1/dt": "k*pump - a*sqrt(max(h1, 0))", "dh2/dt": "a*sqrt(max(h1, 0)) - b*sqrt(max(h2, 0))"},
    [Port("pump", "input", "V"), Port("h1", "state", "m"), Port("h2", "state", "m")],
    {"k": (1.1e-3, 0.01), "a": (8e-3, 0.01), "b": (7.5e-3, 0.01)},
)


def tanks_log(limit, seed, noise=1.6e-3):
    """Levels of two runs that are read each half second, with a pump that gives no more than a limit."""
    rng, runs, parts = np.random.default_rng(seed), [], 10
    for k in range(2):
        u = np.repeat(rng.uniform(0.0, 8.0, 6), 72)[:430]
        h = np.array([0.2, 0.3])
        rows = []
        for volts in u:
            rows.append(h)
            for _ in range(parts):
                out = np.array([8e-3, 7.5e-3]) * np.sqrt(np.maximum(h, 0.0))
                h = h + 0.5 / parts * np.array([1.1e-3 * min(volts, limit) - out[0], out[0] - out[1]])
        levels = np.array(rows).T + noise * rng.standard_normal((2, len(u)))
        runs.append(
            {"trajectory": str(k), "time": 0.5 * np.arange(len(u)), "pump": u, "h1": levels[0], "h2": levels[1]}
        )
    return pd.concat([pd.DataFrame(run) for run in runs], ignore_index=True)


@pytest.mark.parametrize("seed", [1, 3])
def test_a_saturated_pump_is_named_though_noise_exceeds_the_rates_of_the_levels(seed):
    log = tanks_log(7.2, seed)
    assert isinstance(evidence_of(log, TANKS), ShootingEvidence)
    found = pamid.diagnose(log, TANKS)
    assert [(cause.effects, cause.where) for cause in found.causes] == [(("actuator_saturation",), ("pump",))]


def test_noise_that_exceeds_the_rates_of_the_levels_is_no_gap():
    assert pamid.diagnose(tanks_log(9.0, 0), TANKS).verdict == "none"


def test_where_a_model_asked_instant_by_instant_cannot_be_predicted_the_reader_is_told(monkeypatch):
    log = tanks_log(9.0, 0)
    assert HIDES not in evidence_of(log, TANKS).notes
    monkeypatch.setattr(EquationSimulator, "one_by_one", True)
    evidence = evidence_of(log, TANKS)
    assert HIDES in evidence.notes and not isinstance(evidence, ShootingEvidence)
    assert HIDES not in evidence_of(tanks_log(9.0, 0, noise=2e-5), TANKS).notes


def test_a_gain_undone_in_a_reading_scales_its_noise_but_a_bias_does_not():
    evidence = evidence_of(tanks_log(9.0, 0, noise=2e-5), TANKS)
    assert evidence.scales_noise({"sensor_gain@h1": {"deviation": 0.05}})
    assert not evidence.scales_noise({"sensor_bias@h1": {"offset": 0.05}})
    assert not evidence.scales_noise({"actuator_gain@pump": {"deviation": 0.05}})


def test_predictions_with_inputs_otherwise_can_be_turned_back():
    log = port_log(tanks_log(9.0, 0), TANKS)
    held = ShootingEvidence(log, TANKS)
    lines = ShootingEvidence(log, TANKS, lines=True, like=held)
    again = ShootingEvidence(log, TANKS, like=lines)
    assert again.stretches == held.stretches
    assert np.allclose(again.z0, held.z0, atol=0.05)


def test_a_gap_smaller_than_the_noise_of_the_equations_is_judged_by_predictions(monkeypatch):
    monkeypatch.setattr("pamid.gap.residuals.choice.PREDICTED_IF", ())
    found = pamid.diagnose(tanks_log(7.2, 3, noise=5e-4), TANKS)
    assert BURIED in found.notes
    assert [(cause.effects, cause.where) for cause in found.causes] == [(("actuator_saturation",), ("pump",))]
