r"""Noise of inputs that are measured, such as a pressure or a current: it counts where residuals show it.

A command is exact, with all that its controller adds; what drives the system is not the noise of a sensor that reads an
input. Which of the two an input is shows in what residuals leave from window to window, where gaps, which are slow,
show little: it has the size of the noise of readings alone, or of that of both.

A command is exact to the digits that a log keeps of it. What rounding takes from a value that is held lasts as long as
a gap does, so that it is asked for only where no cause explains the residuals. Values that are those of a grid, such as
counts of a converter, are exact: then residuals are smaller than rounding would leave.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from ...equations.noise import channel_noise
from ...signals.noise import common_step, third_differences, white_noise
from ..settings import EXCESS, LEAST_GAIN, MATERIAL


def white_over(x: np.ndarray, spans: Sequence[tuple[int, int]], n: int) -> float:
    """Return the standard deviation of a channel's white noise over all runs; windows have n samples."""
    power = [channel_noise(x[a:b], n).white ** 2 for a, b in spans]
    return float(np.sqrt(np.average(power, weights=[b - a for a, b in spans])))


def rough_inputs(u: np.ndarray, spans: Sequence[tuple[int, int]]) -> np.ndarray:
    """Return the standard deviation of what is white in each input; 0 where it is none, or most of the input."""
    sigma = np.array([_white_input(row, spans) for row in u])
    return np.where(sigma < MATERIAL * np.std(u, axis=1), sigma, 0.0)  # more drives the system


def _white_input(x: np.ndarray, spans: Sequence[tuple[int, int]]) -> float:
    """Return what is white in an input over all runs; where it is held, its smallest jump is no step of a sensor."""
    step = common_step(x)
    held = [(a, b) for a, b in spans if white_noise(third_differences(x[a:b])) == 0.0]
    power = [step**2 / 12.0 if run in held else channel_noise(x[slice(*run)], 1).white ** 2 for run in spans]
    return float(np.sqrt(np.average(power, weights=[b - a for a, b in spans])))


def roundings(u: np.ndarray, rough: np.ndarray) -> np.ndarray:
    """Return the step to which a log rounds each input; 0 where it is none, most of the input, or within its noise."""
    steps = np.array([common_step(row) for row in u])
    sigma = steps / np.sqrt(12.0)
    return np.where((sigma > rough) & (sigma < MATERIAL * np.std(u, axis=1)), steps, 0.0)


def rounded_off(u: np.ndarray, steps: np.ndarray, starts: np.ndarray, rng: np.random.RandomState) -> np.ndarray:
    """Return a draw of what rounding to steps takes from inputs: it lasts as a held value does, and zero is exact."""
    out = np.zeros(u.shape)
    for k in np.flatnonzero(steps):
        new = np.diff(u[k], prepend=np.nan) != 0.0
        new[starts] = True
        held = np.cumsum(new) - 1
        out[k] = np.where(u[k] == 0.0, 0.0, steps[k] * rng.uniform(-0.5, 0.5, held[-1] + 1)[held])
    return out


def shown(left: np.ndarray, readings: np.ndarray, inputs: Sequence[np.ndarray], parts: Sequence[slice]) -> list[int]:
    """Return which inputs' noise residuals show, none of them where they show less or more than that.

    `left` are the residuals without what is slow, `readings` draws of the noise of readings, and `inputs` of each
    input's, made alike.
    """
    size, alone = _sizes(left[None], parts), _sizes(readings, parts)
    best, chosen = _unlikely(size, alone, parts) - LEAST_GAIN, list[int]()
    for some in ([*range(len(inputs))], *([k] for k in range(len(inputs)) if len(inputs) > 1)):
        drawn = readings + np.sum([inputs[k] for k in some], axis=0)
        both, known = _sizes(drawn, parts), _uncertain(drawn, parts)
        more = bool(np.any(size > both * (1.0 + known)))
        if more or quieter(left, readings, drawn, parts):
            continue
        if (value := _unlikely(size, both, parts)) < best:
            best, chosen = value, some
    return chosen


def exceeds(left: np.ndarray, drawn: np.ndarray, parts: Sequence[slice], surely: bool = False) -> bool:
    """Return whether residuals are larger than draws of noise, or surely so, however uncertain its size is."""
    known = _uncertain(drawn, parts) if surely else 0.0
    return bool(np.any(_sizes(left[None], parts) > _sizes(drawn, parts) * (1.0 + known)))


def quieter(left: np.ndarray, readings: np.ndarray, both: np.ndarray, parts: Sequence[slice]) -> bool:
    """Return whether residuals are too small for the noise of readings and inputs, where these add to it."""
    surely = _sizes(both, parts) / (1.0 + _uncertain(both, parts))
    return bool(np.any((surely > _sizes(readings, parts)) & (surely > _sizes(left[None], parts))))


def relative(drawn: np.ndarray, readings: np.ndarray, parts: Sequence[slice]) -> float:
    """Return the size of draws in units of the noise of readings, in the equation where it is largest."""
    return float(np.max(_sizes(drawn, parts) / _sizes(readings, parts)))


def _uncertain(drawn: np.ndarray, parts: Sequence[slice]) -> np.ndarray:
    """Return by how much the size of noise is uncertain, relative: as a gap may exceed it.

    It is more so with few windows, and with noise that lasts, as where a simulator integrates it: draws then differ.
    """
    each = np.array([_sizes(one[None], parts) for one in drawn])
    spread = np.std(each, axis=0) / np.maximum(np.mean(each, axis=0), 1e-300)
    return EXCESS + 3.0 * np.maximum(spread, [1.0 / np.sqrt(2.0 * max(p.stop - p.start, 1)) for p in parts])


def _sizes(z: np.ndarray, parts: Sequence[slice]) -> np.ndarray:
    return np.array([np.sqrt(np.mean(np.square(z[:, part]))) if part.stop > part.start else 1.0 for part in parts])


def _unlikely(size: np.ndarray, noise: np.ndarray, parts: Sequence[slice]) -> float:
    """Return the negative logarithm of the likelihood of residuals of a size under noise of another."""
    count = np.array([part.stop - part.start for part in parts])
    return float(count @ (np.log(noise) + 0.5 * np.square(size / noise)))


def without_slow(z: np.ndarray, starts: Sequence[int], around: int) -> np.ndarray:
    """Return residuals less their means over the windows around, within lanes."""
    out = np.array(z, dtype=float)
    for a, b in pairwise([*starts, len(z)]):
        before = np.concatenate([[0.0], np.cumsum(z[a:b])])
        at = np.arange(b - a)
        low, high = np.maximum(at - around, 0), np.minimum(at + around + 1, b - a)
        out[a:b] -= (before[high] - before[low]) / (high - low)
    return out
