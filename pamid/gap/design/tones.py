"""The multisine of designed runs, and the rate that their inputs keep."""

from __future__ import annotations

import math

import numpy as np

TONES = np.array([1.0, 1.9, 3.1, 4.3])
"""Frequencies of a multisine, as multiples of the lowest."""


def multisine(angle: np.ndarray, seed: int) -> np.ndarray:
    """Return a sum of sines of equal power in speed, with random phases, at angles (rad) of the lowest."""
    phases = np.random.default_rng(seed).uniform(0.0, 2.0 * math.pi, len(TONES))
    return np.asarray((np.sin(TONES[:, None] * angle + phases[:, None]) / np.sqrt(TONES)[:, None]).sum(axis=0))


def slewed(x: np.ndarray, step: float) -> np.ndarray:
    """Return a signal that moves by no more than a step from sample to sample."""
    if np.max(np.abs(np.diff(x)), initial=0.0) <= step * (1.0 + 1e-9):
        return x
    out, now = np.empty(len(x)), float(x[0])
    for k, value in enumerate(x.tolist()):
        now += min(max(value - now, -step), step)
        out[k] = now
    return out
