r"""A nonparametric function of the state and its recent past, for residuals that no effect explains.

It is a sum of random cosines of the state, its exponentially weighted past, the path since the last reversal and the
time, with Gaussian weights; how much of a residual it predicts for unseen runs competes with
what effects explain:

.. math:: f(s) = \sum_j a_j \cos(\omega_j^\top s + b_j), \qquad a_j \sim N(0, \tau^2)

References
----------
A. Rahimi, B. Recht, "Random features for large-scale kernel machines", Advances in Neural Information Processing
Systems 20, 2007.
"""

from dataclasses import dataclass

import numpy as np

from ...fitting.grouped_ridge import grouped_ridge
from ..residuals.protocol import ResidualSource
from .discrepancy import pasts

_COSINES = 40  # of each of two widths
_RIDGES = (0.1, 1.0, 10.0, 1e2, 1e3, 1e4)


@dataclass(frozen=True)
class Remainder:
    """What a flexible function predicts of one equation's residual on unseen runs."""

    equation: str
    """The equation."""
    predicted: np.ndarray
    """Its prediction of each window, from the other runs, in the units of the residual. Shape
    (n_windows_of_equation,)."""
    share: float
    """Share of the residual's mean square that it predicts, at least 0."""
    gain: float
    """Gain in log-likelihood on the runs held out."""


class Flexible:
    """Flexible functions on the windows of one log."""

    def __init__(self, evidence: ResidualSource) -> None:
        self.evidence = evidence
        self._bases: dict[str, np.ndarray] = {}
        self._features: np.ndarray | None = None

    def basis(self, equation: str) -> np.ndarray:
        """Return the functions at the windows of an equation, shape (n_windows, n_functions)."""
        if equation not in self._bases:
            part = self.evidence.parts[self.evidence.equations.index(equation)]
            if self._features is None:
                self._features = _features(self.evidence)
            s = self._features[part]
            s = s[:, np.ptp(s, axis=0) > 0.0]
            rng = np.random.RandomState(0)
            blocks = [np.ones((len(s), 1)), s]
            if s.shape[1]:
                for size in (0.5, 1.5):
                    # Each cosine reads a few signals: a function of all at once would need far more windows.
                    omega = rng.standard_normal((s.shape[1], _COSINES)) * size
                    reads = np.argsort(rng.random_sample(omega.shape), axis=0) < min(3, s.shape[1])
                    blocks.append(np.cos(s @ (omega * reads) + rng.uniform(0.0, 2.0 * np.pi, _COSINES)))
            self._bases[equation] = np.column_stack(blocks)
        return self._bases[equation]

    def remainder(self, equation: str, z: np.ndarray) -> Remainder:
        """Return a flexible function's prediction of residuals, from run to run."""
        part = self.evidence.parts[self.evidence.equations.index(equation)]
        B, r = self.basis(equation), z[part]
        size = max(float(np.median(np.abs(r))) / 0.6745, 1e-12)
        r = np.clip(r, -6.0 * size, 6.0 * size)
        fit = grouped_ridge(B, r, _folds(self.evidence, part), _RIDGES)
        gain = -0.5 * len(r) * float(np.log(max(1.0 - fit.share, 1e-12)))
        return Remainder(equation, fit.held_out, fit.share, gain)


def _folds(evidence: ResidualSource, part: slice) -> np.ndarray:
    """Return the fold of each window: whole runs, or stretches of time where there are too few."""
    block = evidence.block[part]
    names = np.unique(block)
    if len(names) >= 3:
        return np.searchsorted(names, block) % 6
    return (12 * np.arange(len(block)) // max(len(block), 1)) % 4


def _features(evidence: ResidualSource) -> np.ndarray:
    """Return signals between about −1 and 1 at all windows: the state, how far it is from its past, and the time."""
    found = []
    for x in evidence.state.values():
        if np.any(np.isfinite(x)):
            known = np.nan_to_num(x, nan=float(np.nanmedian(x)))
            found += [known, *pasts(known, evidence)]
    found.append(evidence.time.astype(float))
    columns = [(x - np.median(x)) / max(float(np.quantile(x, 0.95) - np.quantile(x, 0.05)), 1e-12) for x in found]
    kept = [np.clip(2.0 * c, -3.0, 3.0) for c in columns if np.ptp(c) > 0.0]
    return np.column_stack(kept) if kept else np.zeros((len(evidence.time), 0))
