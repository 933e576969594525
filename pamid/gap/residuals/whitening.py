r"""Residuals whose noise is independent from window to window, as a likelihood needs.

The noise of derivatives is negatively autocorrelated: the noise of a pressure makes errors of the flow equation
alternate, and a leak, whose error keeps its sign for seconds, stands out from that far more than from one window's
noise. The covariance C of neighbouring windows follows from the test functions and the channels' noise. With its
Cholesky factor L,

.. math:: C = L L^\top, \qquad z_\text{white} = L^{-1} z

are residuals of unit, independent noise (generalised least squares).

References
----------
A. C. Aitken, "On least squares and linear combination of observations", Proceedings of the Royal Society of Edinburgh
55, 1936. https://doi.org/10.1017/S0370164600014346
"""

from __future__ import annotations

import contextlib

import numpy as np

TRUSTED = 0.97, 0.8, 0.4
"""Share of the covariance that is counted on, less where it is none: a lag undone reaches beyond neighbours. The
rest of the noise is independent, of converters and models."""

LAGS, SHARED = 3, 0.03
"""Neighbouring windows whose noise is distinguished, and the correlation below which they share none."""

MOST_MEMORY = 20.0  # windows: a residual that remembers longer is a gap rather than noise


class Whitening:
    """The Cholesky factors of the noise of all equations."""

    def __init__(self) -> None:
        self._factors: list[tuple[slice, np.ndarray]] = []

    def learn(self, part: slice, drawn: np.ndarray, run: np.ndarray) -> None:
        """Add an equation with several draws of its noise."""
        power = float(np.mean(np.square(drawn))) if drawn.size else 0.0
        if power <= 0.0:
            return
        correlations: list[np.ndarray] = []
        for lag in range(1, min(LAGS, drawn.shape[1] - 1) + 1):
            same = run[lag:] == run[:-lag]
            r = float(np.mean((drawn[:, lag:] * drawn[:, :-lag])[:, same])) / power if same.any() else 0.0
            band = np.zeros(drawn.shape[1])
            band[: drawn.shape[1] - lag] = np.where(same, r if abs(r) > SHARED else 0.0, 0.0)
            correlations.append(band)
        before = len(self._factors)
        self.add(part, correlations, 1)
        if len(self._factors) > before:  # what lasts beyond these neighbours, or is trusted less, leaves noise larger
            _, factor = self._factors[-1]
            left = np.array([self.only(part, one, part.stop) for one in drawn])
            self._factors[-1] = part, factor * max(float(np.sqrt(np.mean(np.square(left)))), 1.0)

    def add(self, part: slice, correlations: list[np.ndarray], step: int) -> None:
        """Add an equation whose noise is shared by neighbours."""
        from scipy.linalg import LinAlgError, cholesky_banded

        n = part.stop - part.start
        band = np.zeros((1 + step * len(correlations), n))
        for lag, r in enumerate(correlations, start=1):
            band[step * lag] = r
        if not np.any(band):
            return
        for share in TRUSTED:
            trusted = share * band
            trusted[0] = 1.0
            with contextlib.suppress(LinAlgError):
                self._factors.append((part, cholesky_banded(trusted, lower=True)))
                return

    def white(self, z: np.ndarray) -> np.ndarray:
        """Return residuals with independent noise; further columns are whitened alike."""
        from scipy.linalg.lapack import dtbtrs

        out = np.array(z, dtype=float)
        for part, factor in self._factors if out.size else ():  # LAPACK writes beyond the end of no columns
            found, _ = dtbtrs(factor, out[part].reshape(factor.shape[1], -1), uplo="L")
            out[part] = found.reshape(out[part].shape)
        return out

    def only(self, part: slice, z: np.ndarray, n: int) -> np.ndarray:
        """Return the residuals of one equation of n windows in all with independent noise."""
        whole = np.zeros(n)
        whole[part] = z
        return self.white(whole)[part]

    def raw(self, z: np.ndarray) -> np.ndarray:
        """Return residuals as the windows have them: the inverse of `white`."""
        out = np.array(z, dtype=float)
        for part, factor in self._factors:
            x = out[part]
            total = (factor[0] * x.T).T
            for k in range(1, len(factor)):
                if len(x) > k:
                    total[k:] += (factor[k, :-k] * x[:-k].T).T
            out[part] = total
        return out


def smoothed(power: np.ndarray, near: int) -> np.ndarray:
    """Return means over neighbours to either side, fewer at the ends."""
    sums = np.concatenate([[0.0], np.cumsum(power)])
    at = np.arange(len(power))
    low, high = np.maximum(at - near, 0), np.minimum(at + near + 1, len(power))
    return (sums[high] - sums[low]) / (high - low)


def memory_of(x: np.ndarray, run: np.ndarray) -> float:
    """Return the correlation length of a residual in windows: the sum of its autocorrelation."""
    x = x - np.mean(x)
    power = float(np.mean(np.square(x)))
    total, lag = 1.0, 1
    while power > 0.0 and lag < min(len(x) // 4, 200):
        same = run[lag:] == run[:-lag]
        if not same.any():
            break
        rho = float(np.mean((x[lag:] * x[:-lag])[same])) / power
        if rho < 0.05:
            break
        total += 2.0 * rho
        lag += 1
    return min(total, MOST_MEMORY)
