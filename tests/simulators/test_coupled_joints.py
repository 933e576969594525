"""What a joint lacks shows in its own equation alone, and a fault undone in a reading pays for its noise."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from pamid.gap.residuals.direct import DirectEvidence
from pamid.gap.simulated import evidence_of
from pamid.simulators import FunctionSimulator, Port

ARM, BOB, COUPLED = 3e-4, 1.2e-4, 1.1e-4  # kg m²
FRICTION = 2e-3  # N m


def rates(t, x, u, p):
    """Two arms with inertias that are coupled, as those of a rotary pendulum are."""
    c = p.k * np.cos(x.b)
    det = p.J * p.I - c * c
    return [x.va, x.vb, (p.I * u.M + c * 0.02 * np.sin(x.b)) / det, (-p.J * 0.02 * np.sin(x.b) - c * u.M) / det]


PORTS = [
    Port("M", "input", "N m"), Port("a", "state", "rad"), Port("b", "state", "rad"),
    Port("va", "state", "rad/s"), Port("vb", "state", "rad/s"),
    Port("motor", "joint", "N m", position="a", velocity="va", through="M"),
]  # fmt: skip
ARMS = FunctionSimulator(rates, PORTS, {"J": (ARM, 0.0), "I": (BOB, 0.0), "k": (COUPLED, 0.0)})


@pytest.fixture(scope="module")
def log() -> pd.DataFrame:
    """Two runs of the arms with Coulomb friction at the driven joint, positions read."""
    rng, dt, runs = np.random.default_rng(1), 0.002, []
    for k in range(2):
        t, x, rows = np.arange(2500) * dt, np.array([0.0, 0.3, 0.0, 0.0]), []
        M = 4e-3 * np.sin(2 * np.pi * (0.7 + 0.4 * k) * t) + 3e-3 * np.sin(2 * np.pi * 2.3 * t + k)
        for m in M:
            rows.append(x[:2])
            for _ in range(8):
                c, tau = COUPLED * np.cos(x[1]), m - FRICTION * np.tanh(x[2] / 0.02)
                det = ARM * BOB - c * c
                spring = 0.02 * np.sin(x[1])
                acc = np.array([(BOB * tau + c * spring) / det, (-ARM * spring - c * tau) / det])
                v = x[2:] + dt / 8 * acc
                x = np.concatenate([x[:2] + dt / 8 * v, v])
        a, b = (np.array(rows) + 1e-5 * rng.standard_normal((len(t), 2))).T
        runs.append(pd.DataFrame({"trajectory": f"run {k}", "time": t, "M": M, "a": a, "b": b}))
    return pd.concat(runs, ignore_index=True)


def test_friction_at_a_driven_joint_hardly_shows_in_the_coupled_equation(log):
    evidence = evidence_of(log, ARMS)
    assert isinstance(evidence, DirectEvidence)
    motor, b = (
        float(np.std(evidence.value[p])) for e in ("motor", "b") for p in [evidence.parts[evidence.equations.index(e)]]
    )
    # Untouched it would be the coupling's share, 0.9.
    assert b < 0.02 * motor


def test_a_resonance_undone_pays_for_the_noise_that_it_makes(log):
    evidence = evidence_of(log, ARMS)
    gain, resonance = (
        {name: dict(values)}
        for name, values in (
            ("sensor_gain@b", {"deviation": 0.2}),
            ("sensor_compliance@b", {"frequency": 20.0, "damping": 0.05}),
        )
    )
    [part] = [p for e, p in zip(evidence.equations, evidence.parts, strict=True) if e == "b"]
    nothing = np.zeros(len(evidence.free))
    # The other arm's noise, which comes through the coupling, stays as it is.
    scaled = evidence._noise_as(evidence.active(gain)) / evidence.noise
    assert np.median(scaled[part]) == pytest.approx(1.0 / 1.2, rel=0.1)
    assert np.median(evidence.spread(gain, nothing)[part]) == pytest.approx(1.0, rel=0.1)  # of what is scaled already
    assert np.max(evidence.widening(gain)[part]) < 1.1
    assert np.min(evidence.widening(resonance)[part]) > 2.0
    assert evidence.widening({}) is None
