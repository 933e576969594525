"""The volume network's derivatives by hand, against autograd."""

from __future__ import annotations

import copy

import numpy as np
import pytest
import torch
from support.networks import ACTIVATION, PLAIN, WIDTHS, flat, plain_jacobian, plain_law, problem, start
from threadpoolctl import threadpool_info

from pamid.training import Adam
from pamid.training.adam import device_gradient
from pamid.training.host import HostGradient
from pamid.training.network import (
    ACTIVATIONS,
    TILE,
    adjoints,
    forward,
    gradient,
    gram,
    jacobian_product,
    transposed_product,
)


@pytest.mark.parametrize("activation", ACTIVATION)
def test_activations_and_their_two_derivatives(activation):
    z = torch.linspace(-30, 30, 241, dtype=torch.float64, requires_grad=True)
    (slope,) = torch.autograd.grad(PLAIN[activation](z).sum(), z, create_graph=True)
    (bend,) = torch.autograd.grad(slope.sum(), z)
    value = z.detach().clone()
    ours_too = ACTIVATIONS[activation](value, True)  # leaves the value in place of z
    for ours, theirs in zip((value, *ours_too), (PLAIN[activation](z), slope, bend), strict=True):
        torch.testing.assert_close(ours, theirs.detach(), rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("widths", WIDTHS)
@pytest.mark.parametrize("reads_value", [True, False])
@pytest.mark.parametrize("activation", ACTIVATION)
def test_value_derivative_and_gradient_are_those_of_autograd(activation, widths, reads_value):
    p, parameters = problem(20, reads_value=reads_value), start(widths)
    theta = [v.clone().requires_grad_() for v in parameters]
    y, value, slope = plain_law(theta, p, activation)
    for a, d, theirs in ((torch.ones(20), 0.0 * p.direction, value), (None, p.direction, slope)):
        ours = forward(parameters, p.x, d, a, activation).y
        torch.testing.assert_close(ours, theirs.detach(), rtol=1e-12, atol=1e-12)

    upstream = torch.linspace(-1, 2, 20, dtype=torch.float64)
    theirs = torch.autograd.grad((upstream * y).sum(), theta, materialize_grads=True)
    tape = forward(parameters, p.x, p.direction, p.a, activation)
    torch.testing.assert_close(tape.y, y.detach(), rtol=1e-12, atol=1e-12)
    for mine, other in zip(gradient(parameters, tape, upstream), theirs, strict=True):
        torch.testing.assert_close(mine, other, rtol=1e-10, atol=1e-11)


@pytest.mark.parametrize("widths", WIDTHS)
@pytest.mark.parametrize("reads_value", [True, False])
@pytest.mark.parametrize("activation", ACTIVATION)
def test_jacobian_products_without_the_jacobian(activation, widths, reads_value):
    p, parameters = problem(12, reads_value=reads_value), start(widths, seed=3)
    J = plain_jacobian(parameters, p, activation)
    tape = forward(parameters, p.x, p.direction, p.a, activation)
    adjoint = adjoints(parameters, tape)
    torch.testing.assert_close(gram(adjoint, tape), J @ J.T, rtol=1e-9, atol=1e-9)
    v = start(widths, seed=9)
    torch.testing.assert_close(jacobian_product(adjoint, tape, v), J @ flat(v), rtol=1e-9, atol=1e-9)
    upstream = torch.linspace(-1, 1, 12, dtype=torch.float64)
    torch.testing.assert_close(flat(gradient(parameters, tape, upstream)), J.T @ upstream, rtol=1e-9, atol=1e-9)
    product = flat(transposed_product(adjoint, tape, upstream))
    torch.testing.assert_close(product, J.T @ upstream, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("reads_value", [True, False])
def test_a_gram_matrix_of_many_tiles(reads_value):
    p, parameters = problem(2 * TILE + 15, reads_value=reads_value), start((4, 6, 5, 1))
    tape = forward(parameters, p.x, p.direction, p.a, "softplus")
    adjoint = adjoints(parameters, tape)
    K, u = gram(adjoint, tape), torch.sin(torch.arange(len(p), dtype=torch.float64))
    torch.testing.assert_close(K, K.T, rtol=1e-13, atol=1e-13)
    there_and_back = jacobian_product(adjoint, tape, transposed_product(adjoint, tape, u))
    torch.testing.assert_close(K @ u, there_and_back, rtol=1e-10, atol=1e-10)


def test_gram_of_some_layers_only():
    p, parameters = problem(10), start((4, 6, 5, 1))
    J = plain_jacobian(parameters, p, "softplus")
    first = parameters[0].numel() + parameters[1].numel()
    second = parameters[2].numel() + parameters[3].numel()
    tape = forward(parameters, p.x, p.direction, p.a, "softplus")
    part = J[:, first : first + second]
    ours = gram(adjoints(parameters, tape), tape, trainable=[False, True, False])
    torch.testing.assert_close(ours, part @ part.T, rtol=1e-9, atol=1e-9)


def test_a_forward_pass_leaves_its_inputs_alone():
    p, parameters = problem(8), start()
    before = copy.deepcopy((p, parameters))
    tape = forward(parameters, p.x, p.direction, p.a, "softplus")
    first = flat(gradient(parameters, tape, torch.ones(8, dtype=torch.float64)))
    second = flat(gradient(parameters, tape, torch.ones(8, dtype=torch.float64)))
    assert torch.equal(first, second)
    assert all(torch.equal(u, v) for u, v in zip(before[1], parameters, strict=True))
    assert torch.equal(before[0].x, p.x) and torch.equal(before[0].direction, p.direction)


@pytest.mark.parametrize("reads_value", [True, False])
@pytest.mark.parametrize("widths", WIDTHS)
@pytest.mark.parametrize("activation", ACTIVATION)
@pytest.mark.parametrize("threads", [1, 3])
def test_the_gradient_in_numpy_is_that_in_torch(threads, activation, widths, reads_value, monkeypatch):
    """In whole batches and in blocks of which the last is shorter."""
    monkeypatch.setattr("pamid.training.host.BLOCK", 9)
    parameters = start(widths)
    values, out = flat(parameters).numpy(), torch.full_like(flat(parameters), torch.nan)
    in_numpy = HostGradient(values, out.numpy(), [v.shape for v in parameters], activation, threads)
    slots = [torch.empty_like(v) for v in parameters]
    for n in (9, 5, 21, 50):
        p = problem(n, reads_value=reads_value)
        total = device_gradient(parameters, p, activation, slots)
        assert in_numpy(p) == pytest.approx(float(total), rel=1e-12)
        torch.testing.assert_close(out, flat(slots), rtol=1e-10, atol=1e-12)
    in_numpy.close()


def test_adam_on_several_threads_leaves_the_libraries_their_own():
    """The pools of numpy and torch rest within an epoch only; threads sum a batch in another order at most."""
    p, threads = problem(2100), torch.get_num_threads()
    ends = []
    try:
        for n in (1, 3):
            torch.set_num_threads(n)
            before = [pool["num_threads"] for pool in threadpool_info()]
            *_, (last, _) = Adam(max_iter=2, batch_size=2000).steps(p, start(), "softplus", np.random.RandomState(0))
            assert [pool["num_threads"] for pool in threadpool_info()] == before
            ends.append(flat(last))
    finally:
        torch.set_num_threads(threads)
    torch.testing.assert_close(ends[0], ends[1], rtol=1e-9, atol=1e-12)
