"""Mass flow into a muscle from its geometry."""

from typing import ClassVar

from pamid.signals.state import STATE_SIGNALS

from ._geometric import GeometricRegressor
from ._laws import FlowLaw
from ._parameters import parameters


@parameters
class GeometricFlow(FlowLaw, GeometricRegressor):
    r"""Mass flow into a muscle by the first law on a geometric volume model, its parameters identified.

    .. math:: \dot m = \frac{\dot P\, V(\theta)}{\gamma R T} + \frac{P}{R T}\left(
        \frac{\partial V}{\partial\varepsilon}\dot\varepsilon + \frac{\partial V}{\partial P}\dot P\right)

    θ is fitted by bounded least squares (exact Jacobian, steps scaled by it). Signals: ``eps``, ``deps``, ``P``,
    ``dP``.

    Parameters
    ----------
    rest_length : float, default=0.2
        L₀, m. The volume scales with D₀² L₀, so only one of the two can be identified; it is held by default.

    See Also
    --------
    PolynomialFlow : A polynomial in place of the geometry.
    GeometricForce : The same volume models in the force.

    References
    ----------
    E. Richer, Y. Hurmuzlu, "A high performance pneumatic force actuator system: Part I, nonlinear mathematical
    model", Journal of Dynamic Systems, Measurement, and Control 122(3), 2000. https://doi.org/10.1115/1.1286336

    Examples
    --------
    >>> import numpy as np
    >>> from pamid.estimators import GeometricFlow
    >>> from pamid.volume.braided import BraidedVolume
    >>> from pamid.volume.functions import flow
    >>> rng = np.random.default_rng(0)
    >>> eps, deps = rng.uniform(0, 0.2, 99), rng.normal(0, 0.5, 99)
    >>> P, dP = rng.uniform(2e5, 6e5, 99), rng.normal(0, 1e6, 99)
    >>> mdot = flow(BraidedVolume(0.2, 0.021, 0.45), P, dP, eps, deps)
    >>> fit = GeometricFlow(rest_length=0.2).fit(np.c_[eps, deps, P, dP], mdot)
    >>> {name: round(value, 6) for name, value in fit.parameters_.items()}
    {'rest_length': 0.2, 'rest_diameter': 0.021, 'braid_angle': 0.45}
    """

    reads = STATE_SIGNALS
    _moving: ClassVar[tuple[str, ...]] = STATE_SIGNALS
    _checked = ({}, {"model": "tondu_lopez", "max_iter": 50})
