r"""Copies of coarse readings: steps of a sensor that no noise dithers leave errors that last as long as a step does.

The error of a reading in steps of q, drawn at another phase φ of the steps,

.. math:: e = q\,\lfloor s / q + \varphi \rceil - q\,\varphi - s

depends on how fast the signal s crosses them: it averages out over a window only where many are crossed.

References
----------
B. Widrow, I. Kollár, "Quantization Noise", Cambridge University Press, 2008.
https://doi.org/10.1017/CBO9780511754661
"""

from __future__ import annotations

from collections.abc import Collection, Mapping

import numpy as np

from ...equations.noise import ChannelNoise, channel_noise
from ...simulators.port_log import PortLog


def noisy_copies(
    count: int, log: PortLog, sigma: Mapping[str, float], readings: Collection[str], n: int, rng: np.random.RandomState
) -> list[dict[str, np.ndarray]]:
    """Return copies of the channels with as much noise again: white, and what steps add that lasts over n samples."""
    found = [(name, slice(a, b), channel_noise(log.channels[name][a:b], n)) for name in readings for a, b in log.spans]
    copies = []
    for _ in range(count):
        copy = {name: x + _drawn(name, sigma.get(name, 0.0), log, rng) for name, x in log.channels.items()}
        for name, at, noise in found:
            if noise.fixed > 0.0:
                share = noise.fixed * np.sqrt(12.0) / noise.resolution  # of the error of a step that lasts
                copy[name][at] += share * error_in_steps(log.channels[name][at], noise, rng)
        copies.append(copy)
    return copies


def _drawn(name: str, sigma: float, log: PortLog, rng: np.random.RandomState) -> np.ndarray:
    """Return white noise of a channel's readings at the rows of a log, and what interpolation misses."""
    rows, missed = log.between.get(name), log.missed(name)
    if rows is None:
        return np.asarray(np.hypot(sigma, missed) * rng.standard_normal(log.n))
    return np.asarray(sigma * rows.noise(rng) + missed * rng.standard_normal(log.n))


def error_in_steps(x: np.ndarray, noise: ChannelNoise, rng: np.random.RandomState) -> np.ndarray:
    """Return the error of readings in steps at another phase of the steps."""
    q, s, phase = noise.resolution, between_steps(x), rng.uniform()
    dither = np.sqrt(max(noise.white**2 - q**2 / 12.0, 0.0)) * rng.standard_normal(len(x))
    return np.asarray(q * (np.round((s + dither) / q + phase) - phase) - s)


def between_steps(x: np.ndarray) -> np.ndarray:
    """Return the signal behind readings in steps: halfway between two values where they change, straight between."""
    at = np.flatnonzero(np.diff(x))
    if not len(at):
        return x.astype(float)
    places = np.concatenate([[0.0], at + 0.5, [len(x) - 1.0]])
    values = np.concatenate([x[:1], 0.5 * (x[at] + x[at + 1]), x[-1:]])
    return np.interp(np.arange(len(x)), places, values)
