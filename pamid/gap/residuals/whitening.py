r"""Residuals whose noise is independent from window to window: what a likelihood may add up.

A derivative takes from one window what it gives the next: the noise of a pressure makes the flow equation err to and
fro, and a leak, which errs to one side for seconds, stands out from that far more than from one window's noise. The
covariance C of neighbouring windows follows from the test functions and the channels' noise. With its Cholesky
factor L,

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


class Whitening:
    """The Cholesky factors of the noise of all equations."""

    def __init__(self) -> None:
        self._factors: list[tuple[slice, np.ndarray]] = []

    def add(self, part: slice, correlations: list[np.ndarray], step: int) -> None:
        """Add an equation whose noise is shared by neighbours.

        Parameters
        ----------
        part : slice
            Its windows.
        correlations : list of array, shape (n_windows,)
            For each lag the correlation of a window's noise with that of the window so much later; 0 where there is
            none.
        step : int
            Places from a window to the next one of the same run and side.
        """
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
        """Return residuals with independent noise; further columns are turned alike."""
        from scipy.linalg.lapack import dtbtrs

        out = np.array(z, dtype=float)
        for part, factor in self._factors:
            found, _ = dtbtrs(factor, out[part].reshape(factor.shape[1], -1), uplo="L")
            out[part] = found.reshape(out[part].shape)
        return out

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
    """Return means over neighbours to either side, fewer at the ends.

    Parameters
    ----------
    power : array, shape (n,)
        Values in order.
    near : int
        Neighbours to either side.
    """
    sums = np.concatenate([[0.0], np.cumsum(power)])
    at = np.arange(len(power))
    low, high = np.maximum(at - near, 0), np.minimum(at + near + 1, len(power))
    return (sums[high] - sums[low]) / (high - low)
