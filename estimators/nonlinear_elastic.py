"""Force of a muscle as that of a spring whose stiffness depends on pressure and stretch."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from pamid.constants import ATMOSPHERIC_PRESSURE
from pamid.signals.state import State
from pamid.volume import FitParameter

from ._base import Signals
from ._empirical import EmpiricalForce, Values, check_positive


class NonlinearElastic(EmpiricalForce):
    r"""Tension of a muscle as a nonlinear spring, stretched from its fully contracted length.

    .. math:: F = K(p, s)\, s, \quad K = c_0 + c_1 s^2 + c_2\, p\, s + c_3\, p^2, \quad
        s = L_0 (\varepsilon_c - \varepsilon)

    with the gauge pressure p and the stretch s from the contraction ε_c at which the muscle no longer pulls. Signals:
    ``eps`` and ``P``.

    Parameters
    ----------
    rest_length : float, default=0.2
        L₀, m.
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
    StaticForceMap : A force with a geometry behind it.

    Notes
    -----
    The stiffness is taken from later papers; the original was not available. The form has no physical basis: the
    force at zero gauge pressure is what the rubber gives, and it need not rise with the pressure outside the data.

    References
    ----------
    K. C. Wickramatunge, T. Leephakpreeda, "Study on mechanical behaviors of pneumatic artificial muscle",
    International Journal of Engineering Science 48(2), 2010. https://doi.org/10.1016/j.ijengsci.2009.08.001

    Examples
    --------
    >>> import numpy as np
    >>> from pamid.estimators import NonlinearElastic
    >>> eps, P = (a.ravel() for a in np.meshgrid(np.linspace(0.0, 0.2, 8), np.linspace(2e5, 6e5, 8)))
    >>> s, p = 0.2 * (0.3 - eps), P - 101325
    >>> fit = NonlinearElastic(rest_length=0.2).fit(np.c_[eps, P], (500 + 2e6 * s**2 + 0.4 * p * s) * s)
    >>> round(fit.parameters_["contraction"], 6), round(fit.parameters_["c0"], 3), fit.units_["c0"]
    (0.3, 500.0, 'N/m')
    """

    _nonlinear = ("contraction",)
    reads = ("eps", "P")

    def __init__(
        self,
        *,
        rest_length: float = 0.2,
        fixed: Mapping[str, float] | None = None,
        atmospheric_pressure: float = ATMOSPHERIC_PRESSURE,
        max_iter: int = 200,
        signals: Signals | None = None,
    ) -> None:
        self.rest_length = rest_length
        self.fixed = fixed
        self.atmospheric_pressure = atmospheric_pressure
        self.max_iter = max_iter
        self.signals = signals

    def _declared(self) -> dict[str, FitParameter]:
        check_positive(self, "rest_length")
        inf = np.inf
        found = (
            FitParameter("contraction", "-", 0.02, 2.0, True, "contraction at which the muscle no longer pulls"),
            FitParameter("c0", "N/m", -inf, inf, True, "stiffness without pressure"),
            FitParameter("c1", "N/m³", -inf, inf, True, "its rise with the stretch squared"),
            FitParameter("c2", "N/(Pa m²)", -inf, inf, True, "its rise with pressure times stretch"),
            FitParameter("c3", "N/(Pa² m)", -inf, inf, True, "its rise with the pressure squared"),
        )
        return {p.name: p for p in found}

    def _grid(self) -> list[dict[str, float]]:
        return [{"contraction": float(c)} for c in np.geomspace(0.1, 1.0, 12)]

    def _force(self, values: Values, state: State) -> Any:
        p = self._gauge(state)
        s = self.rest_length * (values["contraction"] - state.eps)
        return (values["c0"] + values["c1"] * s * s + values["c2"] * p * s + values["c3"] * p * p) * s

    @staticmethod
    def _checked_instances() -> list[NonlinearElastic]:
        return [NonlinearElastic(signals={"eps": 0, "P": 0}, max_iter=20)]
