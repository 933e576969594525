"""One volume for force and flow together."""

from typing import Any, ClassVar

import numpy as np

from pamid.laws.base import Law

from ._laws import FlowLaw, ForceLaw, flow_of, force_of
from ._parameters import parameters
from ._pihm import HybridModel


@parameters
class JointPIHM(ForceLaw, FlowLaw, HybridModel):
    r"""Hybrid model of force and mass flow that share one gas volume.

    Both laws read the same network V(ε, ε̇, P, Ṗ),

    .. math:: F = \frac{P - P_\mathrm{atm}}{L_0}\,\frac{\partial V}{\partial\varepsilon}, \qquad
        \dot m = \frac{\dot P V}{\gamma R T} + \frac{P \dot V}{R T},

    each in units of its own standard deviation. Where no volume satisfies both, one of the laws lacks something:
    compare `StaticPIHM` and `ThermodynamicPIHM` with this model to see by how much.

    Attributes
    ----------
    n_targets_ : int
        2 after a fit on force and flow, 1 after a fit on force alone.

    Notes
    -----
    The target has two columns, force (N) and flow (kg/s); NaN marks what was not measured in a row. A target of one
    column is force alone.

    Examples
    --------
    >>> import numpy as np, pandas as pd
    >>> from pamid.estimators import JointPIHM
    >>> t = np.linspace(0, 6, 200)
    >>> X = pd.DataFrame({"eps": 0.1 + 0.05 * np.sin(t), "deps": 0.05 * np.cos(t),
    ...                   "P": 3e5 + 1e5 * np.cos(3 * t), "dP": -3e5 * np.sin(3 * t)})
    >>> V, V_eps = 7e-5 * (1 + 2 * X["eps"]), 1.4e-4  # m³
    >>> F = (X["P"] - 101325) / 0.2 * V_eps  # N
    >>> mdot = X["dP"] * V / (1.4 * 287 * 293) + X["P"] * V_eps * X["deps"] / (287 * 293)  # kg/s
    >>> model = JointPIHM(hidden_layer_sizes=(8,), max_iter=20, random_state=0).fit(X, np.column_stack([F, mdot]))
    >>> model.predict(X).shape
    (200, 2)
    """

    equations = ("force", "flow")
    joint = True
    _settings: ClassVar = {"": {}}
    _checked = ({"volume_model": "neural", "hidden_layer_sizes": (6,), "max_iter": 8},)

    def laws(self) -> tuple[Law, ...]:
        """Return the laws of force and flow, of which a fit on one column keeps the force's."""
        return (force_of(self), flow_of(self))[: getattr(self, "n_targets_", 2)]

    def _measured(self, X: Any, y: Any) -> tuple[np.ndarray, np.ndarray]:
        table, target = self._read_targets(X, y, reset=True)
        self.n_targets_ = target.shape[1]
        return table, target
