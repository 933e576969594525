"""Undoing a fault of a reading filters its noise, which is no evidence of the fault; what it explains of motion is."""

import numpy as np
import pandas as pd
import pytest

from pamid.gap import diagnose_simulator
from pamid.gap.inference.first_order import FirstOrder
from pamid.gap.residuals.direct import DirectEvidence
from pamid.gap.residuals.states import measured_states
from pamid.simulators import EquationSimulator, ModelParameter, Port
from pamid.simulators.port_log import port_log

TANKS = EquationSimulator(
    {"dh1/dt": "k*pump - a*sqrt(h1)", "dh2/dt": "a*sqrt(h1) - b*sqrt(h2)"},
    [Port("pump", "input", "V"), Port("h1", "state", "m"), Port("h2", "state", "m")],
    {name: ModelParameter(value, 0.05) for name, value in (("a", 0.0358), ("b", 0.0323), ("k", 0.00729))},
)
SLOW = EquationSimulator({"dx/dt": "-0.5*x + u"}, [Port("u", "input", "m/s"), Port("x", "state", "m")], {})


def tanks(seed, dt=0.5, rows=577):
    """Two tanks under slow ramps of a pump, whose levels are read with 0.3 mm of noise."""
    rng, h, read = np.random.default_rng(seed), np.array([1.0, 0.64]), []
    pump = 4.5 + 1.3 * np.interp(
        np.arange(rows), np.arange(0, rows + 60, 55), np.random.default_rng(7).uniform(-1, 1, 12)
    )
    for u, step in zip(pump, np.diff(pump, append=pump[-1]), strict=True):
        read.append(h)
        for _ in range(20):
            u += step / 20
            one, two = 0.0368 * np.sqrt(h[0]), 0.0333 * np.sqrt(h[1])
            h = h + dt / 20 * np.array([0.00728 * u - one, one - two])
    noisy = np.array(read) + 3e-4 * rng.standard_normal((rows, 2))
    return pd.DataFrame(
        {"trajectory": "1", "time": dt * np.arange(rows), "pump": pump, "h1": noisy[:, 0], "h2": noisy[:, 1]}
    )


@pytest.mark.parametrize("seed", [3, 11])
def test_noise_alone_is_no_resonance_of_a_reading(seed):
    assert diagnose_simulator(tanks(seed), TANKS).verdict == "none"


def resonant(seed=0, dt=0.02, rows=2000, frequency=9.0, damping=0.15):
    """A reading that swings about a slow signal, driven by steps."""
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.uniform(-1, 1, rows // 50), 50)
    x, y, v, read = 0.0, 0.0, 0.0, []
    for k in range(rows):
        read.append(y)
        for _ in range(20):
            x += dt / 20 * (-0.5 * x + u[k])
            v += dt / 20 * (frequency**2 * (x - y) - 2 * damping * frequency * v)
            y += dt / 20 * v
    read = np.array(read) + 2e-3 * rng.standard_normal(rows)
    return pd.DataFrame({"trajectory": "1", "time": dt * np.arange(rows), "u": u, "x": read})


def test_a_resonance_that_shows_in_the_motion_is_named():
    found = diagnose_simulator(resonant(), SLOW)
    (cause,) = found.causes
    assert cause.effects[0] == "sensor_compliance"
    assert cause.parameters["frequency"].value == pytest.approx(9.0, rel=0.05)


def test_residuals_are_filtered_as_their_noise_is():
    log = port_log(tanks(1), TANKS)
    evidence = DirectEvidence(log, TANKS, measured_states(TANKS, log), refit=False)
    spec = {"sensor_compliance@h1": {"frequency": 50.0, "damping": 0.05}}
    z = np.random.default_rng(0).standard_normal(len(evidence.z0))
    filtered = evidence.filtered(spec, z)
    one, two = evidence.parts
    assert np.std(filtered[one]) < 0.8 * np.std(z[one])
    assert np.allclose(filtered[two], z[two], atol=0.05)
    assert evidence.filtered({"sensor_gain@h1": {"deviation": 0.1}}, z) is None


def test_noise_of_several_readings_is_not_made_quieter_by_one_of_them():
    rng, dt, rows = np.random.default_rng(2), 0.05, 1200
    time = dt * np.arange(rows)
    u = np.sin(time)
    x = 0.5 * (np.sin(time) - np.cos(time))
    noisy = np.array([x, x]) + 1e-3 * rng.standard_normal((2, rows))
    log = pd.DataFrame({"trajectory": "1", "time": time, "u": u, "x": noisy[0], "y": noisy[1]})
    ports = [Port("u", "input", "1/s"), Port("x", "state", "-"), Port("y", "state", "-")]
    chain = EquationSimulator({"dx/dt": "u - x", "dy/dt": "20*(x - y)"}, ports, {})
    log = port_log(log, chain)
    evidence = DirectEvidence(log, chain, measured_states(chain, log), refit=False)
    spec = {"sensor_delay@x": {"delay": 0.1}}
    drawn, changed = evidence._noisier(spec)
    part = evidence.parts[1]  # holds the noise of both readings, of which one is late
    assert np.std(evidence.filtered(spec, drawn)[part]) == pytest.approx(np.std(changed[part]), rel=0.01)


def test_below_widened_noise_is_no_gain(monkeypatch):
    """What a set pays to have its noise widened is not charged a second time as residuals that are too small."""
    log = port_log(resonant(frequency=9.0), SLOW)
    evidence = DirectEvidence(log, SLOW, measured_states(SLOW, log), refit=False)
    worth = FirstOrder(evidence, [])
    fit = worth.fitter.refine({"sensor_compliance@x": {"frequency": 9.0, "damping": 0.15}})
    charged, usual = [], evidence.widening(fit.spec)
    monkeypatch.setattr(worth, "_below_noise", lambda left: charged.append(left) or 0.0)
    worth.hypothesis(fit)
    monkeypatch.setattr(type(evidence), "widening", lambda self, spec: 1.2 * usual)
    worth.hypothesis(fit)
    assert charged[1] == pytest.approx(charged[0], rel=0.02)
