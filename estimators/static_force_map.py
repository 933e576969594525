"""Static force of a muscle whose tube and braid are one: gas on the braid against the elasticity of the membrane."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from pamid.constants import ATMOSPHERIC_PRESSURE
from pamid.signals.state import State
from pamid.volume import FitParameter

from ._base import Signals
from ._empirical import EmpiricalForce, Values, check_positive


class StaticForceMap(EmpiricalForce):
    r"""Static force of a Festo-like muscle: virtual work of the gas less the elasticity of the membrane.

    .. math:: F = A_0\, p\, \frac{3 c^2 - t^2}{\sin^2\theta_0} - k_a\, \varepsilon
        - k_r\, (\delta - 1)\, \frac{\partial\delta}{\partial\varepsilon} + F_0, \quad
        c = (1 - \varepsilon) \cos\theta_0, \quad \delta = \frac{\sqrt{t^2 - c^2}}{\sin\theta_0}, \quad t = 1 + \kappa p

    with the gauge pressure p, the inner area A₀, the angle θ₀ of the threads to the axis, the diameter δ in units of
    that at rest, threads that stretch by κ, and a membrane that resists shortening (k_a) and widening (k_r). F₀ is what
    the clamped muscle pulls at rest. Signals: ``eps`` and ``P``.

    Parameters
    ----------
    fixed : mapping of str to float, optional
        Parameters that are held, and their values, SI units.
    atmospheric_pressure : float, default=101325
        Pa, absolute.
    max_iter : int, default=200
        Maximum number of evaluations of the model.
    signals : mapping of str to (str or int), optional
        Which column holds which signal.

    Attributes
    ----------
    parameters_ : dict of str to float
        Every parameter, fitted or held, SI units.
    standard_errors_ : dict of str to float
        Their standard errors: 0 for a held parameter, infinite for one that the data do not determine or that lies
        on a bound. With `groups`, cluster-robust.
    intervals_ : dict of str to tuple of two floats
        Their 95 % intervals.
    units_ : dict of str to str
        Their units.
    fitted_names_ : list of str
        The parameters that were fitted, in the order of `covariance_`.
    covariance_ : ndarray, shape (n_fitted, n_fitted)
        Covariance of the fitted parameters.
    at_bound_ : list of str
        Fitted parameters that lie on a bound.
    n_iter_ : int
        Evaluations used.
    signal_columns_ : dict of str to int
        Column of each signal.
    n_features_in_ : int
        Columns of X.
    feature_names_in_ : ndarray of str
        Their names, if X had names.

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

    _nonlinear = ("braid_angle", "thread_compliance")
    reads = ("eps", "P")

    def __init__(
        self,
        *,
        fixed: Mapping[str, float] | None = None,
        atmospheric_pressure: float = ATMOSPHERIC_PRESSURE,
        max_iter: int = 200,
        signals: Signals | None = None,
    ) -> None:
        self.fixed = fixed
        self.atmospheric_pressure = atmospheric_pressure
        self.max_iter = max_iter
        self.signals = signals

    def _declared(self) -> dict[str, FitParameter]:
        check_positive(self, "atmospheric_pressure")
        found = (
            FitParameter("area", "m²", 1e-7, 1.0, True, "inner cross-section A₀ at rest"),
            FitParameter("braid_angle", "rad", 0.05, 0.95, True, "angle θ₀ of the threads to the axis at rest"),
            FitParameter("thread_compliance", "1/Pa", -1e-7, 1e-6, True, "stretch κ of the threads"),
            FitParameter("axial_stiffness", "N", 0.0, np.inf, True, "resistance k_a of the membrane to shortening"),
            FitParameter("radial_stiffness", "N", 0.0, np.inf, True, "resistance k_r of the membrane to widening"),
            FitParameter("preload", "N", -np.inf, np.inf, True, "tension F₀ at rest"),
        )
        return {p.name: p for p in found}

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

    @staticmethod
    def _checked_instances() -> list[StaticForceMap]:
        return [StaticForceMap(signals={"eps": 0, "P": 0}, max_iter=20)]
