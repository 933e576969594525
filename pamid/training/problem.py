"""A law on a data set in the network's own coordinates: what every trainer minimises."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
import torch
from torch import Tensor

from ..explained import explained_fields


@explained_fields
@dataclass(frozen=True)
class TrainingProblem:
    r"""Least squares of a law that reads a network linearly.

    .. math:: \min_\theta \frac{\sum_i w_i r_i^2}{\sum_i w_i}, \quad
        r_i = a_i N(x_i;\theta) + \partial_{d_i} N(x_i;\theta) - y_i

    Examples
    --------
    >>> import torch
    >>> from pamid.training import TrainingProblem
    >>> n = 5
    >>> x, along = torch.zeros(n, 4), torch.ones(n, 4)
    >>> problem = TrainingProblem(x, along, a=None, y=torch.ones(n), weight=torch.ones(n))
    >>> len(problem)
    5
    """

    x: Annotated[Tensor, "Inputs of the network, standardised; shape (n_samples, n_inputs)."]
    direction: Annotated[
        Tensor, "Direction of the derivative that the law reads, in the same coordinates; shape (n_samples, n_inputs)."
    ]
    a: Annotated[Tensor | None, "Factor of the network's value; None if the law never reads it; shape (n_samples,)."]
    y: Annotated[Tensor, "What the law should give, in units of its spread; shape (n_samples,)."]
    weight: Annotated[Tensor, "Sample weights, positive; shape (n_samples,)."]

    @classmethod
    def from_arrays(
        cls,
        x: np.ndarray,
        direction: np.ndarray,
        a: np.ndarray,
        y: np.ndarray,
        weight: np.ndarray | None = None,
        *,
        dtype: torch.dtype = torch.float64,
        device: str | torch.device = "cpu",
    ) -> TrainingProblem:
        """Build from numpy arrays, on a device and in a floating type; samples of zero weight are left out."""
        w = np.ones(len(y)) if weight is None else np.asarray(weight, dtype=float)
        keep = w > 0
        arrays = [np.asarray(v, dtype=float)[keep] for v in (x, direction, a, y, w)]
        tensors: list[Any] = [torch.as_tensor(np.ascontiguousarray(v), dtype=dtype, device=device) for v in arrays]
        if not np.any(arrays[2]):
            tensors[2] = None
        return cls(*tensors)

    def __len__(self) -> int:
        return int(self.y.shape[0])

    def rows(self, index: Tensor | slice) -> TrainingProblem:
        """Return the problem on some of the samples; a slice copies nothing."""
        a = None if self.a is None else self.a[index]
        return TrainingProblem(self.x[index], self.direction[index], a, self.y[index], self.weight[index])

    def split(self, held_out: Tensor) -> tuple[TrainingProblem, TrainingProblem]:
        """Split by a boolean mask into what is trained on and what is held out."""
        return self.rows(~held_out), self.rows(held_out)
