r"""Noise of readings that lasts longer than a sample, as the filters of sensors leave it.

It changes little from sample to sample, so that neighbouring readings show only part of it. Of a first-order process

.. math:: e_k = \rho e_{k-1} + \sqrt{1 - \rho^2}\, w_k

with a known memory that part is known, and thereby the size of the noise and what residuals are in each octave of time.
A gap that is mistaken for it would have the size of all of them.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize_scalar
from scipy.signal import correlate, lfilter

from ..settings import EXCESS, FEWEST, LEAST_GAIN, MATERIAL
from .measured_inputs import white_over


def memories(x: np.ndarray, spans: Sequence[tuple[int, int]]) -> list[float]:
    """Return samples over which the noise of a reading may fall to 1/e, in half octaves.

    A filter that lasted longer than the motion that it reads would hide it.
    """
    a, b = max(spans, key=lambda span: span[1] - span[0])
    part = x[a:b] - np.mean(x[a:b])
    alike = correlate(part, part)[b - a - 1 :]
    longest = int(np.argmax(alike < alike[0] / np.e)) or b - a
    return [2.0 ** (0.5 * k) for k in range(-1, int(2.0 * np.log2(longest)) + 1)]


def lasting(
    memory: float, shown: float, spans: Sequence[tuple[int, int]], count: int, rng: np.random.RandomState
) -> np.ndarray:
    """Return draws of noise that lasts, of which neighbouring samples show a deviation, shape (count, n)."""
    rho, n = float(np.exp(-1.0 / memory)), spans[-1][1]
    drawn = rng.standard_normal((count, n))
    for a, b in spans:
        drawn[:, a + 1 : b] *= np.sqrt(1.0 - rho**2)
        drawn[:, a:b] = lfilter([1.0], [1.0, -rho], drawn[:, a:b])
    part = np.sqrt(np.mean([white_over(one, spans, 10) ** 2 for one in drawn]))
    return drawn * (shown / part)


class Octaves:
    """The powers of residuals in octaves of time, per equation: those of their Haar wavelets."""

    def __init__(self, parts: Sequence[slice], run: np.ndarray) -> None:
        self._lanes = [[p.start + np.flatnonzero(run[p] == k) for k in np.unique(run[p])] for p in parts]
        self.counts = np.array([x.shape[1] for x in self._details(np.zeros((1, len(run))))])

    def powers(self, z: np.ndarray) -> np.ndarray:
        """Return the mean squares of several residuals, (n, n_windows), in each octave of each equation."""
        return np.stack([np.mean(np.square(x), axis=1) for x in self._details(z)], axis=1)

    def _details(self, z: np.ndarray) -> Iterator[np.ndarray]:
        for lanes in self._lanes:
            rest = [z[:, lane] for lane in lanes]
            while sum(x.shape[1] // 2 for x in rest) >= FEWEST:
                ends = [2 * (x.shape[1] // 2) for x in rest]
                pairs = [(x[:, 0:end:2], x[:, 1:end:2]) for x, end in zip(rest, ends, strict=True)]
                yield np.concatenate([(a - b) / np.sqrt(2.0) for a, b in pairs], axis=1)
                rest = [(a + b) / np.sqrt(2.0) for a, b in pairs]

    def unlikely(self, power: np.ndarray, noise: np.ndarray) -> float:
        """Return the negative log-likelihood of powers under those of noise."""
        noise = np.maximum(noise, np.finfo(float).tiny)
        return 0.5 * float(self.counts @ (np.log(noise) + power / noise))

    def within(self, power: np.ndarray, drawn: np.ndarray) -> bool:
        """Return whether each power is that of draws of noise, (n_draws, n_octaves), neither more nor less."""
        ratio = np.sqrt(power / np.mean(drawn, axis=0))
        spread = np.std(np.sqrt(drawn), axis=0) / np.mean(np.sqrt(drawn), axis=0)
        known = 1.0 + EXCESS + 3.0 * np.maximum(spread, 1.0 / np.sqrt(2.0 * self.counts))
        return bool(np.all((ratio < known) & (ratio > 1.0 / known)))


class Lasting(NamedTuple):
    """Noise of a reading that lasts."""

    memory: int
    """Place of its memory in those that were tried; 0 for none."""
    size: float
    """Its deviation, relative to what neighbouring samples show, which motion adds to."""


def likeliest(octaves: Octaves, power: np.ndarray, noises: Sequence[np.ndarray]) -> list[Lasting]:
    """Return the noise of each reading under which powers are likeliest; without memory where that is no better.

    `noises` are the powers of the noise of each reading with each memory, the first without any, each of shape
    (n_memories, n_octaves).
    """

    def unlikely(found: Sequence[Lasting]) -> float:
        noise = np.sum([one.size**2 * own[one.memory] for one, own in zip(found, noises, strict=True)], axis=0)
        return octaves.unlikely(power, noise)

    def sized(found: Sequence[Lasting], r: int, memory: int) -> list[Lasting]:
        def there(log_size: float) -> list[Lasting]:
            return [*found[:r], Lasting(memory, float(np.exp(log_size))), *found[r + 1 :]]

        least = minimize_scalar(lambda v: unlikely(there(v)), bounds=(np.log(MATERIAL), 0.0), method="bounded")
        return min(there(least.x), there(0.0), key=unlikely)

    none = [Lasting(0, 1.0) for _ in noises]
    together = ([Lasting(min(k, len(own) - 1), 1.0) for own in noises] for k in range(max(map(len, noises))))
    found = min(together, key=unlikely)
    for _ in range(2 * len(noises)):
        for r, own in enumerate(noises):
            found = min((sized(found, r, k) for k in range(len(own))), key=unlikely)
    return found if unlikely(found) < unlikely(none) - LEAST_GAIN else none


def waves(x: np.ndarray, most: int) -> Iterator[np.ndarray]:
    """Yield the cosine and the sine of one to so many waves over the range of a signal, each of shape (2, n)."""
    phase = 2.0 * np.pi * (x - np.min(x)) / max(float(np.ptp(x)), 1e-300)
    for k in range(1, most + 1):
        yield np.stack([np.cos(k * phase), np.sin(k * phase)])
