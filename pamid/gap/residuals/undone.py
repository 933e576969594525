r"""What undoing the faults of sensors does to noise: how much of it is a change of scale, and how much hides motion.

Where a fault is undone in what a sensor read, noise is undone with it. A gain changes readings and noise alike,

.. math:: a = \frac{\operatorname{rms}(T y)}{\operatorname{rms}(y)}, \qquad
    s = \frac{\operatorname{rms}(T n)}{\operatorname{rms}(n)}, \qquad s = a,

and that residuals become smaller with their noise is no evidence. A lag or a resonance lets fast noise grow by more
than the motion does, and the noise then hides what is modelled: each window costs :math:`\log(s/a)`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np

from .ports import Active, PortEvidence
from .protocol import Spec


class UndoneEvidence(PortEvidence, ABC):
    """Residuals for which faults of sensors are undone in what they read, rather than put on what is predicted."""

    _spreads: dict[str, tuple[np.ndarray, np.ndarray]]

    @abstractmethod
    def _amplified(self, active: Active) -> list[float]:
        """Return by how much effects let what was measured in each equation grow."""

    def spread(self, spec: Spec, x: np.ndarray) -> np.ndarray | None:
        """Return how wide the noise is under effects that are undone in readings, as a share; None without such."""
        found = self._noise_under(spec)
        return None if found is None else found[0]

    def widening(self, spec: Spec) -> np.ndarray | None:
        """Return by how much more noise than motion grows under such effects, which costs; None without such."""
        found = self._noise_under(spec)
        return None if found is None else found[1]

    def _noise_under(self, spec: Spec) -> tuple[np.ndarray, np.ndarray] | None:
        places, states = self.placements, self.simulator.states
        undone = {k: v for k, v in spec.items() if places[k].enters == "output" and places[k].at in states}
        if not undone:
            return None
        key = repr({k: dict(v) for k, v in undone.items()})
        if key not in self._spreads:
            active, numbers = self.active(undone), self.simulator.numbers
            changed = self._residual(active, numbers, self._noisy_copy) - self._residual(active, numbers)
            scale, grown = np.ones(len(self.value)), np.ones(len(self.value))
            for part, a in zip(self.parts, self._amplified(active), strict=True):
                usual, new = (float(np.sqrt(np.mean(np.square(d[part])))) for d in (self._drawn[-1], changed))
                if usual > 0.0 and new > 0.0:
                    scale[part] = min(a, new / usual)
                    grown[part] = max(1.0, new / usual / a)
            self._spreads[key] = scale, grown
        return self._spreads[key]
