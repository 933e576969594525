"""Adapters: their counts, that they start at the source, their derivatives, and training through them."""

from itertools import pairwise

import numpy as np
import pytest
import torch

from pamid.adapters.base import Bound, n_parameters
from pamid.adapters.fine_tuning import FineTuning
from pamid.adapters.frozen import Frozen
from pamid.adapters.geometry import volume_ratio
from pamid.adapters.low_rank import LowRank
from pamid.adapters.registry import adapter_named, adapters
from pamid.adapters.scalar import Scalar
from pamid.errors import ParameterError, UnknownOptionError
from pamid.training import Adam, LevenbergMarquardt, TrainingProblem
from pamid.training.network import adjoints, forward, gradient


def network(sizes):
    rng = np.random.default_rng(0)
    pairs = pairwise(sizes)
    return [a for m, n in pairs for a in (rng.normal(size=(n, m)), rng.normal(size=n))]


@pytest.mark.parametrize(
    ("adapter", "count"), [(FineTuning(), 17_281), (FineTuning((0,)), 640), (Scalar(4.0), 17_282), (LowRank(), 1_288)]
)
def test_counts_are_the_published_ones(adapter, count):
    assert n_parameters(adapter.initial(network((4, 128, 128, 1)), np.random.default_rng(0))) == count


EVERY = [
    FineTuning(),
    FineTuning((1,)),
    Scalar(4.0),
    Scalar(2.0, FineTuning((0, 2))),
    LowRank(),
    Scalar(9.0, LowRank((1, 0, 1))),
    Scalar(3.0, Frozen()),
    *(c() for c in adapters().values()),
]
each = pytest.mark.parametrize("adapter", EVERY, ids=repr)


@each
def test_pullback_is_the_gradient_of_expand(adapter):
    source, rng = network((4, 5, 4, 1)), np.random.default_rng(1)
    psi = [p + 0.1 * rng.normal(size=p.shape) for p in adapter.initial(source, rng)]
    step = [rng.normal(size=p.shape) for p in psi]
    w = [rng.normal(size=a.shape) for a in source]

    def at(h):
        moved = adapter.expand(source, [p + h * s for p, s in zip(psi, step, strict=True)])
        return sum(float((a * b).sum()) for a, b in zip(w, moved, strict=True))

    exact = sum(float((g * s).sum()) for g, s in zip(adapter.pullback(source, psi, w), step, strict=True))
    assert exact == pytest.approx((at(1e-5) - at(-1e-5)) / 2e-5, rel=1e-6)


@each
def test_pushforward_is_the_transpose_of_pullback(adapter):
    source, rng = network((4, 5, 4, 1)), np.random.default_rng(1)
    psi = [p + 0.1 * rng.normal(size=p.shape) for p in adapter.initial(source, rng)]
    step = [rng.normal(size=p.shape) for p in psi]
    g = [rng.normal(size=a.shape) for a in source]
    there = sum(float((a * b).sum()) for a, b in zip(g, adapter.pushforward(source, psi, step), strict=True))
    back = sum(float((a * b).sum()) for a, b in zip(adapter.pullback(source, psi, g), step, strict=True))
    assert there == pytest.approx(back, rel=1e-12)


def tensors(arrays):
    return [torch.as_tensor(a) for a in arrays]


def task(n=40, *, reads_value=True):
    """Ask for the law of a network that is 1.5 times the source, with a changed first layer."""
    rng = np.random.default_rng(2)
    x, d = rng.normal(size=(n, 4)), rng.normal(size=(n, 4))
    a = rng.normal(size=n) * reads_value
    target = network((4, 5, 4, 1))
    target[0] = target[0] + 0.1
    target[-2], target[-1] = 1.5 * target[-2], 1.5 * target[-1]
    tape = forward(tensors(target), *tensors([x, d, a]), "tanh")
    return TrainingProblem.from_arrays(x, d, a, tape.y.numpy(), rng.uniform(0.5, 2.0, n))


