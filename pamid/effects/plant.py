"""The parameters of a bench that effects read."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

from ..constants import ATMOSPHERIC_PRESSURE, GAS_CONSTANT, HEAT_CAPACITY_RATIO, REFERENCE_DENSITY, TEMPERATURE
from ..errors import LackingNumberError
from ..explained import explained_fields
from ..signals.state import Array

BRAID_ANGLE = math.radians(25.0)
"""Angle between thread and axis at rest, rad, of a braid of which nothing else is known: the middle of 15° to
35°, of which each grows in diameter as a multiple of it, to within 4 % (``benchmarks/settings.py --computed``)."""


@explained_fields
@dataclass(frozen=True)
class Plant:
    r"""Numbers of a muscle, its gas, valve and joint, in SI units.

    An effect reads them to state its contribution; the volume is that of the nominal cylinder,
    :math:`V = (b^2 L - L^3)/(4\pi n^2)`.

    Examples
    --------
    >>> from pamid.bench import BenchParameters
    >>> plant = BenchParameters.for_muscle("B").plant()
    >>> print(f"{1e6 * plant.volume(0.1):.1f} cm³ at 10 % contraction, {plant.turns:.2f} turns of a thread")
    106.0 cm³ at 10 % contraction, 1.48 turns of a thread
    """

    rest_length: Annotated[float, "L₀, m."]
    thread_length: Annotated[float, "b, m."]
    turns: Annotated[float, "n, turns of a thread."]
    initial_contraction: Annotated[float, "ε₀ at joint angle 0."]
    heat_capacity_ratio: Annotated[float, "γ."]
    gas_constant: Annotated[float, "R, J/(kg K)."]
    temperature: Annotated[float, "T, K."]
    atmospheric_pressure: Annotated[float, "Pa, absolute."]
    supply_pressure: Annotated[float, "Pa, absolute."]
    sonic_conductance: Annotated[float, "C, m³/(s Pa)."]
    critical_pressure_ratio: Annotated[float, "b_c."]
    reference_density: Annotated[float, "ρ₀, kg/m³."]
    pulley_radius: Annotated[float, "r, m."]

    @classmethod
    def of_muscle(
        cls,
        rest_length: float,
        rest_diameter: float,
        braid_angle: float = BRAID_ANGLE,
        atmospheric_pressure: float = ATMOSPHERIC_PRESSURE,
        temperature: float = TEMPERATURE,
    ) -> Plant:
        """Return the numbers of a single muscle: lengths at rest (m), angle between thread and axis at rest (rad),
        pressure (Pa, absolute) and temperature (K) of the gas.

        Those of a valve and a joint, which its effects do not need, are placeholders.
        """
        thread = rest_length / math.cos(braid_angle)
        return cls(
            rest_length=rest_length,
            thread_length=thread,
            turns=thread * math.sin(braid_angle) / (math.pi * rest_diameter),
            initial_contraction=0.0,
            heat_capacity_ratio=HEAT_CAPACITY_RATIO,
            gas_constant=GAS_CONSTANT,
            temperature=temperature,
            atmospheric_pressure=atmospheric_pressure,
            supply_pressure=8e5,
            sonic_conductance=1e-8,
            critical_pressure_ratio=0.35,
            reference_density=REFERENCE_DENSITY,
            pulley_radius=1.0,
        )

    @property
    def RT(self) -> float:
        """R T, J/kg."""
        return self.gas_constant * self.temperature

    @property
    def shape(self) -> float:
        """Factor 1/(4 π n²) of the volume."""
        return 1.0 / (4.0 * math.pi * self.turns**2)

    def volume(self, eps: Array) -> Array:
        """Return V (m³) at contraction ``eps``."""
        L = self.rest_length * (1.0 - eps)
        return self.shape * L * (self.thread_length**2 - L * L)

    def volume_slope(self, eps: Array) -> Array:
        """Return ∂V/∂ε (m³) at contraction ``eps``."""
        L = self.rest_length * (1.0 - eps)
        return self.shape * self.rest_length * (3.0 * L * L - self.thread_length**2)


@explained_fields
@dataclass(frozen=True)
class Surroundings:
    """Numbers that effects may use of a system without a bench: the ambient pressure.

    A leak of gas is that of an equivalent valve orifice; of anything else it is the share that is lost each second.

    Examples
    --------
    >>> from pamid.effects.plant import Surroundings
    >>> Surroundings(101_325.0).atmospheric_pressure
    101325.0
    """

    atmospheric_pressure: Annotated[float, "Pa; 0 where pressures are gauge pressures, or no gas is stored."] = 0.0
    critical_pressure_ratio: ClassVar[float] = 0.5
    initial_contraction: ClassVar[None] = None

    @property
    def reference_density(self) -> float:
        """Density of air, kg/m³; 1 where no gas is stored."""
        return REFERENCE_DENSITY if self.atmospheric_pressure else 1.0

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        raise LackingNumberError(
            f"An effect reads {name!r}, which only a bench has.",
            "atmospheric_pressure, critical_pressure_ratio or reference_density",
            "State the effect without it.",
        )
