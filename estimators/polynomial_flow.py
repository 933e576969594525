"""Mass flow into a muscle whose volume is a polynomial."""

from typing import ClassVar

from pamid.signals.state import STATE_SIGNALS, State
from pamid.volume import VolumeJet

from ._laws import FlowLaw
from ._linear import PolynomialRegressor, require_degree
from ._parameters import parameters


@parameters
class PolynomialFlow(FlowLaw, PolynomialRegressor):
    r"""Mass flow into a muscle by the first law on a polynomial volume, fitted by linear least squares.

    .. math:: V = \sum_{i=0}^{d} \sum_{j=0}^{e} v_{ij}\, \varepsilon^i P^j, \qquad
        \dot m = \frac{\dot P V}{\gamma R T} + \frac{P}{R T}\left(
        \frac{\partial V}{\partial\varepsilon}\dot\varepsilon + \frac{\partial V}{\partial P}\dot P\right)

    The flow is linear in the coefficients. With e = 0 this is the polynomial volume of Itto and Kogiso (d = 2) and
    of Hošovský and coworkers (d = 3). Signals: ``eps``, ``deps``, ``P``, ``dP``.

    Parameters
    ----------
    degree : int, default=3
        Degree d in the contraction.
    pressure_degree : int, default=0
        Degree e in the absolute pressure.

    Attributes
    ----------
    parameters_ : dict of str to float
        The coefficients by name: ``"v20"`` multiplies ε².

    See Also
    --------
    GeometricFlow : Fewer parameters, each with a meaning.
    PolynomialForce : A polynomial area in the force.

    References
    ----------
    T. Itto, K. Kogiso, "Hybrid modeling of McKibben pneumatic artificial muscle systems", IEEE International
    Conference on Industrial Technology, 2011.

    A. Hošovský, J. Piteľ, K. Židek, "Enhanced dynamic model of pneumatic muscle actuator with Elman neural network",
    Abstract and Applied Analysis, 2015. https://doi.org/10.1155/2015/906126

    Examples
    --------
    >>> import numpy as np
    >>> from pamid.estimators import PolynomialFlow
    >>> from pamid.volume.functions import flow
    >>> from pamid.volume.polynomial import PolynomialVolume
    >>> rng = np.random.default_rng(0)
    >>> eps, deps = rng.uniform(0, 0.2, 99), rng.normal(0, 0.5, 99)
    >>> P, dP = rng.uniform(2e5, 6e5, 99), rng.normal(0, 1e6, 99)
    >>> mdot = flow(PolynomialVolume(0.2, (6e-5, 5e-4, -9e-4)), P, dP, eps, deps)
    >>> fit = PolynomialFlow(degree=2).fit(np.c_[eps, deps, P, dP], mdot)
    >>> {name: round(value, 9) for name, value in fit.parameters_.items()}
    {'v00': 6e-05, 'v10': 0.0005, 'v20': -0.0009}
    """

    degree: int = 3
    pressure_degree: int = 0

    reads = STATE_SIGNALS
    _settings: ClassVar = {"contraction": {}, "contraction, pressure": {"pressure_degree": 1}}
    _checked = ({"degree": 2}, {"degree": 1, "pressure_degree": 1})

    def _powers(self) -> list[tuple[int, int]]:
        d = require_degree("degree", self.degree, 0)
        e = require_degree("pressure_degree", self.pressure_degree, 0)
        return [(i, j) for j in range(e + 1) for i in range(d + 1)]

    def _terms(self) -> dict[str, str]:
        units = {0: "m³", 1: "m³/Pa"}
        return {f"v{i}{j}" if i < 10 > j else f"v{i}_{j}": units.get(j, f"m³/Pa^{j}") for i, j in self._powers()}

    def _basis(self, state: State) -> list[VolumeJet]:
        eps, P = state.eps, state.P
        return [
            VolumeJet(eps**i * P**j, i * eps ** max(i - 1, 0) * P**j, j * eps**i * P ** max(j - 1, 0))
            for i, j in self._powers()
        ]
