r"""The effect of undoing sensor faults on noise: the part that is a change of scale, and the part that hides motion.

Where a fault is undone in a reading, its noise is filtered, too. A gain changes readings and noise alike,

.. math:: a = \frac{\operatorname{rms}(T y)}{\operatorname{rms}(y)}, \qquad
    s = \frac{\operatorname{rms}(T n)}{\operatorname{rms}(n)}, \qquad s = a,

and that residuals become smaller with their noise is no evidence. Undoing a lag or a resonance amplifies fast noise
more than motion, and the noise then hides what is modelled: each window costs :math:`\log(s/a)`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np

from .ports import PortEvidence
from .protocol import Active, Spec


class UndoneEvidence(PortEvidence, ABC):
    """Residuals for which sensor faults are undone in the readings, rather than applied to predictions."""

    _spreads: dict[str, tuple[np.ndarray, np.ndarray]]

    @abstractmethod
    def _amplified(self, active: Active) -> list[float]:
        """Return by how much effects amplify the measured side of each equation."""

    def spread(self, spec: Spec, x: np.ndarray) -> np.ndarray | None:
        """Return the relative width of the noise under effects that are undone in readings; None without any."""
        found = self._noise_under(spec)
        return None if found is None else found[0]

    def widening(self, spec: Spec) -> np.ndarray | None:
        """Return the growth of noise over that of motion under such effects; None without such effects."""
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
