"""What the reference or an input of a designed run does, and the rate that it keeps."""

import math

import numpy as np

TONES = np.array([1.0, 1.9, 3.1, 4.3])
"""Frequencies of a multisine, as multiples of the lowest."""


def motion(kind: str, t: np.ndarray, a: float, w: float, seed: int, low: float = -1.0) -> np.ndarray:
    """Return the motion of an amplitude and a frequency, rad/s, about zero; steps go down to a multiple of it."""
    if kind == "sine":
        return a * np.sin(w * t)
    if kind == "triangle":
        return a * 2.0 / math.pi * np.arcsin(np.sin(w * t))
    if kind == "steps":
        return a * np.where(np.sin(w * t) > 0.0, 1.0, low) * (t > 0.0)
    if kind == "multisine":
        x = multisine(w * t, seed)
        return np.asarray(a * x / max(float(np.max(np.abs(x))), 1e-300))
    if kind == "chirp":
        return a * np.sin(w * t * (1.0 + 2.0 * t / max(float(t[-1]), 1e-300)))
    return np.zeros(len(t))


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
