"""Fixed-step Runge–Kutta of fourth order over a batch, into arrays allocated once."""

from collections.abc import Callable

import numpy as np

Rates = Callable[[np.ndarray, np.ndarray, float], None]
"""``rates(y, out, ahead)`` writes ẏ at state ``y`` into ``out``, ``ahead`` seconds after the start of the step."""


class RungeKutta4:
    """The classical fourth-order Runge–Kutta method."""

    def __init__(self, rates: Rates, shape: tuple[int, ...]) -> None:
        self.rates = rates
        self.k1 = np.empty(shape)
        self._k, self._sum, self._y = np.empty(shape), np.empty(shape), np.empty(shape)

    def first(self, y: np.ndarray) -> np.ndarray:
        """Return the rates at the start of a step, which `advance` then uses."""
        self.rates(y, self.k1, 0.0)
        return self.k1

    def advance(self, y: np.ndarray, h: float) -> None:
        """Advance ``y`` in place by ``h`` seconds; `first` has been called at ``y``."""
        k, total, stage, multiply, add = self._k, self._sum, self._y, np.multiply, np.add
        half, whole, sixth = np.array(0.5 * h), np.array(h), np.array(h / 6.0)
        multiply(self.k1, half, stage)
        add(stage, y, stage)
        self.rates(stage, k, 0.5 * h)
        add(k, k, total)
        add(total, self.k1, total)
        multiply(k, half, k)
        add(y, k, stage)
        self.rates(stage, k, 0.5 * h)
        add(total, k, total)
        add(total, k, total)
        multiply(k, whole, k)
        add(y, k, stage)
        self.rates(stage, k, h)
        add(total, k, total)
        multiply(total, sixth, total)
        add(y, total, y)
