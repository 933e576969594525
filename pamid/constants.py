"""Physical constants shared by the laws, as the study of the bench uses them (SI units)."""

ATMOSPHERIC_PRESSURE = 101_325.0
"""Standard atmosphere, Pa, absolute."""

HEAT_CAPACITY_RATIO = 1.4
"""Heat capacity ratio γ of dry air, dimensionless."""

GAS_CONSTANT = 287.0
"""Specific gas constant R of dry air, J/(kg K)."""

TEMPERATURE = 293.0
"""Gas temperature T, K."""

REFERENCE_DENSITY = 1.185
"""Density ρ₀ of air at the reference conditions of ISO 6358 (20 °C, 1 bar), kg/m³."""

GRAVITY = 9.80665
"""Standard acceleration of gravity, m/s²."""
