r"""The volume network with its directional derivative, and the gradient of both, by hand.

A law reads :math:`y = a\,V(x) + \partial_d V(x)`: the value of the network and one derivative along a direction
`d` that differs from sample to sample. Value and derivative travel through the layers side by side,

.. math:: z = W h + c,\quad \dot z = W \dot h,\qquad h' = \sigma(z),\quad \dot h' = \sigma'(z)\,\dot z,

and so do their adjoints. No second backward pass through an autograd graph is needed, and the adjoints at the layers
are all that is ever needed of the Jacobian: its products with vectors, and the Gram matrix :math:`J J^T`, which is a
sum over layers of elementwise products of small Gram matrices.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import torch
from torch import Tensor

from ..names import require_one_of

Activation = Callable[[Tensor, bool], tuple[Tensor, Tensor]]
"""Takes z and whether σ(z) is wanted; puts σ(z) in place of z if so; returns σ'(z) and σ''(z)."""


def _softplus(z: Tensor, wanted: bool) -> tuple[Tensor, Tensor]:
    s = torch.sigmoid(z)
    if wanted:
        # log(1 + e^z) = max(z, 0) - log(1 - σ(-|z|)): the exponential is shared with the slope, and no end overflows.
        tail = torch.minimum(s, 1.0 - s).neg_().log1p_()
        z.clamp_min_(0.0).sub_(tail)
    return s, torch.addcmul(s, s, s, value=-1.0)


def _tanh(z: Tensor, wanted: bool) -> tuple[Tensor, Tensor]:
    t = z.tanh_()
    slope = 1.0 - t * t
    return slope, (t * slope).mul_(-2.0)


def _silu(z: Tensor, wanted: bool) -> tuple[Tensor, Tensor]:
    s = torch.sigmoid(z)
    ds = torch.addcmul(s, s, s, value=-1.0)
    # z (1 - 2 s) vanishes at both ends only after the product with ds, which falls faster than z grows.
    curvature = torch.addcmul(z, z, s, value=-2.0).add_(2.0).mul_(ds)
    slope = torch.addcmul(s, z, ds)
    z.mul_(s)
    return slope, curvature


ACTIVATIONS: dict[str, Activation] = {"softplus": _softplus, "tanh": _tanh, "silu": _silu}
"""The smooth activations on offer; the law differentiates the network, so a kink would tear the prediction."""


def activation_named(name: str) -> Activation:
    """Return an activation by name."""
    require_one_of(name, ACTIVATIONS, f"activation={name!r} is not known.", "Choose a smooth activation.")
    return ACTIVATIONS[name]


Parameters = list[Tensor]
"""Weights and biases in turn, ``[W1, c1, W2, c2, ...]``; W of shape (n_out, n_in)."""


def initial_parameters(
    widths: Sequence[int], generator: np.random.RandomState, dtype: torch.dtype, device: torch.device | str = "cpu"
) -> Parameters:
    """Draw weights and biases uniformly from ±1/√n_in, as torch's own linear layers do."""
    parameters: Parameters = []
    for n_in, n_out in pairwise(widths):
        bound = 1.0 / np.sqrt(n_in)
        drawn = [generator.uniform(-bound, bound, shape) for shape in ((n_out, n_in), (n_out,))]
        parameters += [torch.as_tensor(values, dtype=dtype, device=device) for values in drawn]
    return parameters


@dataclass
class Tape:
    """Intermediate values of a forward pass for the adjoints, value and derivative in one tensor."""

    y: Tensor
    """Prediction a V + ∂_d V, shape (n_samples,)."""
    pairs: list[Tensor]
    """Input h of each layer, and its derivative ḣ along the direction. Shape (2, n_samples, n_in)."""
    slope: list[Tensor]
    bend: list[Tensor]
    """σ'(z), and σ''(z)·ż, of each hidden layer. Shape (n_samples, n_out)."""
    a: Tensor | None
    """Factor of the value in the prediction; None if the law reads the derivative alone. The last h is then left out,
    since nothing depends on it. Shape (n_samples,)."""


