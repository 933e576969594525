"""The gradient of a batch on the CPU: the formulas of `network` in numpy, with buffers that are kept.

A step of a small network costs as much in calls and in fresh memory as in arithmetic. Here every operation writes into
memory that is already in the cache, each by the library that is quicker at it: most by numpy, the logistic function,
the ramp and thin products by torch.
"""

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import partial
from itertools import pairwise

import numpy as np
import torch
from threadpoolctl import ThreadpoolController

from .problem import TrainingProblem

BLOCK = 512
"""Rows that go through the network at a time, so that what one layer leaves is in the cache when the next needs it."""

Arrays = tuple[np.ndarray, np.ndarray, np.ndarray | None, np.ndarray, np.ndarray]
"""Inputs, directions, factors of the value, targets and weights of a batch."""

Activation = Callable[[np.ndarray, np.ndarray, np.ndarray, np.ndarray, bool], None]
"""Takes z, three arrays to fill with σ'(z), with σ''(z) and with anything, and whether σ(z) is wanted in place of z."""


def _sigmoid(z: np.ndarray, out: np.ndarray) -> None:
    torch.sigmoid(torch.from_numpy(z), out=torch.from_numpy(out))


def _softplus(z: np.ndarray, slope: np.ndarray, bend: np.ndarray, spare: np.ndarray, wanted: bool) -> None:
    _sigmoid(z, slope)
    np.multiply(slope, slope, out=bend)
    np.subtract(slope, bend, out=bend)
    if wanted:
        # log(1 + e^z) = max(z, 0) - log(1 - σ(-|z|)): the exponential is shared with the slope, and no end overflows.
        np.subtract(1.0, slope, out=spare)
        np.minimum(slope, spare, out=spare)
        np.negative(spare, out=spare)
        np.log1p(spare, out=spare)
        torch.from_numpy(z).clamp_min_(0.0)
        np.subtract(z, spare, out=z)


def _tanh(z: np.ndarray, slope: np.ndarray, bend: np.ndarray, spare: np.ndarray, wanted: bool) -> None:
    np.tanh(z, out=z)
    np.multiply(z, z, out=slope)
    np.subtract(1.0, slope, out=slope)
    np.multiply(z, slope, out=bend)
    np.multiply(bend, -2.0, out=bend)


def _silu(z: np.ndarray, slope: np.ndarray, bend: np.ndarray, spare: np.ndarray, wanted: bool) -> None:
    _sigmoid(z, spare)
    ds = spare - spare * spare
    np.multiply(z, ds, out=slope)
    np.add(slope, spare, out=slope)
    np.multiply(spare, -2.0, out=bend)
    np.add(bend, 1.0, out=bend)
    np.multiply(bend, z, out=bend)
    np.add(bend, 2.0, out=bend)
    np.multiply(bend, ds, out=bend)
    np.multiply(z, spare, out=z)


ACTIVATIONS: dict[str, Activation] = {"softplus": _softplus, "tanh": _tanh, "silu": _silu}


class _Buffers:
    """Memory of one pass of `m` rows; value and derivative, and their adjoints, lie side by side."""

    def __init__(self, m: int, widths: list[int], dtype: np.dtype) -> None:
        hidden = widths[1:-1]
        self.pair = [np.empty((2, m, n), dtype) for n in widths[:-1]]
        self.adjoint = [np.empty((2, m, n), dtype) for n in hidden]
        # The same memory with values above derivatives: one product serves both.
        self.rows = [p.reshape(2 * m, -1) for p in self.pair]
        self.adjoint_rows = [g.reshape(2 * m, -1) for g in self.adjoint]
        self.slope, self.bend, self.spare = ([np.empty((m, n), dtype) for n in hidden] for _ in range(3))
        self.ones = np.ones(m, dtype)


