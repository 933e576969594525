"""Force of a muscle as that of a spring whose stiffness depends on pressure and stretch."""

from dataclasses import KW_ONLY
from typing import Any

import numpy as np

from pamid.signals.state import State
from pamid.volume import FitParameter

from ._empirical import EmpiricalForce, Values
from ._parameters import parameters


@parameters
class NonlinearElastic(EmpiricalForce):
    r"""Tension of a muscle as a nonlinear spring, stretched from its fully contracted length.

    .. math:: F = K(p, s)\, s, \quad K = c_0 + c_1 s^2 + c_2\, p\, s + c_3\, p^2, \quad
        s = L_0 (\varepsilon_c - \varepsilon)

    with the gauge pressure p and the stretch s from the contraction ε_c at which the muscle no longer pulls. Signals:
    ``eps`` and ``P``.

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

    _: KW_ONLY
    rest_length: float = 0.2
    max_iter: int = 200

    _nonlinear = ("contraction",)
    reads = ("eps", "P")
    _checked = ({"max_iter": 20},)
    _parameters = (
        FitParameter("contraction", "-", 0.02, 2.0, True, "contraction at which the muscle no longer pulls"),
        FitParameter("c0", "N/m", -np.inf, np.inf, True, "stiffness without pressure"),
        FitParameter("c1", "N/m³", -np.inf, np.inf, True, "its rise with the stretch squared"),
        FitParameter("c2", "N/(Pa m²)", -np.inf, np.inf, True, "its rise with pressure times stretch"),
        FitParameter("c3", "N/(Pa² m)", -np.inf, np.inf, True, "its rise with the pressure squared"),
    )

    def _grid(self) -> list[dict[str, float]]:
        return [{"contraction": float(c)} for c in np.geomspace(0.1, 1.0, 12)]

    def _force(self, values: Values, state: State) -> Any:
        p = self._gauge(state)
        s = self.rest_length * (values["contraction"] - state.eps)
        return (values["c0"] + values["c1"] * s * s + values["c2"] * p * s + values["c3"] * p * p) * s
