"""Trainers of the volume network, against torch's Adam and dense algebra."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from pamid.estimators import StaticPIHM
from support.networks import ACTIVATION, flat, plain_jacobian, plain_law, problem, start

from pamid.errors import FitError, InterruptedFitWarning, ParameterError, UnknownOptionError
from pamid.training import Adam, LevenbergMarquardt, Status, TrainingProblem, trainer_named
from pamid.training.adam import views
from pamid.training.network import (
    activation_named,
)
from pamid.training.reparametrisation import IDENTITY
from pamid.training.trainer import mean_squared_residual


# --- derivatives by hand --------------------------------------------------------------------------------------
# --- Algorithm 1 ----------------------------------------------------------------------------------------------
@pytest.mark.parametrize("batch_size", [64, 17])
@pytest.mark.parametrize("weight_decay", [0.0, 0.05])
def test_adam_is_torchs_adam_with_the_decay_in_the_gradient(batch_size, weight_decay):
    """The same batches give the same parameters, epoch by epoch: MSE gradient plus λθ through the moments."""
    p, parameters = problem(64), start()
    written = {"decay": "once", "epsilon_inside": False}  # as Kingma and Ba, and torch, write it
    ours = Adam(max_iter=12, learning_rate=3e-3, weight_decay=weight_decay, batch_size=batch_size, **written)
    theta = [v.clone().requires_grad_() for v in parameters]
    theirs = torch.optim.Adam(theta, lr=3e-3, betas=(0.9, 0.999), weight_decay=weight_decay)
    rng = np.random.RandomState(4)
    for current, loss in ours.steps(p, parameters, "softplus", np.random.RandomState(4)):
        order = torch.as_tensor(rng.permutation(64)) if batch_size < 64 else torch.arange(64)
        total = 0.0
        for i in range(0, 64, batch_size):
            batch = p.rows(order[i : i + batch_size])
            squared = (plain_law(theta, batch, "softplus")[0] - batch.y) ** 2
            mse = (batch.weight * squared).sum() / batch.weight.sum()
            theirs.zero_grad()
            mse.backward()
            theirs.step()
            total += float((batch.weight * squared).sum().detach())
        torch.testing.assert_close(flat(current), flat(theta).detach(), rtol=1e-8, atol=1e-10)
        assert loss == pytest.approx(total / float(p.weight.sum()), rel=1e-9)


def test_adam_by_default_is_algorithm_1_as_printed():
    """Steps 7 to 12: L = MSE + λ/2 ‖θ‖², g = ∇L + λθ, moments, bias corrections, θ − η M̂/√(V̂ + ε); last epoch kept."""
    p, theta = problem(60), start()
    decay, rate, eps, b1, b2 = 0.05, 3e-3, 1e-4, 0.9, 0.999  # an ε that shows
    ours = Adam(max_iter=9, learning_rate=rate, weight_decay=decay, batch_size=25, epsilon=eps)
    result = ours.run(p, theta, "softplus", np.random.RandomState(4))
    rng, k = np.random.RandomState(4), 0
    shapes = [v.shape for v in theta]
    printed = flat(theta).clone()
    M, V = torch.zeros_like(printed), torch.zeros_like(printed)
    for _ in range(9):
        order = torch.as_tensor(rng.permutation(60))
        for i in range(0, 60, 25):
            batch, k = p.rows(order[i : i + 25]), k + 1
            leaf = printed.clone().requires_grad_()
            squared = (plain_law(views(leaf, shapes), batch, "softplus")[0] - batch.y) ** 2
            loss = (batch.weight * squared).sum() / batch.weight.sum() + decay / 2 * leaf.square().sum()
            g = torch.autograd.grad(loss, leaf)[0] + decay * printed
            M, V = b1 * M + (1 - b1) * g, b2 * V + (1 - b2) * g**2
            printed = printed - rate * (M / (1 - b1**k)) / torch.sqrt(V / (1 - b2**k) + eps)
    torch.testing.assert_close(flat(result.parameters), printed, rtol=1e-8, atol=1e-10)


def test_adam_keeps_the_last_epoch_or_the_best():
    """A rate at which the loss rises again: as printed the last epoch is kept, held-out runs or not."""
    p, held_out = problem(60), problem(40, seed=9)
    for validation in (None, held_out):
        runs = {
            keep: Adam(max_iter=8, learning_rate=0.5, keep=keep, patience=100).run(
                p, start(), "softplus", np.random.RandomState(0), validation=validation
            )
            for keep in ("last", "best")
        }
        judged = p if validation is None else validation
        errors = {keep: mean_squared_residual(r.parameters, judged, "softplus") for keep, r in runs.items()}
        assert errors["best"] < errors["last"]
        assert len(runs["last"].loss_curve) == 8
    stopped = Adam(max_iter=200, learning_rate=0.5, keep="best", patience=5)
    assert stopped.run(p, start(), "softplus", np.random.RandomState(0), validation=held_out).n_iter < 200


def test_adam_yields_parameters_that_later_steps_do_not_change():
    steps = Adam(max_iter=3).steps(problem(), start(), "softplus", np.random.RandomState(0))
    first, _ = next(steps)
    copied = flat(first).clone()
    next(steps)
    assert torch.equal(flat(first), copied)


# --- Levenberg–Marquardt --------------------------------------------------------------------------------------
@pytest.mark.parametrize("reads_value", [True, False])
@pytest.mark.parametrize("activation", ACTIVATION)
def test_the_step_in_sample_space_solves_the_dense_normal_equations(activation, reads_value):
    """(JᵀWJ + cI) δ = −JᵀWr − λ(θ − θ₀), with sample weights and a prior that is not zero."""
    p, theta, origin = problem(25, reads_value=reads_value), start((4, 6, 5, 1)), start((4, 6, 5, 1), seed=7)
    decay, damping = 0.03, 0.08
    trainer = LevenbergMarquardt(weight_decay=decay)
    root = (p.weight / p.weight.sum()).sqrt()
    here = trainer._pass(origin, p, root, activation, IDENTITY, theta)
    trial, r = trainer._equations(here, root, IDENTITY).trial(damping), here.residual

    J = root[:, None] * plain_jacobian(theta, p, activation)
    c = damping * float((J**2).sum()) + decay  # damped relative to the trace
    A = J.T @ J + c * torch.eye(J.shape[1], dtype=torch.float64)
    dense = torch.linalg.solve(A, -J.T @ r - decay * (flat(theta) - flat(origin)))
    torch.testing.assert_close(flat(trial) - flat(theta), dense, rtol=1e-8, atol=1e-9)


@pytest.mark.parametrize("trainer", [Adam(max_iter=150, learning_rate=5e-3), LevenbergMarquardt(max_iter=40)])
@pytest.mark.parametrize("activation", ACTIVATION)
def test_every_trainer_lowers_every_loss(trainer, activation):
    p, parameters = problem(200), start()
    before = mean_squared_residual(parameters, p, activation)
    result = trainer.run(p, parameters, activation, np.random.RandomState(0))
    assert mean_squared_residual(result.parameters, p, activation) < 0.3 * before
    assert result.n_iter == len(result.loss_curve) <= trainer.max_iter
    assert result.status in (Status.FINISHED, Status.CONVERGED)


def test_levenberg_marquardt_never_climbs_on_all_samples_and_converges():
    """Without a pull every accepted step lowers the loss; with more parameters than samples it ends near zero."""
    trainer = LevenbergMarquardt(max_iter=200, weight_decay=0.0)
    result = trainer.run(problem(40), start(), "tanh", np.random.RandomState(0))
    assert np.all(np.diff(result.loss_curve) < 0)
    assert result.loss_curve[-1] < 1e-6 * result.loss_curve[0]


def test_levenberg_marquardt_draws_batches_where_there_are_many_samples():
    p = problem(600)
    result = LevenbergMarquardt(max_iter=40, batch_size=100).run(p, start(), "tanh", np.random.RandomState(0))
    assert mean_squared_residual(result.parameters, p, "tanh") < 0.1 * mean_squared_residual(start(), p, "tanh")


def test_a_strong_pull_keeps_the_parameters_at_the_prior():
    p, here = problem(50), start()
    free = LevenbergMarquardt(max_iter=10, weight_decay=1e-9).run(p, here, "tanh", np.random.RandomState(0), prior=here)
    held = LevenbergMarquardt(max_iter=10, weight_decay=1e3).run(p, here, "tanh", np.random.RandomState(0), prior=here)
    moved = [float((flat(r.parameters) - flat(here)).norm()) for r in (free, held)]
    assert moved[1] < 1e-2 * moved[0]


# --- the loop that all trainers share -------------------------------------------------------------------------
class Scripted(Adam):
    """Walks through given biases of a network whose output is its bias."""

    script: tuple[float, ...] = ()
    fails: BaseException | None = None

    def steps(self, problem, parameters, activation, random_state, prior=None):
        for value in self.script:
            current = [torch.zeros(1, 4, dtype=torch.float64), torch.tensor([value], dtype=torch.float64)]
            yield current, mean_squared_residual(current, problem, activation)
        if self.fails is not None:
            raise self.fails


def level(y, n=10):
    """Residual = bias − y."""
    zero = np.zeros((n, 4))
    return TrainingProblem.from_arrays(zero, zero, np.ones(n), np.full(n, float(y)))


def scripted(*script, fails=None, patience=500):
    trainer = Scripted(patience=patience, keep="best")
    trainer.script, trainer.fails = script, fails
    return trainer


BIAS = [torch.zeros(1, 4, dtype=torch.float64), torch.tensor([10.0], dtype=torch.float64)]


def test_early_stopping_returns_the_best_on_the_held_out():
    """The training target is 0, the held-out one 3: the walk passes it and goes on until patience ends."""
    trainer = scripted(*np.arange(9.0, -9.0, -1.0), patience=4)
    result = trainer.run(level(0), BIAS, "tanh", np.random.RandomState(0), validation=level(3))
    assert result.status is Status.STOPPED_EARLY
    assert float(result.parameters[1]) == 3.0
    assert result.n_iter == 7 + 4  # 9 ... 3, then four without a new best
    assert result.validation_curve[6] == 0.0 and len(result.validation_curve) == result.n_iter


def test_the_start_is_kept_if_nothing_is_better():
    result = scripted(11.0, 12.0).run(level(10), BIAS, "tanh", np.random.RandomState(0))
    assert float(result.parameters[1]) == 10.0


def test_a_callback_stops_and_the_best_is_kept():
    seen = []

    def callback(loss, parameters):
        seen.append((loss, float(parameters[1])))
        return len(seen) == 3

    result = scripted(2.0, 1.0, 4.0, 0.0).run(level(0), BIAS, "tanh", np.random.RandomState(0), callback=callback)
    assert result.status is Status.STOPPED_BY_CALLBACK
    assert seen == [(4.0, 2.0), (1.0, 1.0), (16.0, 4.0)]
    assert float(result.parameters[1]) == 1.0


def test_interruption_keeps_the_best_so_far():
    trainer = scripted(5.0, 2.0, 3.0, fails=KeyboardInterrupt())
    result = trainer.run(level(0), BIAS, "tanh", np.random.RandomState(0))
    assert result.status is Status.INTERRUPTED
    assert result.n_iter == 3 and float(result.parameters[1]) == 2.0


def test_a_process_that_is_ended_does_not_train_on():
    class Ended(KeyboardInterrupt):
        """What the command line makes of SIGTERM."""

    with pytest.raises(Ended):
        scripted(5.0, 2.0, fails=Ended()).run(level(0), BIAS, "tanh", np.random.RandomState(0))


def test_divergence_keeps_the_best_so_far():
    result = scripted(5.0, 2.0, np.inf, 0.0).run(level(0), BIAS, "tanh", np.random.RandomState(0))
    assert result.status is Status.DIVERGED
    assert float(result.parameters[1]) == 2.0
    assert "wrong units" in result.status.value


@pytest.mark.parametrize("trainer", [Adam(learning_rate=1e200), LevenbergMarquardt()])
def test_a_loss_beyond_the_numbers_ends_as_diverged(trainer):
    p = problem(20)
    if isinstance(trainer, LevenbergMarquardt):
        p = TrainingProblem(p.x, p.direction, p.a, p.y * 1e200, p.weight)
    result = trainer.run(p, start(), "softplus", np.random.RandomState(0))
    assert result.status is Status.DIVERGED
    assert torch.isfinite(flat(result.parameters)).all()


def test_the_start_and_the_global_random_state_are_left_alone():
    parameters = start()
    before = flat(parameters).clone()
    torch_state, numpy_state = torch.random.get_rng_state(), np.random.get_state()[1].copy()  # noqa: NPY002
    runs = [
        trainer.run(problem(90), parameters, "tanh", np.random.RandomState(5))
        for trainer in (Adam(max_iter=5, batch_size=32), LevenbergMarquardt(max_iter=5, batch_size=32))
        for _ in range(2)
    ]
    assert torch.equal(flat(parameters), before)
    assert torch.equal(torch.random.get_rng_state(), torch_state)
    assert np.array_equal(np.random.get_state()[1], numpy_state)  # noqa: NPY002
    assert runs[0].loss_curve == runs[1].loss_curve and runs[2].loss_curve == runs[3].loss_curve


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
@pytest.mark.parametrize("trainer", [Adam(max_iter=3), LevenbergMarquardt(max_iter=3)])
def test_the_floating_type_is_kept(trainer, dtype):
    result = trainer.run(problem(30, dtype=dtype), start(dtype=dtype), "silu", np.random.RandomState(0))
    assert {p.dtype for p in result.parameters} == {dtype}
    assert np.all(np.isfinite(result.loss_curve))


def test_samples_of_zero_weight_are_left_out():
    weight = np.array([1.0, 0.0, 2.0])
    p = TrainingProblem.from_arrays(np.eye(3, 4), np.eye(3, 4), np.ones(3), np.array([1.0, np.nan, 3.0]), weight)
    assert len(p) == 2 and p.y.tolist() == [1.0, 3.0]


# --- parameters -----------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    "bad",
    [
        Adam(max_iter=0),
        Adam(batch_size=2.5),
        Adam(learning_rate=-1e-3),
        Adam(learning_rate=float("nan")),
        Adam(patience=0),
        Adam(keep="first"),
        Adam(decay="thrice"),
        LevenbergMarquardt(max_iter=-3),
        LevenbergMarquardt(batch_size=0),
        LevenbergMarquardt(weight_decay=-1.0),
        LevenbergMarquardt(damping=float("inf")),
    ],
)
def test_bad_parameters_are_named(bad):
    with pytest.raises(ParameterError, match=type(bad).__name__):
        bad.run(problem(10), start(), "tanh", np.random.RandomState(0))


def test_trainers_by_name():
    assert isinstance(trainer_named("adam"), Adam)
    mine = LevenbergMarquardt(max_iter=3)
    assert trainer_named(mine) is mine
    for wrong in ("sgd", 3, None):
        with pytest.raises(UnknownOptionError, match="adam, adam_as_run, levenberg_marquardt"):
            trainer_named(wrong)
    with pytest.raises(UnknownOptionError, match="softplus"):
        activation_named("relu")


# --- what the estimators make of it ---------------------------------------------------------------------------
class Interrupted(LevenbergMarquardt):
    """Ctrl-C comes after the fifth step."""

    def steps(self, *args, **kwargs):
        for k, step in enumerate(super().steps(*args, **kwargs)):
            if k == 5:
                raise KeyboardInterrupt
            yield step


@pytest.fixture(scope="module")
def force():
    rng = np.random.default_rng(0)
    X = np.column_stack([rng.uniform(0, 0.2, 150), rng.normal(size=150), rng.uniform(2e5, 6e5, 150), np.zeros(150)])
    X[:, 3] = 1e5 * rng.normal(size=150)
    return X, (X[:, 2] - 101_325) * 8e-4 * (1 - 3.3 * X[:, 0])


def test_an_interrupted_estimator_warns_and_predicts(force):
    model = StaticPIHM(volume_model="neural", hidden_layer_sizes=(8,), trainer=Interrupted(), random_state=0)
    with pytest.warns(InterruptedFitWarning, match="parameters so far"):
        model.fit(*force)
    assert model.status_ == "interrupted" and model.n_iter_ == 5
    assert model.score(*force) > 0.9


def test_a_diverged_estimator_raises(force):
    trainer = Adam(learning_rate=1e200, max_iter=5)
    with pytest.raises(FitError, match="units"):
        StaticPIHM(volume_model="neural", hidden_layer_sizes=(8,), trainer=trainer, random_state=0).fit(*force)
