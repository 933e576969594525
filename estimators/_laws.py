"""The laws that read a volume, as parts of an estimator: their constants are its parameters."""

from __future__ import annotations

from dataclasses import KW_ONLY
from typing import Any, ClassVar

from pamid.constants import ATMOSPHERIC_PRESSURE, GAS_CONSTANT, HEAT_CAPACITY_RATIO, TEMPERATURE
from pamid.laws.base import Law
from pamid.laws.quasi_static import QuasiStaticForce
from pamid.laws.thermodynamic import ThermodynamicFlow

from ._parameters import parameters


def force_of(estimator: Any) -> QuasiStaticForce:
    """Return the force (N) by virtual work, for the numbers of an estimator."""
    return QuasiStaticForce(estimator.rest_length, estimator.atmospheric_pressure)


def flow_of(estimator: Any) -> ThermodynamicFlow:
    """Return the mass flow (kg/s) by the first law, for the numbers of an estimator."""
    return ThermodynamicFlow(estimator.heat_capacity_ratio, estimator.gas_constant, estimator.temperature)


@parameters
class ForceLaw:
    """Reads the volume by virtual work; goes left of the volume model."""

    _: KW_ONLY
    atmospheric_pressure: float = ATMOSPHERIC_PRESSURE

    equations: ClassVar[tuple[str, ...]] = ("force",)

    def laws(self) -> tuple[Law, ...]:
        """Return the quasi-static law of the force.

        Returns
        -------
        tuple of Law
            One law, of force (N).
        """
        return (force_of(self),)


@parameters
class FlowLaw:
    """Reads the volume by the first law of thermodynamics; goes left of the volume model.

    Parameters
    ----------
    heat_capacity_ratio : float
        γ, dimensionless; 1 is an isothermal muscle.
    gas_constant : float
        R, J/(kg K).
    temperature : float
        T, K.
    """

    _: KW_ONLY
    heat_capacity_ratio: float = HEAT_CAPACITY_RATIO
    gas_constant: float = GAS_CONSTANT
    temperature: float = TEMPERATURE

    equations: ClassVar[tuple[str, ...]] = ("flow",)

    def laws(self) -> tuple[Law, ...]:
        """Return the law of the flow.

        Returns
        -------
        tuple of Law
            One law, of flow (kg/s).
        """
        return (flow_of(self),)
