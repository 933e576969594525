r"""The volume network with its directional derivative, and the gradient of both, by hand.

A law reads :math:`y = a\,V(x) + \partial_d V(x)`: the value of the network and one derivative along a direction
`d` that differs from sample to sample. Value and derivative travel through the layers side by side,

.. math:: z = W h + c,\quad \dot z = W \dot h,\qquad h' = \sigma(z),\quad \dot h' = \sigma'(z)\,\dot z,

and so do their adjoints. No second backward pass through an autograd graph is needed, and the adjoints at the layers
are all that is ever needed of the Jacobian: its products with vectors, and the Gram matrix :math:`J J^T`, which is a
sum over layers of elementwise products of small Gram matrices.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import torch
from torch import Tensor

from ..errors import UnknownOptionError

Activation = Callable[[Tensor], tuple[Tensor, Tensor, Tensor]]
"""Returns σ(z), σ'(z) and σ''(z)."""


def _softplus(z: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    s = torch.sigmoid(z)
    return torch.nn.functional.softplus(z), s, s - s * s


def _tanh(z: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    t = torch.tanh(z)
    slope = 1.0 - t * t
    return t, slope, -2.0 * t * slope


def _silu(z: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    s = torch.sigmoid(z)
    ds = s - s * s
    return z * s, s + z * ds, ds * (2.0 + z * (1.0 - 2.0 * s))


ACTIVATIONS: dict[str, Activation] = {"softplus": _softplus, "tanh": _tanh, "silu": _silu}
"""The smooth activations on offer; the law differentiates the network, so a kink would tear the prediction."""


def activation_named(name: str) -> Activation:
    """Return an activation by name.

    Raises
    ------
    UnknownOptionError
        If there is no activation of that name.
    """
    if name not in ACTIVATIONS:
        raise UnknownOptionError(
            f"activation={name!r} is not known.", f"one of {', '.join(ACTIVATIONS)}", "Choose a smooth activation."
        )
    return ACTIVATIONS[name]


Parameters = list[Tensor]
"""Weights and biases in turn, ``[W1, c1, W2, c2, ...]``; W of shape (n_out, n_in)."""


def initial_parameters(
    widths: Sequence[int], generator: np.random.RandomState, dtype: torch.dtype, device: torch.device | str = "cpu"
) -> Parameters:
    """Draw weights and biases uniformly from ±1/√n_in, as torch's own linear layers do.

    Parameters
    ----------
    widths : sequence of int
        Sizes of the layers, inputs and output included: ``(4, 128, 128, 1)``.
    generator : numpy.random.RandomState
        The only source of randomness.
    dtype : torch.dtype
        Floating type.
    device : torch.device or str
        Where the tensors live.
    """
    parameters: Parameters = []
    for n_in, n_out in pairwise(widths):
        bound = 1.0 / np.sqrt(n_in)
        drawn = [generator.uniform(-bound, bound, shape) for shape in ((n_out, n_in), (n_out,))]
        parameters += [torch.as_tensor(values, dtype=dtype, device=device) for values in drawn]
    return parameters


def value_and_derivative(
    parameters: Parameters, x: Tensor, direction: Tensor, activation: str = "softplus"
) -> tuple[Tensor, Tensor]:
    """Evaluate a network and its derivative along a direction at each sample.

    Parameters
    ----------
    parameters : list of Tensor
        Weights and biases in turn.
    x, direction : Tensor, shape (n_samples, n_inputs)
        Inputs, and the direction of the derivative at each of them.
    activation : str, default="softplus"
        Name of the activation.

    Returns
    -------
    value : Tensor, shape (n_samples,)
        The network's output, dimensionless.
    derivative : Tensor, shape (n_samples,)
        Its derivative along the direction.
    """
    act = activation_named(activation)
    h, dh = x, direction
    last = len(parameters) // 2 - 1
    for layer in range(last + 1):
        W, c = parameters[2 * layer], parameters[2 * layer + 1]
        z, dz = torch.addmm(c, h, W.T), dh @ W.T
        if layer == last:
            return z[:, 0], dz[:, 0]
        h, slope, _ = act(z)
        dh = slope * dz
    raise AssertionError("a network has at least one layer")


@dataclass
class Tape:
    """What a forward pass leaves behind for the adjoints, and the adjoints for a unit residual.

    Parameters
    ----------
    y : Tensor, shape (n_samples,)
        Prediction a V + ∂_d V.
    h, dh : list of Tensor, shape (n_samples, n_in)
        Input of each layer and its derivative along the direction.
    slope, bend : list of Tensor, shape (n_samples, n_out)
        σ'(z), and σ''(z)·ż, of each hidden layer.
    a : Tensor, shape (n_samples,)
        Factor of the value in the prediction.
    """

    y: Tensor
    h: list[Tensor]
    dh: list[Tensor]
    slope: list[Tensor]
    bend: list[Tensor]
    a: Tensor


def forward(parameters: Parameters, x: Tensor, direction: Tensor, a: Tensor, activation: str) -> Tape:
    """Predict ``a V + ∂_d V`` and keep what the adjoints need."""
    act = ACTIVATIONS[activation]
    hs, dhs, slopes, bends = [x], [direction], [], []
    n_layers = len(parameters) // 2
    h, dh = x, direction
    for layer in range(n_layers - 1):
        W, c = parameters[2 * layer], parameters[2 * layer + 1]
        z, dz = torch.addmm(c, h, W.T), dh @ W.T
        h, slope, curvature = act(z)
        dh = slope * dz
        hs.append(h)
        dhs.append(dh)
        slopes.append(slope)
        bends.append(curvature.mul_(dz))
    W, c = parameters[-2], parameters[-1]
    y = a * (h @ W[0] + c) + dh @ W[0]
    return Tape(y, hs, dhs, slopes, bends, a)


def adjoints(parameters: Parameters, tape: Tape, upstream: Tensor | None = None) -> tuple[list[Tensor], list[Tensor]]:
    """Return ∂y/∂z and ∂y/∂ż at every layer, scaled by ``upstream`` where it is given.

    Parameters
    ----------
    parameters : list of Tensor
        Weights and biases in turn.
    tape : Tape
        Of a forward pass at these parameters.
    upstream : Tensor, shape (n_samples,), optional
        Derivative of a loss with respect to y; ones by default.

    Returns
    -------
    g : list of Tensor, shape (n_samples, n_out)
        Adjoint of z at each layer, first layer first.
    dg : list of Tensor, shape (n_samples, n_out)
        Adjoint of ż at each layer.
    """
    ones = torch.ones_like(tape.y) if upstream is None else upstream
    g, dg = [(ones * tape.a)[:, None]], [ones[:, None]]
    for layer in range(len(parameters) // 2 - 1, 0, -1):
        W = parameters[2 * layer]
        gh, dgh = (g[0] * W, dg[0] * W) if W.shape[0] == 1 else (g[0] @ W, dg[0] @ W)
        slope, bend = tape.slope[layer - 1], tape.bend[layer - 1]
        g.insert(0, gh.mul_(slope).addcmul_(dgh, bend))
        dg.insert(0, dgh.mul_(slope))
    return g, dg


def gradient(parameters: Parameters, tape: Tape, upstream: Tensor) -> Parameters:
    """Return ``Jᵀ upstream``: the gradient of a loss with the given derivative with respect to y."""
    g, dg = adjoints(parameters, tape, upstream)
    out: Parameters = []
    for layer in range(len(g)):
        out.append(torch.addmm(g[layer].T @ tape.h[layer], dg[layer].T, tape.dh[layer]))
        out.append(g[layer].sum(0))
    return out


def jacobian_product(g: list[Tensor], dg: list[Tensor], tape: Tape, v: Parameters) -> Tensor:
    """Return ``J v`` for a change of the parameters, from the adjoints of unit residuals; shape (n_samples,)."""
    out = torch.zeros_like(tape.y)
    for layer in range(len(g)):
        dW, dc = v[2 * layer], v[2 * layer + 1]
        out += (g[layer] * torch.addmm(dc, tape.h[layer], dW.T)).sum(1)
        out += (dg[layer] * (tape.dh[layer] @ dW.T)).sum(1)
    return out


def gram(g: list[Tensor], dg: list[Tensor], tape: Tape, trainable: Sequence[bool] | None = None) -> Tensor:
    r"""Return the Gram matrix :math:`J J^T`, shape (n_samples, n_samples), without forming J.

    The gradient of one prediction with respect to a weight matrix is a sum of two outer products, so a layer adds

    .. math:: (g g^T) \circ (h h^T + 1) + (\dot g \dot g^T) \circ (\dot h \dot h^T) + M + M^T,
        \qquad M = (g \dot g^T) \circ (h \dot h^T).

    Parameters
    ----------
    g, dg : list of Tensor
        Adjoints of unit residuals.
    tape : Tape
        Of the same forward pass.
    trainable : sequence of bool, optional
        Which layers take part; all by default.
    """
    n = tape.y.shape[0]
    out = torch.zeros((n, n), dtype=tape.y.dtype, device=tape.y.device)
    for layer in range(len(g)):
        if trainable is not None and not trainable[layer]:
            continue
        G, dG, H, dH = g[layer], dg[layer], tape.h[layer], tape.dh[layer]
        out += (G @ G.T).mul_((H @ H.T).add_(1.0))
        out += (dG @ dG.T).mul_(dH @ dH.T)
        cross = (G @ dG.T).mul_(H @ dH.T)
        out += cross
        out += cross.T
    return out
