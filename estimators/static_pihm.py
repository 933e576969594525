"""Hybrid model of a muscle's force."""

from dataclasses import KW_ONLY

from ._laws import ForceLaw
from ._parameters import parameters
from ._pihm import HybridModel


@parameters
class StaticPIHM(ForceLaw, HybridModel):
    r"""Physics-informed hybrid model of the force of a muscle.

    A network learns the gas volume V(ε, ε̇, P, Ṗ); virtual work turns its slope into force,

    .. math:: F = \frac{P - P_\mathrm{atm}}{L_0}\,\frac{\partial V}{\partial\varepsilon},

    and the network is trained from this law alone: the volume itself is never measured.

    Parameters
    ----------
    rest_diameter : float, default=0.02
        Rest diameter D₀, m. Force does not determine the volume at rest; this does.

    See Also
    --------
    ThermodynamicPIHM : The same for mass flow.
    JointPIHM : One volume for both.

    Examples
    --------
    >>> import numpy as np, pandas as pd
    >>> from pamid.estimators import StaticPIHM
    >>> t = np.linspace(0, 6, 200)
    >>> X = pd.DataFrame({"eps": 0.1 + 0.05 * np.sin(t), "deps": 0.05 * np.cos(t),
    ...                   "P": 3e5 + 1e5 * np.cos(3 * t), "dP": -3e5 * np.sin(3 * t)})
    >>> F = (X["P"] - 101325) * 5e-4 * (1 - 3 * X["eps"])  # N
    >>> model = StaticPIHM(hidden_layer_sizes=(8,), max_iter=20, random_state=0).fit(X, F)
    >>> bool(model.score(X, F) > 0.99)
    True
    """

    _: KW_ONLY
    validation_fraction: float | str = 0.0
