"""A pneumatic cylinder: force against pressure times area."""

import math
from collections.abc import Sequence

import numpy as np
import pandas as pd

from ..constants import ATMOSPHERIC_PRESSURE
from ..effects.spec import EffectLike
from ..simulators.problem import Problem
from .base import Choice, Input, Quantity, System

_SENSES: dict[str, str | int] = {"unknown": "auto", "delivered": 1, "imposed": -1}


class Cylinder(System):
    r"""Pneumatic cylinder with one chamber under pressure.

    .. math:: F = (P - P_\mathrm{atm})\,\frac{\pi}{4}\,(D^2 - d^2)

    What is left is the friction of its seal and guide, and the faults of its sensors.

    Examples
    --------
    >>> from pamid.systems.cylinder import Cylinder
    >>> round(1e6 * Cylinder(bore="25 mm").area, 1)
    490.9
    """

    kind = "cylinder"
    title = "a pneumatic cylinder: force against pressure times area"
    law = "F = (P - atmospheric_pressure) · π/4 · (bore² - rod²)"
    targets = ("F",)
    signals = (
        Input("x", "m", "stroke"),
        Input("P", "Pa, absolute", "pressure in the chamber"),
        Input("F", "N", "force on the rod"),
    )
    quantities = (
        Quantity("bore", "m", 1e-3, 1.0, "inner diameter", hint="Lengths are in m: 25 mm is 0.025."),
        Quantity("rod", "m", 0.0, 1.0, "diameter of the rod, if it passes through the chamber under pressure", 0.0),
        Quantity("atmospheric_pressure", "Pa", 3e4, 1.2e5, "absolute", ATMOSPHERIC_PRESSURE),
    )

    choices = (
        Choice(
            "force",
            tuple(_SENSES),
            "what F measures: the force that the cylinder delivers, or one imposed on its rod",
            "unknown",
        ),
    )

    estimator = "CylinderForce"

    @property
    def sense(self) -> str | int:  # type: ignore[override]
        """Whether friction takes away from F or adds to it."""
        return _SENSES[str(self.values["force"])]

    @property
    def units(self) -> dict[str, str]:
        """Newton, metre, pascal."""
        return {"target": "N", "position": "m", "pressure": "Pa"}

    def corrected(self, effects: Sequence[EffectLike], sense: int, unit: str) -> System:
        """Return the cylinder with further effects, and the meaning of F for them."""
        word = next(word for word, way in _SENSES.items() if way == sense)
        return super().corrected(effects, sense, unit).with_({"force": word})

    @property
    def area(self) -> float:
        """Area under pressure, m²."""
        return math.pi / 4 * (self.number("bore") ** 2 - self.number("rod") ** 2)

    def nominal_problem(self, log: pd.DataFrame) -> Problem:
        """Return the force equation on a log; see `System.nominal_problem`."""
        self.require(log)
        ambient, area = self.number("atmospheric_pressure"), self.area

        def nominal(X: pd.DataFrame) -> np.ndarray:
            return (X["P"].to_numpy(dtype=float) - ambient) * area

        roles = {"time": "time", "position": "x", "pressure": "P"}
        X, y = log[["time", "x", "P"]], log["F"].to_numpy(dtype=float)
        return Problem(X, y, nominal, log["trajectory"].to_numpy(), roles, "force", "N", None, [], self.units)
