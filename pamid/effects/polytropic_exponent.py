"""Another exponent of the gas than the nominal one."""

from __future__ import annotations

from ..signals.state import Array
from .base import Effect, Parameter, Signals, Step
from .plant import Plant


class PolytropicExponent(Effect):
    r"""Compression between isothermal (exponent 1) and adiabatic (1.4 for air).

    .. math:: \Delta\dot m = \frac{\dot P\,V}{R T}\left(\frac{1}{n} - \frac{1}{\gamma}\right)

    Parameters
    ----------
    **values : float
        ``exponent`` n (dimensionless).

    References
    ----------
    E. Richer, Y. Hurmuzlu, "A high performance pneumatic force actuator system: Part I, nonlinear mathematical
    model", Journal of Dynamic Systems, Measurement, and Control 122(3), 2000. https://doi.org/10.1115/1.1286336

    Examples
    --------
    >>> from pamid.effects import make_effect
    >>> make_effect("polytropic_exponent", exponent=1.2)
    polytropic_exponent(exponent=1.2)
    """

    name = "polytropic_exponent"
    family = "gas"
    equations = ("flow",)
    roles = ("position", "pressure_rate")
    source = "10.1115/1.1286336"
    parameters = (Parameter("exponent", "-", 1.0, 1.4, 1.2, "exponent of the compression"),)
    exponent: float

    def flow(self, s: Signals, x: Array, plant: Plant) -> Step:
        """Return (0, V/(R T) (1/n − 1/γ))."""
        return Step(0.0, plant.volume(s.position) / plant.RT * (1.0 / self.exponent - 1.0 / plant.heat_capacity_ratio))
