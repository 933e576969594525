"""Memory operators that several effects share, each exact for a signal that is linear between two instants."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from ..signals.paths import play
from ..signals.recursion import recursive
from ..signals.state import Array


def dahl(z: Array, displacement: Array, length: float, exponent: float = 1.0) -> Array:
    """Advance Dahl's bristle z ∈ [−1, 1] exactly: dz = (1 − z sgn dξ)ⁿ dξ / length."""
    d = displacement / length
    if exponent > 0.999:
        decay = np.exp(-np.abs(d))
        return np.copysign(1.0 - decay, d) + z * decay
    sign, left = np.copysign(1.0, d), 1.0 - exponent
    w = np.maximum(np.maximum(1.0 - z * sign, 0.0) ** left - left * np.abs(d), 0.0) ** (1.0 / left)
    return sign * (1.0 - w)


def bouc_wen(z: Array, displacement: Array, length: Array, shape: float) -> Array:
    r"""Advance the Bouc–Wen variable z ∈ [−1, 1] (exponent 1) exactly; along the motion it is linear on each side of 0.

    .. math:: \frac{\mathrm{d}z}{\mathrm{d}\xi} = \frac{1}{\delta}\left(1 - |z|\,(\beta\,\mathrm{sgn}(z\,
        \mathrm{d}\xi) + 1 - \beta)\right)
    """
    d = displacement / length
    sign = np.copysign(1.0, d)
    w = z * sign
    a = 1.0 - 2.0 * shape  # ≤ 0: rate of the exponential before the passage through 0
    straight = a > -1e-9
    before, beyond = np.minimum(w, 0.0), np.clip(w, 0.0, 1.0 - 1e-15)
    distance = (before if straight else np.log1p(a * before) / a) - np.log1p(-beyond) + np.abs(d)
    before, beyond = np.minimum(distance, 0.0), np.maximum(distance, 0.0)
    return sign * ((before if straight else np.expm1(a * before) / a) - np.expm1(-beyond))


def relax(x: Array, v0: Array, v1: Array, dt: float, tau: float) -> Array:
    """Advance τ ẋ = v − x by ``dt`` for an input that is linear from ``v0`` to ``v1``."""
    r = dt / tau
    if r == 0.0:
        return x + 0.0 * v1
    decay = np.exp(-r)
    mean = -np.expm1(-r) / r  # weight that a ramp leaves on the old input
    return x * decay + v0 * (mean - decay) + v1 * (1.0 - mean)


def mostly_lasting(stiffness: Sequence[float], taus: Sequence[float], seconds: float) -> bool:
    """Return whether more stiffness is in springs that lose less than a tenth of it in a time than in others."""
    lasting = sum(k for k, tau in zip(stiffness, taus, strict=True) if np.exp(-seconds / tau) > 0.9)
    return lasting > 0.5 * sum(stiffness)


def relax_along(v: Array, dt: float, tau: float, starts: Array) -> Array:
    """Return `relax` along the runs of a log, at rest at the start of each; time is the first axis."""
    v = np.asarray(v, dtype=float)
    if dt / tau == 0.0:
        raise ValueError("a time constant must be finite")
    decay = np.exp(-dt / tau)
    mean = -np.expm1(-dt / tau) * tau / dt
    drive = (1.0 - mean) * v
    drive[1:] += (mean - decay) * v[:-1]
    drive[starts] = v[starts]
    return recursive(drive, [decay], starts)


def hold_along(v: Array, dt: float, tau: float, starts: Array) -> Array:
    """Return a first-order lag of an input that is held from each instant to the next, as `relax_along`."""
    v = np.asarray(v, dtype=float)
    decay = np.exp(-dt / tau)
    drive = np.empty_like(v)
    drive[1:] = (1.0 - decay) * v[:-1]
    drive[starts] = v[starts]
    return recursive(drive, [decay], starts)


def drawn_along(target: Array, decay: Array, starts: Array) -> Array:
    """Return x[k + 1] = target[k] + (x[k] − target[k]) decay[k] along runs, from 0, by doubling of steps."""
    shape = (len(target) + 1, *target.shape[1:])
    keep, x = np.zeros(shape), np.zeros(shape)
    keep[1:], x[1:] = decay, target * (1.0 - decay)
    keep[starts], x[starts] = 0.0, 0.0
    reach = 1
    while reach < len(x) and np.max(keep) > 1e-15:
        x[reach:] += keep[reach:] * x[:-reach]
        keep[reach:] *= keep[:-reach]
        reach *= 2
    return x


def unlagged(reading: Array, dt: float, rate: float, bend: float, starts: Array) -> Array:
    """Return a reading plus factors times its rate and its curvature, along runs: what a lag of second order read."""
    out = np.array(reading, dtype=float)
    for a, b in zip(starts, [*list(starts)[1:], len(out)], strict=True):
        if b - a > 1:
            speed = np.gradient(out[a:b], dt, axis=0)
            out[a:b] += rate * speed + (bend * np.gradient(speed, dt, axis=0) if bend > 0.0 else 0.0)
    return out


