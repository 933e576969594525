r"""Where a force at a joint acts on the whole of a mechanism: a damping coefficient of its simulator shows it.

In :math:`M(q)\,\ddot q = h(q, \dot q, u) - d\,\dot q_j\,e_j` a force at joint j accelerates every joint,

.. math:: \frac{\partial \ddot q}{\partial f_j} = M^{-1} e_j
    = -\frac{\partial \ddot q}{\partial d}\Big|_{\dot q_j = 1}

so that the coefficient that multiplies a speed, or the difference of two, gives the response to a force there without a
look into the simulator.

References
----------
R. Featherstone, "Rigid Body Dynamics Algorithms", Springer, 2008, section 3.1.
https://doi.org/10.1007/978-1-4899-7560-7
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from .base import Simulator


class Lever(NamedTuple):
    """The response of all rates to a force at a joint, or between two."""

    simulator: Simulator
    parameter: str
    """The damping coefficient."""
    velocities: tuple[str, ...]
    """The speed that it multiplies; of two their difference."""
    size: float
    """Factor on the response, 1 where the unit of the force is known."""
    unit: str
    """Unit of the force."""
    typical: float
    """Typical acceleration of the first joint by one unit of force."""

    def rates(self, t: np.ndarray, x: np.ndarray, u: np.ndarray, p: np.ndarray) -> np.ndarray:
        """Return the change of the rates by one unit of force, shape (n_states, n)."""
        speeds = dict.fromkeys(self.velocities[:1], 1.0)
        return -self.size * slope(self.simulator, self.parameter, speeds, self.velocities, (t, x, u, p))


def slope(
    simulator: Simulator, parameter: str, speeds: dict[str, float], zero: Sequence[str],
    at: tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray],
) -> np.ndarray:  # fmt: skip
    """Return the slopes of all rates over a parameter, at some speeds and with others zero."""
    t, x, u, p = at
    k, x, there = list(simulator.parameters).index(parameter), x.copy(), p.copy()
    for name in dict.fromkeys((*zero, *speeds)):
        x[simulator.states.index(name)] = speeds.get(name, 0.0)
    step = abs(simulator.numbers[k]) or 1.0
    there[k] += step
    with np.errstate(all="ignore"):
        return np.asarray((simulator.rate(t, x, u, there) - simulator.rate(t, x, u, p)) / step)
