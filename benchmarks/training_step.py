"""What a training step costs: derivatives by hand against a second backward pass through autograd.

Both take Algorithm 1's step (gradient of the mean squared residual of a law, weight decay in the gradient, Adam) on the
same network, data, batch size and floating type. The other one is written as usual: a module, ``torch.autograd.grad``
with ``create_graph=True`` for the slope of the volume, ``backward``, ``torch.optim.Adam``. Epochs alternate within one
run; the ratio is the median over pairs of neighbouring epochs. Beside it stands what neither can go below with torch's
products: the six products of (rows x width) with (width x width) matrices that value, slope and adjoints take.

Run with ``python benchmarks/training_step.py``; takes about a minute on two cores.
"""

from __future__ import annotations

import argparse
import time

import numpy as np
import torch
from threadpoolctl import threadpool_limits
from torch import nn

from pamid.training import Adam, Problem

WIDTH = 128
ROWS = 16_384
"""Samples of an epoch."""


def problem(law: str, rows: int, dtype: torch.dtype) -> Problem:
    """Draw a batch; the force reads one slope of the network, the flow its value and two slopes."""
    rng = np.random.default_rng(0)
    direction = np.zeros((rows, 4))
    direction[:, 0] = rng.uniform(0.5, 1.5, rows)
    direction[:, 2] = rng.normal(size=rows) * (law == "flow")
    a = rng.normal(size=rows) * (law == "flow")
    return Problem.from_arrays(rng.normal(size=(rows, 4)), direction, a, rng.normal(size=rows), dtype=dtype)


def network(dtype: torch.dtype) -> nn.Module:
    torch.manual_seed(0)
    layers = [nn.Linear(4, WIDTH), nn.Softplus(), nn.Linear(WIDTH, WIDTH), nn.Softplus(), nn.Linear(WIDTH, 1)]
    return nn.Sequential(*layers).to(dtype)


class SecondBackward:
    """Epochs as a physics-informed network is usually trained."""

    def __init__(self, data: Problem, rows: int, dtype: torch.dtype) -> None:
        self.data, self.rows, self.net = data, rows, network(dtype)
        self.optimizer = torch.optim.Adam(self.net.parameters(), lr=1e-4, weight_decay=1e-5)

    def epoch(self) -> float:
        """Visit every batch once and return the mean loss."""
        drawn = self.data.rows(torch.randperm(len(self.data)))
        total = torch.zeros((), dtype=drawn.y.dtype)
        for start in range(0, len(drawn), self.rows):
            p = drawn.rows(slice(start, start + self.rows))
            self.optimizer.zero_grad()
            x = p.x.requires_grad_(True)
            V = self.net(x)[:, 0]
            (slope,) = torch.autograd.grad(V.sum(), x, create_graph=True)
            y = p.direction[:, 0] * slope[:, 0]
            if p.a is not None:
                y = y + p.direction[:, 2] * slope[:, 2] + p.a * V
            loss = ((y - p.y) ** 2).mean()
            loss.backward()
            self.optimizer.step()
            total += loss.detach()
        return float(total) / (ROWS // self.rows)


class ByHand:
    """The same epochs of `pamid.training.Adam`."""

    def __init__(self, data: Problem, rows: int, dtype: torch.dtype) -> None:
        start = [p.detach().clone() for p in network(dtype).parameters()]
        trainer = Adam(max_iter=10**9, batch_size=rows)
        self.epochs = trainer.steps(data, start, "softplus", np.random.RandomState(0))

    def epoch(self) -> float:
        """Visit every batch once and return the mean loss."""
        return next(self.epochs)[1]


class Products:
    """The six matrix products of each step alone, on blocks that stay in the cache."""

    def __init__(self, data: Problem, rows: int, dtype: torch.dtype) -> None:
        block = min(rows, 256)
        self.times = len(data) // block
        self.A, self.W = torch.randn(2 * block, WIDTH, dtype=dtype), torch.randn(WIDTH, WIDTH, dtype=dtype)

    def epoch(self) -> float:
        """Multiply as often as an epoch does."""
        for _ in range(self.times):
            _ = self.A @ self.W.T, self.A @ self.W, self.A.T @ self.A
        return 0.0


def measure(law: str, rows: int, dtype: torch.dtype, seconds: float) -> tuple[np.ndarray, float]:
    """Return the times a step (n_epochs, 3) and the gap in the first loss, where both nets are still the same."""
    data = problem(law, ROWS, dtype)
    contestants = [kind(data, rows, dtype) for kind in (SecondBackward, ByHand, Products)]
    times, losses, warm_up = [], [], 3
    end = time.perf_counter() + seconds
    while time.perf_counter() < end or len(times) < 3 * warm_up:
        row = []
        for contestant in contestants:
            start = time.perf_counter()
            losses.append(contestant.epoch())
            row.append((time.perf_counter() - start) / (ROWS // rows))
        times.append(row)
    return np.array(times[warm_up:]), abs(losses[1] / losses[0] - 1.0)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=3.0, help="time of each line (default: 3)")
    parser.add_argument("--threads", type=int, nargs="+", default=[1, 2], help="numbers of threads (default: 1 2)")
    args = parser.parse_args()
    print(f"one step, 4-{WIDTH}-{WIDTH}-1 softplus, medians; 'gap' is that of the mean losses of the first epoch")
    print("law    dtype    batch  threads  autograd / us  by hand / us  products / us   ratio  floor   epochs    gap")
    for threads in args.threads:
        torch.set_num_threads(threads)
        threadpool_limits(threads)  # of numpy's products
        for law in ("force", "flow"):
            for dtype in (torch.float32, torch.float64):
                for rows in (128, 2048):
                    times, gap = measure(law, rows, dtype, args.seconds)
                    usual, ours, products = np.median(times, axis=0) * 1e6
                    ratio, floor = np.median(times[:, 1:] / times[:, :1], axis=0)
                    print(
                        f"{law:6s} {str(dtype)[6:]:8s} {rows:5d} {threads:8d} {usual:14.0f} {ours:13.0f} "
                        f"{products:14.0f} {ratio:7.2f} {floor:6.2f} {len(times):8d} {gap:7.0e}",
                        flush=True,
                    )


if __name__ == "__main__":
    main()
