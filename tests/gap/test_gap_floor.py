"""The noise of a single equation: what neighbouring samples and repeats say, whatever could be predicted."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from pamid.estimators import GapDiagnoser

from pamid.gap.residuals.on_equation import OnEquation
from pamid.gap.residuals.single import SignalEvidence, Stated
from pamid.gap.simulated import learn

DT = 0.002
TIME = np.arange(0, 8, DT)
SPEEDS = (1.0, 1.7, 2.6, 3.1)
WINDOW = 10
"""Samples of a window of 20 ms."""


def evidence(add, speeds=SPEEDS, noise=0.3, input_noise=0.0, slope=0.0, seed=0):
    """Runs of a stroke; ``add`` takes time, stroke and run, and returns what the model lacks."""
    rng = np.random.default_rng(seed)
    x = [0.1 * np.sin(w * TIME) for w in speeds]
    read = [v + input_noise * rng.standard_normal(len(v)) for v in x]
    y = [slope * v + add(TIME, v, k) + noise * rng.standard_normal(len(v)) for k, v in enumerate(x)]
    table = {"time": np.tile(TIME, len(x)), "position": np.concatenate(read)}
    starts = len(TIME) * np.arange(len(x))
    equation = OnEquation(table, lambda t: slope * t["position"], DT, starts, "force")
    return SignalEvidence(Stated(equation, np.concatenate(y)), [str(k) for k in range(len(x))])


def measured_noise(source):
    [noise] = np.unique(source.noise)
    return noise


def test_what_cannot_be_predicted_is_no_noise():
    """A tide of another phase in each run: a learner fails, and the noise is that of the sensor all the same."""
    source = evidence(lambda t, x, k: 5.0 * np.sin(0.9 * t + 2.0 * k))
    noise = measured_noise(source)
    assert noise == pytest.approx(0.3 / np.sqrt(WINDOW), rel=0.1)
    [learned] = learn(source, []).learned
    assert learned.rms > 2.0 and learned.share < 0.7


def test_what_can_be_predicted_is_said():
    source = evidence(lambda t, x, k: -40.0 * x)
    [learned] = learn(source, []).learned
    assert learned.share > 0.9


def test_the_noise_of_an_input_comes_through_the_model():
    source = evidence(lambda t, x, k: 0.0, noise=0.1, input_noise=1e-3, slope=500.0)
    assert measured_noise(source) == pytest.approx(np.hypot(0.1, 0.5) / np.sqrt(WINDOW), rel=0.1)


def test_runs_that_repeat_say_what_no_model_predicts():
    """What drifts between two runs of one command is noise; what two different runs differ by is not."""

    def drift(t, x, k):
        return 0.7 * np.sin(0.8 * t + 1.5 * k)

    different, alike = (evidence(drift, speeds) for speeds in (SPEEDS, (1.0, 1.7, 1.0, 1.7)))
    assert measured_noise(different) == pytest.approx(0.3 / np.sqrt(WINDOW), rel=0.1)
    expected = np.sqrt(np.mean(np.square(drift(TIME, 0, 0) - drift(TIME, 0, 2))) / 2 + 0.3**2 / WINDOW)
    assert measured_noise(alike) == pytest.approx(expected, rel=0.1)


@pytest.mark.parametrize("repeated", [False, True])
def test_no_correction_goes_below_the_noise(repeated):
    rng, parts = np.random.default_rng(1), []
    for k, w in enumerate((1.0, 1.7, 1.0, 1.7) if repeated else SPEEDS):
        x = 0.1 * np.sin(w * TIME)
        y = -30.0 * np.gradient(x, TIME) + 0.3 * rng.standard_normal(len(TIME))
        parts.append(pd.DataFrame({"time": TIME, "x": x, "y": y, "trajectory": str(k)}))
    log = pd.concat(parts, ignore_index=True)
    library = ["viscous_friction", "coulomb_friction", "bladder_elasticity", "force_bias", "quadratic_drag", "creep"]
    found = GapDiagnoser(effects=library, signals={"time": "time", "position": "x"}, random_state=0)
    found.fit(log[["time", "x"]], log["y"], groups=log["trajectory"])
    assert found.causes_[0].effects == ("viscous_friction",)
    [closure] = found.closure_
    assert closure.noise_floor == pytest.approx(found.noise_floor_)
    assert 0.9 * closure.noise_floor < closure.rmse_after < 1.2 * closure.noise_floor
    assert found.explainable_share_ > 0.9
