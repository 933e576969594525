"""Static force of a muscle whose tube and braid are one: gas on the braid against the elasticity of the membrane."""

from dataclasses import KW_ONLY
from typing import Any

import numpy as np

from pamid.signals.state import State
from pamid.volume import FitParameter

from ._empirical import EmpiricalForce, Values
from ._parameters import parameters


@parameters
class StaticForceMap(EmpiricalForce):
    r"""Static force of a Festo-like muscle: virtual work of the gas less the elasticity of the membrane.

    .. math:: F = A_0\, p\, \frac{3 c^2 - t^2}{\sin^2\theta_0} - k_a\, \varepsilon
        - k_r\, (\delta - 1)\, \frac{\partial\delta}{\partial\varepsilon} + F_0, \quad
        c = (1 - \varepsilon) \cos\theta_0, \quad \delta = \frac{\sqrt{t^2 - c^2}}{\sin\theta_0}, \quad t = 1 + \kappa p

    with the gauge pressure p, the inner area A₀, the angle θ₀ of the threads to the axis, the diameter δ in units of
    that at rest, threads that stretch by κ, and a membrane that resists shortening (k_a) and widening (k_r). F₀ is what
    the clamped muscle pulls at rest. Signals: ``eps`` and ``P``.

    See Also
    --------
    GeometricForce : The gas alone.
    NonlinearElastic : A spring without a geometry.

    Notes
    -----
    The paper's authors set up this balance for Festo muscles of 10 and 20 mm and matched their force maps within 4.4 %
    and 2.35 % at most. The elastic energies here are quadratic, our own form, since the paper was not available.

    References
    ----------
    M. Martens, I. Boblan, "Modeling the static force of a Festo pneumatic muscle actuator: a new approach and a
    comparison to existing models", Actuators 6(4), 2017. https://doi.org/10.3390/act6040033

    Examples
    --------
    >>> import numpy as np
    >>> from pamid.estimators import StaticForceMap
    >>> from pamid.volume.braided import chou_hannaford
    >>> eps, P = (a.ravel() for a in np.meshgrid(np.linspace(0.0, 0.2, 8), np.linspace(2e5, 6e5, 8)))
    >>> F = chou_hannaford(P, eps, rest_diameter=0.02, braid_angle=0.45) - 200.0 * eps
    >>> fit = StaticForceMap().fit(np.c_[eps, P], F)
    >>> round(fit.parameters_["braid_angle"], 4), round(fit.parameters_["axial_stiffness"], 1)
    (0.45, 200.0)
    """

    _: KW_ONLY
    max_iter: int = 200

    _nonlinear = ("braid_angle", "thread_compliance")
    reads = ("eps", "P")
    _checked = ({"max_iter": 20},)
    _positive = ("atmospheric_pressure",)
    _parameters = (
        FitParameter("area", "m²", 1e-7, 1.0, True, "inner cross-section A₀ at rest"),
        FitParameter("braid_angle", "rad", 0.05, 0.95, True, "angle θ₀ of the threads to the axis at rest"),
        FitParameter("thread_compliance", "1/Pa", -1e-7, 1e-6, True, "stretch κ of the threads"),
        FitParameter("axial_stiffness", "N", 0.0, np.inf, True, "resistance k_a of the membrane to shortening"),
        FitParameter("radial_stiffness", "N", 0.0, np.inf, True, "resistance k_r of the membrane to widening"),
        FitParameter("preload", "N", -np.inf, np.inf, True, "tension F₀ at rest"),
    )

    def _grid(self) -> list[dict[str, float]]:
        return [{"braid_angle": float(a), "thread_compliance": 0.0} for a in np.linspace(0.2, 0.85, 14)]

    def _force(self, values: Values, state: State) -> Any:
        p = self._gauge(state)
        sine, cosine = np.sin(values["braid_angle"]), np.cos(values["braid_angle"])
        t, c = 1.0 + values["thread_compliance"] * p, (1.0 - state.eps) * cosine
        inside = t * t - c * c
        inside = np.where(np.real(inside) > 1e-6, inside, 1e-6)  # a muscle cannot be longer than its threads
        delta, slope = np.sqrt(inside) / sine, c * cosine / (sine * np.sqrt(inside))
        gas = values["area"] * p * (3.0 * c * c - t * t) / (sine * sine)
        return (
            gas
            - values["axial_stiffness"] * state.eps
            - values["radial_stiffness"] * (delta - 1.0) * slope
            + values["preload"]
        )
