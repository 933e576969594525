"""The multisine of designed runs."""

from __future__ import annotations

import math

import numpy as np

TONES = np.array([1.0, 1.9, 3.1, 4.3])
"""Frequencies of a multisine, as multiples of the lowest."""


def multisine(angle: np.ndarray, seed: int) -> np.ndarray:
    """Return a sum of sines of equal power in speed, with random phases, at angles (rad) of the lowest."""
    phases = np.random.default_rng(seed).uniform(0.0, 2.0 * math.pi, len(TONES))
    return np.asarray((np.sin(TONES[:, None] * angle + phases[:, None]) / np.sqrt(TONES)[:, None]).sum(axis=0))