@each
@pytest.mark.parametrize("reads_value", [True, False])
def test_gram_is_that_of_the_gradients_by_psi(adapter, reads_value):
    p, rng = task(9, reads_value=reads_value), np.random.default_rng(1)
    source = tensors(network((4, 5, 4, 1)))
    psi = [q + torch.as_tensor(0.1 * rng.normal(size=q.shape)) for q in adapter.initial(source, rng)]
    theta = adapter.expand(source, psi)
    tape = forward(theta, p.x, p.direction, p.a, "tanh")
    rows = []
    for k in range(len(p)):
        unit = torch.zeros(len(p), dtype=torch.float64)
        unit[k] = 1.0
        by_psi = adapter.pullback(source, psi, gradient(theta, tape, unit))
        rows.append(torch.cat([torch.zeros(1, dtype=torch.float64), *(g.reshape(-1) for g in by_psi)]))
    J = torch.stack(rows)
    torch.testing.assert_close(adapter.gram(source, psi, adjoints(theta, tape), tape), J @ J.T, rtol=1e-9, atol=1e-9)


@each
@pytest.mark.parametrize("trainer", [Adam(max_iter=30, learning_rate=3e-3), LevenbergMarquardt(max_iter=5)])
@pytest.mark.parametrize("dtype", [torch.float64, torch.float32])
def test_trainers_work_through_every_adapter(adapter, trainer, dtype):
    source = [t.to(dtype) for t in tensors(network((4, 5, 4, 1)))]
    p = task()
    p = TrainingProblem(*(v.to(dtype) for v in (p.x, p.direction, p.a, p.y, p.weight)))
    psi = adapter.initial(source, np.random.default_rng(0))
    if not psi:
        return
    result = trainer.run(p, psi, "tanh", np.random.RandomState(0), prior=psi, adapter=Bound(adapter, source))
    assert [q.shape for q in result.parameters] == [q.shape for q in psi]
    start = ((forward(adapter.expand(source, psi), p.x, p.direction, p.a, "tanh").y - p.y) ** 2 * p.weight).sum()
    assert result.loss_curve[-1] < 0.99 * float(start / p.weight.sum())


def test_levenberg_marquardt_step_through_an_adapter_solves_the_dense_normal_equations():
    source, p, adapter = tensors(network((4, 5, 4, 1))), task(12), Scalar(1.2, LowRank((1, 2)))
    rng = np.random.default_rng(3)
    psi = [q + torch.as_tensor(0.1 * rng.normal(size=q.shape)) for q in adapter.initial(source, rng)]
    origin = [q + 0.05 for q in psi]
    theta = adapter.expand(source, psi)
    root = (p.weight / p.weight.sum()).sqrt()
    tape = forward(theta, p.x, p.direction, p.a, "tanh")
    r = root * (tape.y - p.y)
    decay, damping = 1e-2, 1.5e-2
    bound = Bound(adapter, source)
    trainer = LevenbergMarquardt(weight_decay=decay)
    here = trainer._pass(origin, p, root, "tanh", bound, psi)
    trial = trainer._equations(here, root, bound).trial(damping)

    def flat(arrays):
        return torch.cat([a.reshape(-1) for a in arrays])

    rows = [flat(bound.pullback(psi, gradient(theta, tape, root * e))) for e in torch.eye(len(p), dtype=torch.float64)]
    J = torch.stack(rows)
    c = damping * float((J**2).sum()) + decay  # damped relative to the trace
    A = J.T @ J + c * torch.eye(J.shape[1], dtype=torch.float64)
    dense = torch.linalg.solve(A, -J.T @ r - decay * (flat(psi) - flat(origin)))
    torch.testing.assert_close(flat(trial) - flat(psi), dense, rtol=1e-8, atol=1e-10)