def forward(parameters: Parameters, x: Tensor, direction: Tensor, a: Tensor | None, activation: str) -> Tape:
    """Predict ``a V + ∂_d V`` (``∂_d V`` if `a` is None) and keep what the adjoints need."""
    act = activation_named(activation)
    n, n_hidden = x.shape[0], len(parameters) // 2 - 1
    pair = torch.stack((x, direction))
    pairs, slopes, bends = [pair], [], []
    for layer in range(n_hidden):
        W, c = parameters[2 * layer], parameters[2 * layer + 1]
        pair = (pair.view(2 * n, -1) @ W.T).view(2, n, -1)
        z, dz = pair
        slope, curvature = act(z.add_(c), a is not None or layer < n_hidden - 1)
        bends.append(curvature.mul_(dz))
        dz.mul_(slope)
        slopes.append(slope)
        pairs.append(pair)
    W, c = parameters[-2], parameters[-1]
    y = pair[1] @ W[0]
    if a is not None:
        y.addcmul_(a, torch.addmv(c, pair[0], W[0]))
    return Tape(y, pairs, slopes, bends, a)


def adjoints(parameters: Parameters, tape: Tape, upstream: Tensor | None = None) -> list[Tensor]:
    """Return ∂y/∂z and ∂y/∂ż at every layer, scaled by ``upstream`` where it is given."""
    dg = torch.ones_like(tape.y) if upstream is None else upstream
    g = torch.zeros_like(dg) if tape.a is None else dg * tape.a
    n, pair = dg.shape[0], torch.stack((g, dg))[:, :, None]
    out = [pair]
    for layer in range(len(parameters) // 2 - 1, 0, -1):
        W = parameters[2 * layer]
        # A product with a single column is an outer product.
        pair = pair * W if W.shape[0] == 1 else (pair.view(2 * n, -1) @ W).view(2, n, -1)
        slope, bend = tape.slope[layer - 1], tape.bend[layer - 1]
        pair[0].mul_(slope).addcmul_(pair[1], bend)
        pair[1].mul_(slope)
        out.append(pair)
    return out[::-1]


def gradient(parameters: Parameters, tape: Tape, upstream: Tensor, out: Parameters | None = None) -> Parameters:
    """Return ``Jᵀ upstream``: the gradient of a loss with the given derivative with respect to y."""
    total = [torch.zeros_like(p) for p in parameters] if out is None else out
    return _gathered(adjoints(parameters, tape, upstream), tape, total)


def transposed_product(adjoint: list[Tensor], tape: Tape, u: Tensor) -> Parameters:
    """Return ``Jᵀ u`` from the adjoints of unit residuals, without another pass through the network."""
    out, n = [], len(u)
    for G, H in read_by_law(adjoint, tape):  # the long side of a thin product goes along the rows
        scaled = G * u[:, None]
        g, h = scaled.view(len(G) * n, -1), H.reshape(len(H) * n, -1)
        out.append((h.T @ g).T if h.shape[1] < g.shape[1] else g.T @ h)
        out.append(scaled[0].sum(0) if len(G) == 2 else u.new_zeros(G.shape[2]))
    return out


def _gathered(adjoint: list[Tensor], tape: Tape, total: Parameters) -> Parameters:
    """Add up the gradients of all samples."""
    n = tape.y.shape[0]
    for layer, (G, H) in enumerate(zip(adjoint, tape.pairs, strict=True)):
        W, c = total[2 * layer], total[2 * layer + 1]
        g, h = G.view(2 * n, -1), H.view(2 * n, -1)
        if h.shape[1] < g.shape[1]:
            W.add_((h.T @ g).T)  # the long side of a thin product goes along the rows
        elif layer == len(tape.pairs) - 1 and tape.a is None:
            W.addmm_(G[1].T, H[1])
            continue
        else:
            W.addmm_(g.T, h)
        c.add_(G[0].sum(0))
    return total


def jacobian_product(adjoint: list[Tensor], tape: Tape, v: Parameters) -> Tensor:
    """Return ``J v`` for a change of the parameters, from the adjoints of unit residuals; shape (n_samples,)."""
    out = torch.zeros_like(tape.y)
    for layer, (G, H) in enumerate(read_by_law(adjoint, tape)):
        change = (H.reshape(-1, H.shape[2]) @ v[2 * layer].T).view_as(G)
        if len(H) == 2:
            change[0] += v[2 * layer + 1]
        out += change.mul_(G).sum((0, 2))
    return out


def gram(adjoint: list[Tensor], tape: Tape, trainable: Sequence[bool] | None = None) -> Tensor:
    r"""Return the Gram matrix :math:`J J^T`, shape (n_samples, n_samples): the sum over layers below.

    .. math:: (g g^T) \circ (h h^T + 1) + (\dot g \dot g^T) \circ (\dot h \dot h^T) + M + M^T,
        \qquad M = (g \dot g^T) \circ (h \dot h^T).
    """
    n = tape.y.shape[0]
    out = torch.zeros((n, n), dtype=tape.y.dtype, device=tape.y.device)
    for layer, (G, H) in enumerate(read_by_law(adjoint, tape)):
        if trainable is None or trainable[layer]:
            add_layer_gram(out, G, H)
    return out


THIN = 4
"""Columns up to which one side of a layer is thin: its Jacobian is then no larger than what the layer leaves anyway."""

TILE = 192
"""Rows and columns of a Gram matrix that are filled at a time, so that its factors are multiplied in the cache."""


def add_layer_gram(out: Tensor, G: Tensor, H: Tensor, *, bias: bool = True) -> None:
    """Add a layer's share of the Gram matrix, from adjoints G at its output and values H at its input."""
    if min(G.shape[2], H.shape[2]) <= THIN:
        J = _thin_jacobian(G, H, bias=bias)
        out.addmm_(J, J.T)
        return
    n = len(out)
    size = TILE if out.device.type == "cpu" else n  # a device has no use for small products
    for i in range(0, n, size):
        for j in range(0, i + 1, size):
            one, two = slice(i, i + size), slice(j, j + size)
            tile = out[one, two]
            tile.addcmul_(G[-1, one] @ G[-1, two].T, H[-1, one] @ H[-1, two].T)
            if len(H) == 2:
                inputs = H[0, one] @ H[0, two].T
                tile.addcmul_(G[0, one] @ G[0, two].T, inputs.add_(1.0) if bias else inputs)
                cross = (G[0, one] @ G[1, two].T).mul_(H[0, one] @ H[1, two].T)
                tile += cross
                tile += cross.T if i == j else (G[1, one] @ G[0, two].T).mul_(H[1, one] @ H[0, two].T)
            if i > j:
                out[two, one] = tile.T


def _thin_jacobian(G: Tensor, H: Tensor, *, bias: bool) -> Tensor:
    """Return a layer's own Jacobian, a row per sample, weights first."""
    wide, thin = (G, H) if G.shape[2] >= H.shape[2] else (H, G)
    (n, width), columns = wide.shape[1:], thin.shape[2]
    valued = len(H) == 2
    J = wide.new_empty((n, columns * width + (G.shape[2] if bias and valued else 0)))
    for k in range(columns):
        part = J[:, k * width : (k + 1) * width]
        torch.mul(wide[-1], thin[-1, :, k, None], out=part)
        if valued:
            part.addcmul_(wide[0], thin[0, :, k, None])
    if bias and valued:
        J[:, columns * width :] = G[0]
    return J


def read_by_law(adjoint: list[Tensor], tape: Tape) -> list[tuple[Tensor, Tensor]]:
    """Pair adjoints and inputs of the layers, without the last value where the law does not read it."""
    pairs = list(zip(adjoint, tape.pairs, strict=True))
    if tape.a is None:
        pairs[-1] = (pairs[-1][0][1:], pairs[-1][1][1:])
    return pairs
