"""Gas at another temperature than the nominal one."""

from __future__ import annotations

from collections.abc import Mapping

from .base import Effect, Parameter


class GasTemperature(Effect):
    r"""Gas warmer or colder than the simulator holds: T → T + ΔT in the flow equation.

    Parameters
    ----------
    **values : float
        ``difference`` ΔT (K).

    References
    ----------
    E. Richer, Y. Hurmuzlu, "A high performance pneumatic force actuator system: Part I, nonlinear mathematical
    model", Journal of Dynamic Systems, Measurement, and Control 122(3), 2000. https://doi.org/10.1115/1.1286336
    """

    name = "gas_temperature"
    family = "gas"
    equations = ("flow",)
    source = "10.1115/1.1286336"
    parameters = (Parameter("difference", "K", -80.0, 80.0, 10.0, "temperature above the nominal one"),)
    difference: float

    def adjust(self, values: Mapping[str, float]) -> dict[str, float]:
        """Return the changed temperature."""
        return {"temperature": values["temperature"] + self.difference}
