"""A spring that stiffens or softens with its travel."""

from __future__ import annotations

from ..signals.state import Array
from .base import Effect, Signals
from .plant import Plant
from .values import Parameter


class NonlinearStiffness(Effect):
    r"""Restoring force beyond Hooke's law, as in a Duffing oscillator.

    .. math:: \Delta F = -k_2\,x^2 - k_3\,x^3

    Parameters
    ----------
    **values : float
        ``square`` k₂ (N/m²), ``cubic`` k₃ (N/m³) for a travel in m.

    References
    ----------
    T. Wigren, J. Schoukens, "Three free data sets for development and benchmarking in nonlinear system
    identification", European Control Conference, 2013. https://doi.org/10.23919/ECC.2013.6669201
    """

    name = "nonlinear_stiffness"
    family = "elasticity"
    equations = ("force", "joint")
    roles = ("position",)
    kinds = ("joint", "motor")
    prior = -2.0  # a polynomial: what has a form of its own goes first
    source = "10.23919/ECC.2013.6669201"
    parameters = (
        Parameter("square", "N", -1e6, 1e6, 0.0, "force per squared travel", linear=True, position=-2),
        Parameter("cubic", "N", -1e7, 1e7, 1e3, "force per cubed travel", linear=True, position=-3),
    )
    square: float
    cubic: float

    def force(self, s: Signals, x: Array, plant: Plant) -> Array:
        """Return −k₂ x² − k₃ x³."""
        return -(self.square + self.cubic * s.position) * s.position**2
