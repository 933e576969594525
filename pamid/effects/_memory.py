"""Memory operators that several effects share, each exact for a signal that moves straight between two instants."""

from __future__ import annotations

import numpy as np

from ..signals.state import Array


def dahl(z: Array, displacement: Array, length: float) -> Array:
    """Advance Dahl's bristle z ∈ [−1, 1] by a displacement: dz = (1 − z sgn dξ) dξ / length."""
    d = np.asarray(displacement) / length
    decay = np.exp(-np.abs(d))
    return np.copysign(1.0 - decay, d) + z * decay


def bouc_wen(z: Array, displacement: Array, length: float, shape: float) -> Array:
    r"""Advance the Bouc–Wen variable z ∈ [−1, 1] (exponent 1) by a displacement.

    .. math:: \frac{\mathrm{d}z}{\mathrm{d}\xi} = \frac{1}{\delta}\left(1 - |z|\,(\beta\,\mathrm{sgn}(z\,
        \mathrm{d}\xi) + 1 - \beta)\right)

    With the variable oriented along the motion, w = z sgn dξ, the law is linear on either side of w = 0, so the
    solution after any distance is known; the distance is counted from the passage through 0.
    """
    d = np.asarray(displacement) / length
    sign = np.copysign(1.0, d)
    w = z * sign
    a = 1.0 - 2.0 * shape  # ≤ 0: rate of the exponential before the passage through 0
    before = np.minimum(w, 0.0)
    to_zero = -before if a > -1e-9 else -np.log1p(a * before) / a
    passed = np.log1p(-np.clip(w, 0.0, 1.0 - 1e-12))  # ≤ 0: where on the way out of 0 it is already
    left = np.abs(d) - to_zero
    beyond = -np.expm1(-np.maximum(left, 0.0) + np.where(w > 0.0, passed, 0.0))
    growth = np.minimum(np.abs(d), to_zero)
    short = before + growth if a > -1e-9 else before * np.exp(a * growth) + np.expm1(a * growth) / a
    return sign * np.where(left > 0.0, beyond, np.where(w > 0.0, w, short))


def relax(x: Array, v0: Array, v1: Array, dt: float, tau: float) -> Array:
    """Advance τ ẋ = v − x by ``dt`` for an input that goes straight from ``v0`` to ``v1``."""
    r = dt / tau
    if r == 0.0:
        return x + 0.0 * v1
    decay = np.exp(-r)
    mean = -np.expm1(-r) / r  # weight that a ramp leaves on the old input
    return x * decay + v0 * (mean - decay) + v1 * (1.0 - mean)
