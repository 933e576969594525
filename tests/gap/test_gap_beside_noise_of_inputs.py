"""Over long predictions the noise of an input adds up to the size of a gap; over short ones it does not."""

import numpy as np
import pandas as pd
import pytest

from pamid import diagnose
from pamid.gap.simulated import evidence_of
from pamid.simulators import EquationSimulator, Port

DRIVE = EquationSimulator(
    {
        "dm/dt": "n",
        "dn/dt": "250*i - 5*n - 4000*(m - q) - 40*(n - w)",
        "dq/dt": "w",
        "dw/dt": "1000*(m - q) + 10*(n - w) - 2.5*w",
    },
    [
        Port("i", "input", "A"),
        *(Port(n, "state", u) for n, u in (("m", "rad"), ("n", "rad/s"))),
        *(Port(n, "state", u) for n, u in (("q", "rad"), ("w", "rad/s"))),
    ],
    {},
)


def logged(friction: float, commanded: bool, count: int = 4, rows: int = 4000) -> pd.DataFrame:
    """A load on a shaft whose motor is not read; the noise in its current is a controller's, or a sensor's."""
    rng, runs, dt = np.random.default_rng(3), [], 1e-3
    t = dt * np.arange(rows)
    for run in range(count):
        tones = zip(rng.uniform(0.3, 2, 4), rng.uniform(0, 6, 4), strict=True)
        smooth = sum(np.sin(2 * np.pi * f * t + p) for f, p in tones)
        read = smooth + 0.03 * rng.standard_normal(len(t))
        m, n, q, w, angles = 0.0, 0.0, 0.0, 0.0, []
        for i in read if commanded else smooth:
            angles.append(q)
            for _ in range(4):
                twist = (m - q) + 0.01 * (n - w)
                n += dt / 4 * (250.0 * i - 5.0 * n - 4000.0 * twist)
                w += dt / 4 * (1000.0 * twist - 2.5 * w - friction * np.tanh(w / 0.05))
                m, q = m + dt / 4 * n, q + dt / 4 * w
        q = np.array(angles) + 5e-5 * rng.standard_normal(len(t))
        runs.append(pd.DataFrame({"trajectory": str(run), "time": t, "i": read, "q": q}))
    return pd.concat(runs, ignore_index=True)


def test_a_gap_is_seen_though_noise_of_the_input_would_explain_whole_runs():
    evidence = evidence_of(logged(0.3, commanded=True), DRIVE, refit=True)
    assert not evidence.hears_inputs and max(evidence.without_causes().scales) > 1.5
    assert "whole runs" not in evidence.how and "whole runs" in evidence.longer.how


def test_noise_of_an_input_leaves_no_gap():
    evidence = evidence_of(logged(0.0, commanded=False), DRIVE, refit=True)
    assert max(evidence.without_causes().scales) < 1.1
    assert evidence.by_inputs < 1.0  # over longer stretches the noise lasts as an effect does


def test_inputs_that_look_noisy_and_are_exact_leave_whole_runs():
    evidence = evidence_of(logged(0.0, commanded=True), DRIVE, refit=True)
    assert not evidence.hears_inputs and "whole runs" in evidence.how and evidence.longer is None


def test_its_cause_is_named():
    found = diagnose(logged(0.3, commanded=True, count=2, rows=2000), DRIVE)
    assert not any("whole runs" in note for note in found.notes)
    assert [c.effects[0] for c in found.added] == ["coulomb_friction"], str(found)
    assert found.added[0].parameters["amplitude"].value == pytest.approx(0.3, rel=0.1)
