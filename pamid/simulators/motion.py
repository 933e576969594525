"""Relations of channels: whether one is the derivative of another, or follows it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

_SURE, _FOLLOWS, _AHEAD = 0.95, 0.8, 0.3
"""Correlations from which samples speak for names that do not: of a rate, of what follows, of what leads."""
_PARTS = 200
"""Windows a run is cut into: a change over a window is compared with the noise of its mean."""


def rate_between(t: np.ndarray, position: np.ndarray, velocity: np.ndarray) -> tuple[float, float]:
    """Return how far one channel is another's derivative: its change over a window against their integral."""
    known = np.isfinite(t) & np.isfinite(position) & np.isfinite(velocity)
    t, x, v = t[known], position[known], velocity[known]
    k = max(len(t) // _PARTS, 1)
    if len(t) < 10 or np.ptp(x) == 0.0 or np.ptp(v) == 0.0:
        return float("nan"), float("nan")
    area = np.concatenate([[0.0], np.cumsum(0.5 * (v[1:] + v[:-1]) * np.diff(t))])
    change, integral = x[k:] - x[:-k], area[k:] - area[:-k]
    power = float(integral @ integral)
    r = _correlation(change, integral)
    return r, float(change @ integral) / power if power > 0.0 else float("nan")


def follows(command: np.ndarray, reading: np.ndarray) -> float:
    """Return the correlation of a command with a reading; NaN where one of them rests."""
    known = np.isfinite(command) & np.isfinite(reading)
    return _correlation(command[known], reading[known])


def _correlation(a: np.ndarray, b: np.ndarray) -> float:
    if len(a) < 3:
        return float("nan")
    a, b = a - a.mean(), b - b.mean()
    power = float(np.sqrt((a @ a) * (b @ b)))
    return float(a @ b) / power if power > 0.0 else float("nan")


def is_rate_of(t: np.ndarray, frame: Mapping[str, np.ndarray]) -> dict[str, str]:
    """Return the channels that are the derivative of another channel that is not itself one, with that channel."""
    if len(frame) < 2 or len(t) < 10:
        return {}
    x = np.array(list(frame.values()), dtype=float)
    moving = np.flatnonzero(np.isfinite(x).all(axis=1) & (np.ptp(x, axis=1) > 0.0))
    names, x = [list(frame)[i] for i in moving], x[moving]
    k = max(len(t) // _PARTS, 1)
    area = np.cumsum(0.5 * (x[:, 1:] + x[:, :-1]) * np.diff(t), axis=1)
    change, integral = x[:, k:] - x[:, :-k], np.pad(area, ((0, 0), (1, 0)))
    r = _alike(change, integral[:, k:] - integral[:, :-k])
    np.fill_diagonal(r, 0.0)
    found = {int(j): int(np.argmax(r[:, j])) for j in range(len(names)) if r[:, j].max(initial=0.0) > _SURE}
    return {names[j]: names[i] for j, i in found.items() if i not in found}


def led_by(frame: Mapping[str, np.ndarray]) -> dict[str, str]:
    """Return the channels that lead the one most like them, as a command leads its reading, with that one."""
    x = np.array(list(frame.values()), dtype=float)
    if len(frame) < 2 or x.shape[1] < 10:
        return {}
    moving = np.flatnonzero(np.isfinite(x).all(axis=1) & (np.ptp(x, axis=1) > 0.0))
    names, x = [list(frame)[i] for i in moving], x[moving]
    r = _alike(x, x)
    np.fill_diagonal(r, 0.0)
    found = {}
    for a in range(len(names)):
        b = int(np.argmax(r[a])) if len(names) > 1 else a
        if r[a, b] > _FOLLOWS and int(np.argmax(r[b])) == a and _ahead(x[a], x[b]) > _AHEAD:
            found[names[a]] = names[b]
    return found


def _ahead(a: np.ndarray, b: np.ndarray) -> float:
    """Return the correlation of the distance of a channel from another with that one's rate: above 0 where it leads."""
    k = max(len(b) // _PARTS, 1)
    a, b = a - a.mean(), b - b.mean()
    distance = a - b * float(a @ b) / float(b @ b)
    return _correlation(distance[k:-k], b[2 * k :] - b[: -2 * k])


def _alike(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the correlation of each row of an array with each of another."""
    a, b = (y - y.mean(axis=1, keepdims=True) for y in (a, b))
    power = np.sqrt(np.outer(np.sum(a * a, axis=1), np.sum(b * b, axis=1)))
    return np.divide(a @ b.T, power, out=np.zeros_like(power), where=power > 0.0)
