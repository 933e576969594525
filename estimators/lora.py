"""Low-rank adaptation: thin matrix products are added to the weights of the source's network."""

from collections.abc import Sequence
from typing import Any, Self

from ._adaptation import AdaptedModel
from ._parameters import parameters


@parameters
class LoRA(AdaptedModel):
    """Adapt a hybrid model by adding products of thin matrices to its weights.

    The weights of a layer become W + B A. A is drawn at random and B starts at zero, so the adaptation starts at the
    source.

    Parameters
    ----------
    ranks : tuple of int, default=(2, 4)
        Rank of the product for each layer, from the input on; 0 leaves a layer as it is. The default counts the 1,288
        parameters of the published table on the published network; the shapes in its text would be 2,312.

    References
    ----------
    E. J. Hu et al., "LoRA: low-rank adaptation of large language models", 2021.
    https://doi.org/10.48550/arXiv.2106.09685

    Examples
    --------
    >>> import numpy as np, pandas as pd
    >>> from sklearn.frozen import FrozenEstimator
    >>> from pamid.estimators import LoRA, StaticPIHM
    >>> t = np.linspace(0, 6, 200)
    >>> X = pd.DataFrame({"eps": 0.1 + 0.05 * np.sin(t), "deps": 0.05 * np.cos(t),
    ...                   "P": 3e5 + 1e5 * np.cos(3 * t), "dP": -3e5 * np.sin(3 * t)})
    >>> F = (X["P"] - 101325) * 5e-4 * (1 - 3 * X["eps"])  # N
    >>> A = StaticPIHM(0.2, 0.01, hidden_layer_sizes=(8,), max_iter=20, random_state=0).fit(X, F)
    >>> B = LoRA(FrozenEstimator(A), ranks=(4,), weight_decay=1e-6, random_state=0).fit(X[::10], 1.2 * F[::10])
    >>> bool(B.score(X, 1.2 * F) > 0.99)
    True
    """

    ranks: Sequence[int] = (2, 4)

    method = "lora"

    def _adapter(self) -> Any:
        from pamid.adapters.low_rank import LowRank

        return LowRank(tuple(self.ranks))

    @classmethod
    def _checked_instances(cls) -> list[Self]:
        return [cls._tiny(ranks=(1,), max_iter=5)]
