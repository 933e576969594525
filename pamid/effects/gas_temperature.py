"""Gas at another temperature than the nominal one."""

from __future__ import annotations

import math
from collections.abc import Mapping

from .base import Effect
from .values import Parameter


class GasTemperature(Effect):
    r"""Gas warmer or colder than in the simulator: T → T + ΔT in the flow equation.

    .. math:: T' = T + \Delta T, \qquad C' = C\,\Big(1 - \sigma + \sigma\sqrt{T / T'}\Big)

    With σ = 1 the supplied gas has that temperature as well, and less of it passes the valve (ISO 6358).

    Parameters
    ----------
    **values : float
        ``difference`` ΔT (K), ``supplied`` σ (dimensionless).
    """

    name = "gas_temperature"
    family = "gas"
    equations = ("flow", "valve")
    source = "10.1115/1.1286336"
    parameters = (
        Parameter("difference", "K", -80.0, 80.0, 10.0, "temperature above the nominal one", linear=True),
        Parameter("supplied", "-", 0.0, 1.0, 0.0, "share of it that the supplied gas has as well"),
    )
    difference: float
    supplied: float

    def adjust(self, values: Mapping[str, float]) -> dict[str, float]:
        """Return the changed temperature and, for the supplied gas, conductance."""
        T = values["temperature"]
        passed = 1.0 - self.supplied + self.supplied * math.sqrt(T / (T + self.difference))
        return {"temperature": T + self.difference, "sonic_conductance": values["sonic_conductance"] * passed}