@lru_cache(maxsize=64)
def transition(
    frequency: float, damping: float, dt: float, ramp: bool, damper: bool = False
) -> tuple[Array, Array, Array]:
    r"""Return the transition of (y, ẏ) over an interval, :math:`\ddot y = \omega^2 (v - y) - 2 \zeta \omega\,\dot y`.

    With a `damper` beside the spring the second state is :math:`\dot y - 2 \zeta \omega\,(v - y)`.
    """
    from scipy.linalg import expm

    # The input and its rate are carried along as two more states.
    A = np.zeros((4, 4))
    A[0, 1] = 1.0
    A[1] = -(frequency**2), -2.0 * damping * frequency, frequency**2, 0.0
    if damper:
        A[0] = -2.0 * damping * frequency, 1.0, 2.0 * damping * frequency, 0.0
        A[1, 1] = 0.0
    A[2, 3] = 1.0 if ramp else 0.0
    E = expm(A * dt)
    slope = E[:2, 3] / dt if dt > 0.0 else 0.0 * E[:2, 3]
    return E[:2, :2], E[:2, 2] - slope, slope


def carried(x: Array, v0: Array, v1: Array, frequency: float, damping: float, dt: float, ramp: bool) -> Array:
    """Return the states (y, ẏ) along the first axis after an interval."""
    M, old, new = transition(frequency, damping, dt, ramp)
    shape = (2, *[1] * np.ndim(v0))
    return (M @ x.reshape(2, -1)).reshape(x.shape) + old.reshape(shape) * v0 + new.reshape(shape) * v1


def carried_along(
    v: Array, dt: float, frequency: float, damping: float, starts: Array, ramp: bool, speed: Array = None
) -> Array:
    """Return `carried` along runs, at rest at each start; with the input's `speed`, a damper is beside the spring."""
    v = np.asarray(v, dtype=float)
    M, old, new = transition(frequency, damping, dt, ramp, speed is not None)
    begin = np.zeros(len(v), dtype=int)
    begin[starts] = starts
    rest = v[np.maximum.accumulate(begin)]  # at rest the output is the input
    u, shape = v - rest, (2, *[1] * v.ndim)
    d = new.reshape(shape) * u
    d[:, 1:] += old.reshape(shape) * u[:-1]
    d[:, starts] = 0.0
    if speed is not None:
        d[1, starts] = speed[starts]
    # M is a root of its characteristic polynomial, so that each state goes on from its own past alone.
    trace, determinant = float(np.trace(M)), float(np.linalg.det(M))
    drive = d.copy()
    drive[:, 1:] += np.tensordot(M - trace * np.eye(2), d[:, :-1], 1)
    drive[:, starts] = d[:, starts]
    out = np.moveaxis(recursive(np.moveaxis(drive, 0, -1), [trace, -determinant], starts), -1, 0)
    out[0] += rest
    return out


RATIOS = (1.0 / 3.0, 1.0, 3.0)
"""Widths of elastic stops, as multiples of the middle one."""


def stopped(z: Array, moved: Array, width: float) -> Array:
    """Advance stops z ∈ [−1, 1] by a displacement in one direction."""
    widths = width * np.reshape(RATIOS, (-1, *[1] * np.ndim(moved)))
    return np.clip(z + moved / widths, -1.0, 1.0)


def stops_along(x: Array, width: float, starts: Array) -> Array:
    """Return `stopped` along the runs of a log, without a loop over time: x less its play."""
    x = np.asarray(x, dtype=float)
    return np.stack([(x - play(x, ratio * width, starts)) / (ratio * width) for ratio in RATIOS])


def stops_force(z: Array, weights: Sequence[float], slopes: Sequence[float], position: Array) -> Array:
    """Return the force of the stops, N: −Σ (w + v x) z over the elements, their weights changing with the position."""
    parts = ((w + v * position) * element for w, v, element in zip(weights, slopes, z, strict=True))
    return -sum(parts, start=np.zeros(np.shape(z[0])))


def cubic(x: float, nodes: Sequence[int]) -> list[float]:
    """Return the weights of four samples in the value between them: the cubic polynomial through them."""
    return [math.prod((x - b) / (a - b) for b in nodes if b != a) for a in nodes]


def memory(samples: float, smooth: bool = True) -> int:
    """Return how many past values `shift` needs, besides the output."""
    return max(math.ceil(samples) + 2, 4) if smooth else math.ceil(samples) + 1


def shift(x: Array, value: Array, samples: float, smooth: bool = False) -> Array:
    """Push ``value`` into the memory (entry 0: output, entries 1…: newest first) and update the output."""
    out = np.empty_like(x)
    out[1] = value
    out[2:] = x[1:-1]
    whole = math.floor(samples)
    part = samples - whole
    out[0] = out[1 + whole]
    if part > 0.0 and smooth:
        nodes = range(first := max(whole - 1, 0), first + 4)  # nothing is newer than the newest
        out[0] = sum(w * out[1 + k] for w, k in zip(cubic(samples, nodes), nodes, strict=True))
    elif part > 0.0:
        out[0] += part * (out[2 + whole] - out[1 + whole])
    return out


def delayed_rows(v: Array, samples: float, starts: Array, smooth: bool = False) -> Array:
    """Return ``v`` delayed (or advanced) within each run; ends repeat, smooth signals are interpolated cubically."""
    v, n = np.asarray(v, dtype=float), len(v)
    starts = np.asarray(starts, dtype=np.int64)
    lengths = np.diff(np.append(starts, n))
    first = np.repeat(starts, lengths)
    last = np.repeat(starts + lengths - 1, lengths)
    whole = math.floor(samples)
    part = samples - whole
    rows = np.arange(n)

    def at(k: int) -> Array:
        return v[np.clip(rows - whole - k, first, last)]

    if part == 0.0:
        return at(0)
    if smooth:
        return np.asarray(sum(w * at(k) for w, k in zip(cubic(part, range(-1, 3)), range(-1, 3), strict=True)))
    return at(0) + part * (at(1) - at(0))
