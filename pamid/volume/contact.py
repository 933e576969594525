r"""A braided muscle whose bladder must first be pressed against the braid: the anchor of the hybrid models."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..constants import ATMOSPHERIC_PRESSURE
from ..signals.state import Array, State
from .base import VolumeJet

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(12)
_NODES, _WEIGHTS = 0.5 * (_NODES + 1.0), 0.5 * _WEIGHTS


@dataclass(frozen=True)
class ContactVolume:
    r"""Quadratic volume slope with a contact pressure that grows with the contraction.

    .. math:: \frac{\partial V}{\partial\varepsilon} = L_0\, g(\varepsilon)\, \varphi(p, \varepsilon), \quad
        g = A \left(1 - \varepsilon/\varepsilon_m\right) \left(1 + \kappa\, \varepsilon/\varepsilon_m\right)

    .. math:: \varphi = \frac{s}{p} \ln\frac{1 + e^{(p - p_c)/s}}{1 + e^{-p_c/s}}, \quad
        p_c = p_\infty \left(1 - e^{-\varepsilon/\varepsilon_c}\right), \quad p = P - P_\mathrm{atm}

    Every braided geometry has a slope that is quadratic in ε (Chou–Hannaford: εₘ = 1 − 1/(√3 cos θ₀),
    κ = −εₘ/(2 − εₘ)). A contracted muscle gives no force below the pressure p_c that presses its bladder against the
    braid; above it the force grows with p − p_c. With :math:`p_\infty = 0` the factor φ is nearly one and the geometry
    is left. Threads of compliance c that stretch under pressure add

    .. math:: \Delta V = c\, p\, (L_0 A + 3 V_0)(1 - \varepsilon),

    the first order of a braid whose threads are longer by the share c p.

    Parameters
    ----------
    rest_length : float
        L₀, m.
    area : float
        A, force per gauge pressure at rest length, m².
    max_contraction : float
        εₘ, where the force vanishes, dimensionless.
    curvature : float
        κ, dimensionless, above −1.
    contact_pressure : float
        p_∞, Pa (gauge).
    contact_contraction : float
        ε_c, dimensionless.
    contact_width : float
        s, softness of the contact, Pa.
    rest_volume : float
        V at ε = 0, m³.
    thread_compliance : float, default=0
        c, relative stretch of the threads per gauge pressure, 1/Pa.
    atmospheric_pressure : float, default=101325
        Pa, absolute.

    References
    ----------
    Geometry: C.-P. Chou, B. Hannaford, IEEE Trans. Robotics and Automation 12(1), 1996.
    https://doi.org/10.1109/70.481753. Pressure taken up by the bladder: G. K. Klute, B. Hannaford, "Accounting for
    elastic energy storage in McKibben artificial muscle actuators", Journal of Dynamic Systems, Measurement, and
    Control 122(2), 2000. https://doi.org/10.1115/1.482478
    """

    rest_length: float
    area: float
    max_contraction: float
    curvature: float
    contact_pressure: float
    contact_contraction: float
    contact_width: float
    rest_volume: float
    thread_compliance: float = 0.0
    atmospheric_pressure: float = ATMOSPHERIC_PRESSURE

    def slope(self, eps: Array, p_gauge: Array) -> Array:
        """Return ∂V/∂ε at a contraction and a gauge pressure, m³."""
        u = eps / self.max_contraction
        g = self.area * (1.0 - u) * (1.0 + self.curvature * u)
        return self.rest_length * g * self._contact(eps, p_gauge) - self._stretch * p_gauge

    @property
    def _stretch(self) -> float:
        """Volume that stretching threads add at rest length per gauge pressure, m³/Pa."""
        return self.thread_compliance * (self.rest_length * self.area + 3.0 * self.rest_volume)

    def _contact(self, eps: Array, p_gauge: Array) -> Array:
        s = self.contact_width
        # Slackening below rest length lifts no bladder off its braid: the contact pressure stays at zero there.
        pc = self.contact_pressure * -np.expm1(-np.maximum(eps, 0.0) / self.contact_contraction)
        # At p = 0 the quotient is 0/0; its limit is the logistic function, reached there by a difference quotient.
        p = np.where(np.abs(p_gauge) < 1e-6 * s, 1e-6 * s, p_gauge)
        return s / p * (np.logaddexp(0.0, (p - pc) / s) - np.logaddexp(0.0, -pc / s))

    def jet(self, state: State) -> VolumeJet:
        """Return V, ∂V/∂ε and ∂V/∂P at each sample, V by Gauss–Legendre quadrature over ε."""
        eps, p = np.asarray(state.eps, dtype=float), np.asarray(state.P, dtype=float) - self.atmospheric_pressure
        h = 1e-4 * self.contact_width
        at = eps[:, None] * _NODES
        V = self.rest_volume + self._stretch * p + eps * (self.slope(at, p[:, None]) @ _WEIGHTS)
        rise = (self.slope(at, p[:, None] + h) - self.slope(at, p[:, None] - h)) @ _WEIGHTS
        return VolumeJet(V, self.slope(eps, p), self._stretch + eps * rise / (2.0 * h))
