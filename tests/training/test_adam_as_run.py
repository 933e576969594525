"""The algorithms as their authors ran them: what differs from the print, in which units, and that the print stays."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
import torch
from pamid.estimators import QAdapter, StaticPIHM, ThermodynamicPIHM
from sklearn.frozen import FrozenEstimator

from pamid.training import Adam, AdamAsRun, TrainingProblem, trainer_named

NORMAL_LITRE = 2.1542e-5
"""kg/s of one NL/min at 1.2925 kg/m³."""


@pytest.fixture
def log():
    t = np.linspace(0, 6, 200)
    X = pd.DataFrame({"eps": 0.1 + 0.05 * np.sin(t), "deps": 0.05 * np.cos(t)})
    X["P"], X["dP"] = 3e5 + 1e5 * np.cos(3 * t), -3e5 * np.sin(3 * t)
    V, dV = 7e-5 * (1 + 2 * X["eps"]), 1.4e-4 * X["deps"]
    return X, X["dP"] * V / (1.4 * 287 * 293) + X["P"] * dV / (287 * 293)


def fitted(log, **options) -> ThermodynamicPIHM:
    options = {"max_iter": 1, "hidden_layer_sizes": (8,), "random_state": 0} | options
    return ThermodynamicPIHM(volume_model="neural", trainer="adam_as_run", **options).fit(*log)


def test_the_steps_are_those_of_the_library() -> None:
    """Decay once through the moments, ε beside the root: torch's own Adam with its weight_decay."""
    rng = np.random.default_rng(0)
    arrays = (rng.normal(size=(64, 4)), rng.normal(size=(64, 4)), rng.normal(size=64), rng.normal(size=64))
    problem = TrainingProblem.from_arrays(*arrays)
    start = [torch.tensor(rng.normal(size=s)) for s in ((5, 4), (5,), (1, 5), (1,))]
    run = AdamAsRun(max_iter=3, batch_size=32).run(problem, start, "softplus", np.random.RandomState(1))
    plain = Adam(max_iter=3, batch_size=32, decay="once", epsilon_inside=False)
    other = plain.run(problem, start, "softplus", np.random.RandomState(1))
    for a, b in zip(run.parameters, other.parameters, strict=True):
        torch.testing.assert_close(a, b)
    assert trainer_named("adam").decay == "twice"
    assert trainer_named("adam").units is None


def test_the_network_reads_and_gives_the_units_of_the_notebooks(log) -> None:
    model = fitted(log)
    X, y = log
    read, _ = model.input_scale_.apply(X.to_numpy())
    np.testing.assert_allclose(read, np.column_stack([10 * X["eps"], 10 * X["deps"], X["P"] / 1e5, X["dP"] / 1e5]))
    assert model.volume_scale_ == 1e-10
    # An untrained network gives next to no flow: the first loss is the mean square of the target in (NL/min)².
    assert model.loss_curve_[0] == pytest.approx(np.mean((y / NORMAL_LITRE) ** 2), rel=1e-3)


@pytest.mark.filterwarnings("ignore::pamid.errors.AdaptationWarning")
def test_an_adapter_runs_a_thousand_epochs_in_batches_of_128(log) -> None:
    source = FrozenEstimator(fitted(log))
    adapter = QAdapter(source, 4.0, trainer="adam_as_run")
    trainer = adapter._trainer(1e-5)
    assert (trainer.max_iter, trainer.batch_size, trainer.decay) == (1000, 128, "once")
    adapter.set_params(max_iter=2).fit(*log)
    assert adapter.model_.target_scale_[0] == NORMAL_LITRE


def test_a_model_of_force_keeps_the_spread_of_its_data(log) -> None:
    X, _ = log
    F = (X["P"] - 101325) * 5e-4 * (1 - 3 * X["eps"])
    model = StaticPIHM(
        volume_model="neural", trainer="adam_as_run", max_iter=1, hidden_layer_sizes=(8,), random_state=0
    ).fit(X, F)
    assert model.target_scale_[0] == pytest.approx(np.std(F))
