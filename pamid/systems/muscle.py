"""A single muscle: force, or flow, against its geometry."""

import numpy as np
import pandas as pd

from ..bench.parameters import BenchParameters
from ..constants import ATMOSPHERIC_PRESSURE, TEMPERATURE
from ..effects.plant import BRAID_ANGLE, Plant
from ..errors import MissingColumnError
from ..signals.state import STATE_ROLES
from ..simulators.problem import Problem
from .base import Input, Quantity, System, with_rates

_OWN = "rest_length", "rest_diameter", "braid_angle", "atmospheric_pressure", "temperature"


class Muscle(System):
    r"""One braided muscle under any load.

    .. math::

        F = \frac{p}{L_0}\frac{\partial V}{\partial\varepsilon}, \qquad
        \dot m = \frac{\dot P\,V}{\gamma R T} + \frac{P\,\dot V}{R T}, \qquad
        V = \frac{b^2 L - L^3}{4\pi n^2}

    The force is looked at where it is logged, else the flow.
    """

    kind = "muscle"
    title = "a single muscle: its force (or flow) against its geometry"
    law = "F = (P - atmospheric_pressure) / rest_length · ∂V/∂ε of the braided cylinder; without F: mdot = d(P V)/dt"
    targets = ("F", "mdot")
    signals = (
        Input("eps", "-", "contraction ratio (rest length - length) / rest length"),
        Input("P", "Pa, absolute", "pressure in the muscle"),
        Input("F", "N", "tension", needed=False),
        Input("mdot", "kg/s", "mass flow into the muscle", needed=False),
    )
    one_of = (("F", "mdot"),)
    quantities = (
        Quantity(
            "rest_length",
            "m",
            0.005,
            5.0,
            "length between the fittings at rest",
            hint="Lengths are in m: 200 mm is 0.2.",
        ),
        Quantity("rest_diameter", "m", 5e-4, 0.3, "diameter at rest", hint="Diameters are in m: 20 mm is 0.02."),
        Quantity(
            "braid_angle",
            "rad",
            0.02,
            0.94,
            "between thread and axis at rest",
            BRAID_ANGLE,
            hint="25 degrees is 0.436 rad.",
        ),
        Quantity("atmospheric_pressure", "Pa", 3e4, 1.2e5, "absolute", ATMOSPHERIC_PRESSURE),
        Quantity("temperature", "K", 150.0, 600.0, "of the gas", TEMPERATURE, hint="20 °C is 293 K."),
    )
    sense = 1
    library = "muscle"

    def plant(self) -> Plant:
        """Return the numbers as effects see them."""
        return Plant.of_muscle(*map(self.number, _OWN))

    def as_bench(self) -> BenchParameters:
        """Return a bench with this muscle."""
        return BenchParameters.for_muscle("B").replace(**{name: self.number(name) for name in _OWN})

    def nominal_problem(self, log: pd.DataFrame) -> Problem:
        """Return the equation of the force, or of the flow, on a log; see `System.nominal_problem`."""
        self.require(log)
        target = next((name for name in ("F", "mdot") if name in log.columns), None)
        if target is None:
            raise MissingColumnError(
                "The log has neither F nor mdot.", "the tension, or the flow into the muscle", "Map one of them."
            )
        plant = self.plant()
        X = with_rates(log, {"eps": "deps", "P": "dP"})

        def force(T: pd.DataFrame) -> np.ndarray:
            eps, P = T["eps"].to_numpy(dtype=float), T["P"].to_numpy(dtype=float)
            return (P - plant.atmospheric_pressure) / plant.rest_length * np.asarray(plant.volume_slope(eps))

        def flow(T: pd.DataFrame) -> np.ndarray:
            eps, deps, P, dP = (T[c].to_numpy(dtype=float) for c in ("eps", "deps", "P", "dP"))
            stored = dP * np.asarray(plant.volume(eps)) / (plant.heat_capacity_ratio * plant.RT)
            return stored + P * np.asarray(plant.volume_slope(eps)) * deps / plant.RT

        roles = {"time": "time", **{role: name for name, role in STATE_ROLES.items()}}
        equation, unit = ("force", "N") if target == "F" else ("flow", "kg/s")
        y, groups = log[target].to_numpy(dtype=float), log["trajectory"].to_numpy()
        return Problem(X, y, force if target == "F" else flow, groups, roles, equation, unit, plant, [], {})