def test_adam_is_the_published_algorithm_2():
    """Q learns at 0.2 of the rate, and the decay of Q and of the network is inside the gradient, twice as printed."""
    source, p = tensors(network((4, 5, 4, 1))), task()
    adapter = Scalar(2.0)
    ours = Adam(max_iter=25, learning_rate=1e-2, weight_decay=1e-3, epsilon_inside=False)
    psi = adapter.initial(source, np.random.default_rng(0))
    *_, (reached, _) = ours.steps(p, psi, "tanh", np.random.RandomState(0), None, Bound(adapter, source))

    trained = [q.clone().requires_grad_() for q in psi]
    groups = [{"params": trained[:1], "lr": 2e-3}, {"params": trained[1:], "lr": 1e-2}]
    torchs = torch.optim.Adam(groups, weight_decay=2e-3)
    for _ in range(25):
        torchs.zero_grad()
        x = p.x.clone().requires_grad_()
        h = x
        for k in (1, 3):
            h = torch.tanh(h @ trained[k].T + trained[k + 1])
        V = trained[0] * (h @ trained[5].T + trained[6])[:, 0]
        (slope,) = torch.autograd.grad(V.sum(), x, create_graph=True)
        y = p.a * V + (slope * p.direction).sum(1)
        ((y - p.y) ** 2 * p.weight).sum().div(p.weight.sum()).backward()
        torchs.step()
    for a, b in zip(reached, trained, strict=True):
        torch.testing.assert_close(a, b.detach(), rtol=1e-6, atol=1e-8)


def test_adapters_are_found_by_name():
    assert {"full", "low_rank", "scalar", "frozen"} <= set(adapters())
    mine = LowRank((1,))
    assert adapter_named(mine) is mine
    assert adapter_named("full") == FineTuning()
    for wrong in ("loro", 3, LowRank):
        with pytest.raises(UnknownOptionError, match="low_rank"):
            adapter_named(wrong)


def test_start_multiplies_the_source_by_q0_and_leaves_it_untouched():
    source = network((4, 5, 1))
    before = [a.copy() for a in source]
    adapter = Scalar(4.0)
    psi = adapter.initial(source, np.random.default_rng(0))
    theta = adapter.expand(source, psi)
    np.testing.assert_allclose(theta[-2], 4 * source[-2])
    psi[1] += 1.0
    for a, b in zip(source, before, strict=True):
        np.testing.assert_array_equal(a, b)


@pytest.mark.parametrize("q0", [0.0, -1.0, np.nan])
def test_impossible_q0_is_refused(q0):
    with pytest.raises(ParameterError, match="factor on the volume"):
        Scalar(q0)


@pytest.mark.parametrize("layers", [(), (3,), (-1,)])
def test_layers_the_network_lacks_are_refused(layers):
    with pytest.raises(ParameterError, match="layers to train"):
        FineTuning(layers).initial(network((4, 5, 3, 1)), np.random.default_rng(0))


def test_low_rank_starts_at_the_source():
    source = network((4, 5, 4, 1))
    adapter = LowRank()
    theta = adapter.expand(source, adapter.initial(source, np.random.default_rng(0)))
    for a, b in zip(theta, source, strict=True):
        np.testing.assert_array_equal(a, b)


@pytest.mark.parametrize("ranks", [(), (0, 0), (-1, 2), (5,), (1, 1, 1, 1)])
def test_impossible_ranks_are_refused(ranks):
    with pytest.raises(ParameterError, match="rank"):
        LowRank(ranks).initial(network((4, 5, 4, 1)), np.random.default_rng(0))


def test_geometry_gives_q0_and_its_uncertainty():
    assert volume_ratio((0.1, 0.01), (0.1, 0.02)).value == pytest.approx(4)
    rng, n = np.random.default_rng(0), 200_000
    L = 1 + 0.01 * rng.normal(size=(2, n))
    D = 1 + 0.02 * rng.normal(size=(2, n))
    drawn = 4 * (D[1] / D[0]) ** 2 * L[1] / L[0]
    assert volume_ratio((0.1, 0.01), (0.1, 0.02), (0.01, 0.02)).uncertainty == pytest.approx(drawn.std(), rel=0.02)


@pytest.mark.parametrize(
    ("target", "relative"), [((0.0, 0.01), (0, 0)), ((0.1, np.nan), (0, 0)), ((0.1, 0.01), (-0.1, 0))]
)
def test_impossible_geometry_is_refused(target, relative):
    with pytest.raises(ParameterError):
        volume_ratio((0.1, 0.01), target, relative)
