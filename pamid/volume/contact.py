r"""A braided muscle whose bladder must first be pressed against the braid: the anchor of the hybrid models."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from scipy.special import expit

from ..constants import ATMOSPHERIC_PRESSURE
from ..explained import explained_fields
from ..signals.state import Array, State
from .base import VolumeJet

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(12)
POINTS, SHARES = np.append(0.5 * (_NODES + 1.0), 1.0), np.append(0.5 * _WEIGHTS, 0.0)
"""Points of the quadrature as shares of ε, and their weights; the last one, of no weight, is ε itself."""
_SMALL = 0.05
"""Gauge pressure, in widths of the contact, below which its factor is a series: the quotient would lose digits."""


@explained_fields
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

    References
    ----------
    Geometry: C.-P. Chou, B. Hannaford, IEEE Trans. Robotics and Automation 12(1), 1996.
    https://doi.org/10.1109/70.481753. Pressure taken up by the bladder: G. K. Klute, B. Hannaford, "Accounting for
    elastic energy storage in McKibben artificial muscle actuators", Journal of Dynamic Systems, Measurement, and
    Control 122(2), 2000. https://doi.org/10.1115/1.482478

    Examples
    --------
    >>> import numpy as np
    >>> from pamid.signals import State
    >>> from pamid.volume.contact import ContactVolume
    >>> size = {"rest_length": 0.2, "area": 2.7e-3, "max_contraction": 0.36, "curvature": -0.2, "rest_volume": 6.3e-5}
    >>> touch = {"contact_pressure": 2e4, "contact_contraction": 0.02, "contact_width": 5e3}
    >>> jet = ContactVolume(**size, **touch).jet(State(*np.array([[0.1], [0.0], [3e5], [0.0]])))
    >>> (1e6 * jet.V_eps).round(1)  # slope of the volume, cm³
    array([331.3])
    """

    rest_length: Annotated[float, "L₀, m."]
    area: Annotated[float, "A, force per gauge pressure at rest length, m²."]
    max_contraction: Annotated[float, "εₘ, where the force vanishes, dimensionless."]
    curvature: Annotated[float, "κ, dimensionless, above −1."]
    contact_pressure: Annotated[float, "p_∞, Pa (gauge)."]
    contact_contraction: Annotated[float, "ε_c, dimensionless."]
    contact_width: Annotated[float, "s, softness of the contact, Pa."]
    rest_volume: Annotated[float, "V at ε = 0, m³."]
    thread_compliance: Annotated[float, "c, relative stretch of the threads per gauge pressure, 1/Pa."] = 0.0
    atmospheric_pressure: Annotated[float, "Pa, absolute."] = ATMOSPHERIC_PRESSURE

    def slope(self, eps: Array, p_gauge: Array) -> Array:
        """Return ∂V/∂ε at a contraction and a gauge pressure, m³."""
        x, u = self._arguments(eps, p_gauge)
        return self._braid(eps) * _contact(x, u) - self.stretch * p_gauge

    def _braid(self, eps: Array) -> Array:
        """Return L₀ g, m³."""
        u = eps / self.max_contraction
        return self.rest_length * self.area * (1.0 - u) * (1.0 + self.curvature * u)

    @property
    def stretch(self) -> float:
        """Volume that stretching threads add at rest length per gauge pressure, m³/Pa."""
        return self.thread_compliance * (self.rest_length * self.area + 3.0 * self.rest_volume)

    def _arguments(self, eps: Array, p_gauge: Array) -> tuple[Array, Array]:
        """Return −p_c/s and p/s."""
        # Slackening below rest length lifts no bladder off its braid: the contact pressure stays at zero there.
        pc = self.contact_pressure * -np.expm1(-np.maximum(eps, 0.0) / self.contact_contraction)
        return -pc / self.contact_width, p_gauge / self.contact_width

    def slope_at(self, state: State) -> Array:
        """Return ∂V/∂ε alone, without the quadrature that V takes."""
        eps, P = np.asarray(state.eps, dtype=float), np.asarray(state.P, dtype=float)
        return self.slope(eps, P - self.atmospheric_pressure)

    def jet(self, state: State) -> VolumeJet:
        """Return V, ∂V/∂ε and ∂V/∂P at each sample, V by Gauss–Legendre quadrature over ε."""
        eps, p = np.asarray(state.eps, dtype=float), np.asarray(state.P, dtype=float) - self.atmospheric_pressure
        stretch = self.stretch
        at = eps[:, None] * POINTS
        x, u = self._arguments(at, p[:, None])
        braid, (phi, phi_slope) = self._braid(at), _contact_jet(x, u)
        through, left = braid * phi, stretch * (1.0 - eps)
        V = self.rest_volume + left * p + eps * (through @ SHARES)
        rise = (braid * phi_slope) @ SHARES / self.contact_width
        return VolumeJet(V, through[:, -1] - stretch * p, left + eps * rise)


def _contact(x: Array, u: Array) -> Array:
    """Return φ = (ln(1 + e^(x+u)) − ln(1 + e^x))/u."""
    small = np.abs(u) < _SMALL
    near = small.any()
    safe = np.where(small, 1.0, u) if near else u
    phi = (np.logaddexp(0.0, x + safe) - np.logaddexp(0.0, x)) / safe
    if not near:
        return phi
    # Near u = 0 the quotient is a mean of the logistic function over a short stretch: a series about its middle.
    m = expit(x + u / 2.0)
    a, odd = m * (1.0 - m), 1.0 - 2.0 * m
    return np.where(small, m + a * odd * u**2 / 24.0 * (1.0 + (1.0 - 12.0 * a) * u**2 / 80.0), phi)


def _contact_jet(x: Array, u: Array) -> tuple[Array, Array]:
    """Return φ and ∂φ/∂u."""
    small = np.abs(u) < _SMALL
    if not small.any():
        end = x + u
        phi = (np.logaddexp(0.0, end) - np.logaddexp(0.0, x)) / u
        return phi, (expit(end) - phi) / u
    phi = _contact(x, u)
    slope = (expit(x + u) - phi) / np.where(small, 1.0, u)
    m = expit(x + u / 2.0)
    a, odd = m * (1.0 - m), 1.0 - 2.0 * m
    even = 0.5 + (1.0 - 6.0 * a) * u**2 / 48.0 + (1.0 - 30.0 * a + 120.0 * a * a) * u**4 / 3840.0
    return phi, np.where(small, a * (even + odd * u * (1.0 / 12.0 + (1.0 - 12.0 * a) * u**2 / 480.0)), slope)
