"""Full fine-tuning: all parameters of the source's network are trained on the target's data."""

from ._adaptation import AdaptedModel
from ._parameters import parameters


@parameters
class FullFineTuning(AdaptedModel):
    r"""Adapt a hybrid model by training all parameters of its network.

    It starts at the source's own volume, so a target of another size is far away at first; `QAdapter` starts at its
    size. The prior is the source: the penalty is :math:`\lambda\lVert\theta-\theta_\mathrm{source}\rVert^2`.

    References
    ----------
    G. Wang, R. Chalard, J. Cifuentes, M. Pham, "Fast adaptation of physics-informed hybrid models for pneumatic
    artificial muscles", 2025: FFT of Table 2.

    Examples
    --------
    >>> import numpy as np, pandas as pd
    >>> from sklearn.frozen import FrozenEstimator
    >>> from pamid.estimators import FullFineTuning, StaticPIHM
    >>> t = np.linspace(0, 6, 200)
    >>> X = pd.DataFrame({"eps": 0.1 + 0.05 * np.sin(t), "deps": 0.05 * np.cos(t),
    ...                   "P": 3e5 + 1e5 * np.cos(3 * t), "dP": -3e5 * np.sin(3 * t)})
    >>> F = (X["P"] - 101325) * 5e-4 * (1 - 3 * X["eps"])  # N
    >>> A = StaticPIHM(0.2, 0.01, hidden_layer_sizes=(8,), max_iter=20, random_state=0).fit(X, F)
    >>> B = FullFineTuning(FrozenEstimator(A), weight_decay=1e-6, random_state=0).fit(X[::10], 1.2 * F[::10])
    >>> bool(B.score(X, 1.2 * F) > 0.99)
    True
    """

    method = "full"