class _Share:
    """One thread's share of a batch: its own buffers, and its own sum of the gradient."""

    def __init__(self, theta: list[np.ndarray], gradient: np.ndarray, activation: str) -> None:
        self.gradient = gradient
        self._theta, self._slots = theta, cut(gradient, [p.shape for p in theta])
        self._activation = ACTIVATIONS[activation]
        self._widths = [p.shape[1] for p in theta[::2]] + [1]
        self._buffers: dict[int, _Buffers] = {}

    def run(self, rows: slice, batch: Arrays, factor: float) -> float:
        """Return the summed loss of some rows of a batch; fill `gradient` with `factor` times half its gradient."""
        x, d, a, y, w = batch
        self.gradient.fill(0.0)
        total = 0.0
        with np.errstate(all="ignore"):  # a training that leaves the numbers is told by its loss
            for i in range(rows.start, rows.stop, BLOCK):
                part = slice(i, min(i + BLOCK, rows.stop))
                residual = self._forward(x[part], d[part], None if a is None else a[part])
                residual -= y[part]
                scaled = w[part] * residual
                total += float(scaled @ residual)
                scaled *= factor
                self._backward(scaled, None if a is None else a[part])
        return total

    def _forward(self, x: np.ndarray, d: np.ndarray, a: np.ndarray | None) -> np.ndarray:
        m, last = len(x), len(self._widths) - 2
        buffers = self._buffers.get(m)
        if buffers is None:
            buffers = self._buffers[m] = _Buffers(m, self._widths, self.gradient.dtype)
        buffers.pair[0][0], buffers.pair[0][1] = x, d
        for layer in range(last):
            np.matmul(buffers.rows[layer], self._theta[2 * layer].T, out=buffers.rows[layer + 1])
            z, dz = buffers.pair[layer + 1]
            z += self._theta[2 * layer + 1]
            slope, bend = buffers.slope[layer], buffers.bend[layer]
            self._activation(z, slope, bend, buffers.spare[layer], a is not None or layer < last - 1)
            bend *= dz
            dz *= slope
        h, dh = buffers.pair[last]
        W, c = self._theta[-2][0], self._theta[-1]
        y = dh @ W
        return y if a is None else y + a * (h @ W + c)

    def _backward(self, dg: np.ndarray, a: np.ndarray | None) -> None:
        m, last = len(dg), len(self._widths) - 2
        b = self._buffers[m]
        h, dh = b.pair[last]
        self._slots[-2][0] += dg @ dh
        g = None
        if a is not None:
            g = dg * a
            self._slots[-2][0] += g @ h
            self._slots[-1] += g.sum()
        for layer in range(last - 1, -1, -1):
            W, (top, dtop) = self._theta[2 * layer + 2], b.adjoint[layer]
            slope, bend, spare = b.slope[layer], b.bend[layer], b.spare[layer]
            if layer < last - 1:
                np.matmul(b.adjoint_rows[layer + 1], W, out=b.adjoint_rows[layer])
                top *= slope
                bend *= dtop
                top += bend
                dtop *= slope
            else:
                np.multiply(dg[:, None], W, out=spare)
                np.multiply(spare, bend, out=top)
                np.multiply(spare, slope, out=dtop)
                if g is not None:
                    np.multiply(g[:, None], W, out=spare)
                    spare *= slope
                    top += spare
            rows, above, slot = b.rows[layer], b.adjoint_rows[layer], self._slots[2 * layer]
            if rows.shape[1] < above.shape[1]:  # the long side of a thin product goes along the rows
                slot += torch.mm(torch.from_numpy(rows).T, torch.from_numpy(above)).numpy().T
            else:
                slot += above.T @ rows
            self._slots[2 * layer + 1] += b.ones @ top


class HostGradient:
    """Loss and gradient of batches, for parameters that lie in one flat array."""

    def __init__(
        self, flat: np.ndarray, out: np.ndarray, shapes: Sequence[tuple[int, ...]], activation: str, threads: int = 1
    ) -> None:
        theta = cut(flat, shapes)
        # The first share adds up in place.
        sums = [out, *(np.empty_like(out) for _ in range(threads - 1))]
        self._shares = [_Share(theta, gradient, activation) for gradient in sums]
        self._controller = ThreadpoolController()
        quiet = partial(self._controller.limit, limits=1, user_api="openmp")  # which each thread sets for itself
        self._pool = ThreadPoolExecutor(threads - 1, initializer=quiet) if threads > 1 else None

    @contextmanager
    def alone(self) -> Iterator[None]:
        """Keep the thread pools of numpy and of torch at one thread each: idle threads of one would slow the other."""
        with self._controller.limit(limits=1):
            yield

    def close(self) -> None:
        """End the threads."""
        if self._pool is not None:
            self._pool.shutdown()

    def __call__(self, batch: TrainingProblem) -> float:
        """Return the summed loss of a batch; fill `out`."""
        x, d, y, w = (v.numpy() for v in (batch.x, batch.direction, batch.y, batch.weight))
        arrays = x, d, None if batch.a is None else batch.a.numpy(), y, w
        factor = 2.0 / float(w.sum())
        shares = self._shares[: max(1, len(y) // BLOCK)]
        ends = [len(y) * k // len(shares) for k in range(len(shares) + 1)]
        first, *others = (slice(*ends[k : k + 2]) for k in range(len(shares)))
        waiting = [
            self._pool.submit(share.run, rows, arrays, factor)
            for share, rows in zip(shares[1:], others, strict=True)
            if self._pool is not None
        ]
        total = shares[0].run(first, arrays, factor)
        for share, result in zip(shares[1:], waiting, strict=True):
            total += result.result()
            shares[0].gradient += share.gradient
        return total


def cut(flat: np.ndarray, shapes: Sequence[tuple[int, ...]]) -> list[np.ndarray]:
    """Cut a flat array into views of the given shapes."""
    ends = np.cumsum([0] + [int(np.prod(shape)) for shape in shapes])
    return [flat[i:j].reshape(shape) for (i, j), shape in zip(pairwise(ends), shapes, strict=True)]
