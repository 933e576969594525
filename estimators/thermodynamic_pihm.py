"""Hybrid model of the gas flow into a muscle."""

from ._laws import FlowLaw
from ._parameters import parameters
from ._pihm import HybridModel


@parameters
class ThermodynamicPIHM(FlowLaw, HybridModel):
    r"""Physics-informed hybrid model of the mass flow into a muscle.

    A network learns the gas volume V(ε, ε̇, P, Ṗ); the first law of thermodynamics turns it and its rate into flow,

    .. math:: \dot m = \frac{\dot P V}{\gamma R T} + \frac{P \dot V}{R T}, \qquad
        \dot V = \frac{\partial V}{\partial\varepsilon}\dot\varepsilon + \frac{\partial V}{\partial P}\dot P,

    and the network is trained from this law alone: the volume itself is never measured.

    Parameters
    ----------
    rest_diameter : float, default=0.02
        Rest diameter D₀, m; with the length, where the search for the geometric volume starts.

    See Also
    --------
    StaticPIHM : The same for force.
    JointPIHM : One volume for both.

    Examples
    --------
    >>> import numpy as np, pandas as pd
    >>> from pamid.estimators import ThermodynamicPIHM
    >>> t = np.linspace(0, 6, 200)
    >>> X = pd.DataFrame({"eps": 0.1 + 0.05 * np.sin(t), "deps": 0.05 * np.cos(t),
    ...                   "P": 3e5 + 1e5 * np.cos(3 * t), "dP": -3e5 * np.sin(3 * t)})
    >>> V, dV = 7e-5 * (1 + 2 * X["eps"]), 1.4e-4 * X["deps"]  # m³, m³/s
    >>> mdot = X["dP"] * V / (1.4 * 287 * 293) + X["P"] * dV / (287 * 293)  # kg/s
    >>> model = ThermodynamicPIHM(hidden_layer_sizes=(8,), max_iter=20, random_state=0).fit(X, mdot)
    >>> bool(model.score(X, mdot) > 0.99)
    True
    """
