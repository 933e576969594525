"""Quasi-static force by virtual work, the law of `StaticPIHM` and of every geometric force model."""

from dataclasses import dataclass
from typing import Annotated, ClassVar

from ..constants import ATMOSPHERIC_PRESSURE
from ..explained import explained_fields
from ..signals.state import State
from .base import Coefficients, Law


@explained_fields
@dataclass(frozen=True)
class QuasiStaticForce(Law):
    r"""Tension of a muscle from the virtual work of its gas.

    .. math:: F\,\mathrm{d}L = -p\,\mathrm{d}V, \quad \mathrm{d}L = -L_0\,\mathrm{d}\varepsilon
        \quad\Rightarrow\quad F = \frac{P - P_\mathrm{atm}}{L_0}\,\frac{\partial V}{\partial\varepsilon}

    with the gauge pressure :math:`p = P - P_\mathrm{atm}`.

    References
    ----------
    C.-P. Chou, B. Hannaford, "Measurement and modeling of McKibben pneumatic artificial muscles", IEEE Transactions
    on Robotics and Automation 12(1), 1996. https://doi.org/10.1109/70.481753

    Examples
    --------
    >>> from pamid.laws.quasi_static import QuasiStaticForce
    >>> from pamid.signals import State
    >>> a = QuasiStaticForce(rest_length=0.2).coefficients(State(0.1, 0.0, 301325.0, 0.0))
    >>> a.V_eps * 3e-4  # tension in N of a muscle with a slope of the volume of 3e-4 m³
    300.0
    """

    rest_length: Annotated[float, "Rest length L₀, m."]
    atmospheric_pressure: Annotated[float, "Ambient pressure, Pa, absolute."] = ATMOSPHERIC_PRESSURE

    equation: ClassVar[str] = "force"
    target: ClassVar[str] = "F"
    unit: ClassVar[str] = "N"
    slope_alone: ClassVar[bool] = True

    def coefficients(self, state: State) -> Coefficients:
        """Return (0, p/L₀, 0)."""
        zero = 0.0 * state.P
        return Coefficients(zero, (state.P - self.atmospheric_pressure) / self.rest_length, zero)
