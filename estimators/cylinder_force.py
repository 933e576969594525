"""Force of a pneumatic cylinder: pressure times area, and the friction of its seal."""

import math
from dataclasses import KW_ONLY
from typing import Any, NamedTuple

from pamid.constants import ATMOSPHERIC_PRESSURE

from ._linear import BalanceRegressor
from ._parameters import parameters


class _RodSignals(NamedTuple):
    dx: Any
    P: Any


@parameters
class CylinderForce(BalanceRegressor):
    r"""Force on the rod of a pneumatic cylinder, its area and its friction fitted by linear least squares.

    .. math:: F = A\,p + b + (f_0 + f_1\,p)\,\tanh\frac{\dot x}{v_0} + c\,\dot x, \qquad p = P - P_\mathrm{atm}

    Friction adds to a force that moves the rod and subtracts from one that it delivers: the fit finds the sign.
    Signals: ``dx`` and ``P``.

    Parameters
    ----------
    rod : float, default=0
        Diameter of a rod that passes through the chamber under pressure, m; `bore_` allows for it.
    still : float, default=1e-4
        Speed v₀, m/s, at which dry friction has reached three quarters.

    Attributes
    ----------
    coef_ : ndarray, shape (5,)
        The parameters, SI units.
    parameters_ : dict of str to float
        ``area`` A (m²), ``offset`` b (N), ``dry_friction`` f₀ (N), ``pressure_friction`` f₁ (N/Pa),
        ``viscous_friction`` c (N s/m).

    See Also
    --------
    JointDrive : The same for a driven joint.

    References
    ----------
    X. B. Tran, H. Yanada, "Dynamic friction behaviors of pneumatic cylinders", Intelligent Control and Automation 4(2),
    2013. https://doi.org/10.4236/ica.2013.42022

    Examples
    --------
    >>> import numpy as np
    >>> from pamid.estimators import CylinderForce
    >>> rng = np.random.default_rng(0)
    >>> dx, P = rng.normal(0, 0.02, 500), rng.uniform(2e5, 6e5, 500)
    >>> F = np.pi / 4 * 0.025**2 * (P - 101_325) + 8 * np.tanh(dx / 1e-4)
    >>> fit = CylinderForce().fit(np.c_[dx, P], F)
    >>> round(fit.bore_, 6), round(fit.parameters_["dry_friction"], 3)
    (0.025, 8.0)
    """

    rod: float = 0.0
    still: float = 1e-4
    _: KW_ONLY
    atmospheric_pressure: float = ATMOSPHERIC_PRESSURE

    reads = ("dx", "P")
    equations = ("cylinder",)
    _state = _RodSignals
    _checked = ({},)

    @property
    def bore_(self) -> float:
        """Inner diameter, m, that belongs to the area; NaN if there is none."""
        square = 4.0 / math.pi * float(self.parameters_["area"]) + self.rod**2
        return math.sqrt(square) if square > 0 else math.nan

    def _output(self) -> tuple[str, str]:
        return "force", "N"

    def _terms(self) -> dict[str, str]:
        return {
            "area": "m²", "offset": "N", "dry_friction": "N", "pressure_friction": "N/Pa", "viscous_friction": "N s/m",
        }  # fmt: skip

    def _shares(self, state: _RodSignals) -> list[Any]:
        p, way = state.P - self.atmospheric_pressure, self._way(state.dx)
        return [p, 1.0 + 0.0 * p, way, way * p, state.dx]
