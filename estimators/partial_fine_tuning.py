"""Partial fine-tuning: some layers of the source's network are trained on the target's data."""

from collections.abc import Sequence
from typing import Any

from ._adaptation import AdaptedModel
from ._parameters import parameters


@parameters
class PartialFineTuning(AdaptedModel):
    """Adapt a hybrid model by training some layers of its network; the others stay as in the source.

    Parameters
    ----------
    layers : tuple of int, default=(0,)
        Layers to train, counted from 0 at the input. The published choice is the first one, 640 parameters.

    References
    ----------
    G. Wang, R. Chalard, J. Cifuentes, M. Pham, "Fast adaptation of physics-informed hybrid models for pneumatic
    artificial muscles", 2025: PFT of Table 2.

    Examples
    --------
    >>> import numpy as np, pandas as pd
    >>> from sklearn.frozen import FrozenEstimator
    >>> from pamid.estimators import PartialFineTuning, StaticPIHM
    >>> t = np.linspace(0, 6, 200)
    >>> X = pd.DataFrame({"eps": 0.1 + 0.05 * np.sin(t), "deps": 0.05 * np.cos(t),
    ...                   "P": 3e5 + 1e5 * np.cos(3 * t), "dP": -3e5 * np.sin(3 * t)})
    >>> F = (X["P"] - 101325) * 5e-4 * (1 - 3 * X["eps"])  # N
    >>> A = StaticPIHM(0.2, 0.01, hidden_layer_sizes=(8,), max_iter=20, random_state=0).fit(X, F)
    >>> B = PartialFineTuning(FrozenEstimator(A), weight_decay=1e-6, random_state=0).fit(X[::10], 1.2 * F[::10])
    >>> bool(B.score(X, 1.2 * F) > 0.99)
    True
    """

    layers: Sequence[int] = (0,)

    method = "partial"

    def _adapter(self) -> Any:
        from pamid.adapters.fine_tuning import FineTuning

        return FineTuning(tuple(self.layers))
