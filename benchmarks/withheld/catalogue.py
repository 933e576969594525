"""Everything that a withheld bench can have, by name."""

from __future__ import annotations

from . import effects_foreign, effects_gas, effects_muscle, effects_sensor, effects_structure, effects_valve
from .plant import Ingredient

_MODULES = (effects_muscle, effects_gas, effects_valve, effects_sensor, effects_structure, effects_foreign)


def catalogue() -> dict[str, type[Ingredient]]:
    """Return every ingredient by the name that a key gives it."""
    found: dict[str, type[Ingredient]] = {}
    for module in _MODULES:
        for cls in vars(module).values():
            if isinstance(cls, type) and issubclass(cls, Ingredient) and "name" in vars(cls):
                found[cls.name] = cls
    return found


VOCABULARY = {name: cls.family for name, cls in catalogue().items() if cls.family != "foreign"}
"""Family of each name of the vocabulary."""

FOREIGN = tuple(name for name, cls in catalogue().items() if cls.family == "foreign")
"""Causes outside of it."""

CONFUSABLE = (
    ("coulomb_friction", "stribeck_friction"),
    ("coulomb_friction", "hysteresis"),
    ("valve_lag", "transport_delay"),
    ("viscous_friction", "force_lag"),
    ("viscous_friction", "pressure_lag"),
    ("creep", "hysteresis"),
    ("leakage", "flow_bias"),
    ("heat_transfer", "polytropic_exponent"),
    ("dead_volume", "polytropic_exponent"),
    ("gas_temperature", "heat_transfer"),
    ("valve_saturation", "supply_droop"),
    ("valve_conductance", "valve_asymmetry"),
    ("bladder_elasticity", "force_bias"),
    ("thread_extensibility", "pressure_gain"),
    ("force_gain", "diameter"),
    ("end_cap", "braid_angle"),
    ("angle_gain", "length"),
    ("angle_delay", "joint_damping"),
    ("gravity", "joint_damping"),
    ("pressure_bias", "pressure_gain"),
)
"""Pairs of the vocabulary that are known to be mistaken for each other."""
