"""Is what a model leaves white, and unrelated to its inputs: the residual test of system identification."""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated, Any

import numpy as np

from ..errors import ShapeError, ShortTrajectoryError
from ..explained import explained_fields

_LEAST = 4  # rows of a run for each lag looked at, at least


@explained_fields
@dataclass(frozen=True)
class ResidualTest:
    """Correlations of a residual with itself and with inputs, with the bands that chance alone would keep to.

    Examples
    --------
    >>> import numpy as np
    >>> from pamid.compare.whiteness import residual_test
    >>> e = np.random.default_rng(0).standard_normal(2000)
    >>> test = residual_test(e, {}, lags=20)
    >>> round(float(test.auto[0]), 9), test.p_white > 0.01
    (1.0, True)
    """

    lags: Annotated[np.ndarray, "Lags of the autocorrelation, rows, from 0; shape (n_lags + 1,)."]
    auto: Annotated[np.ndarray, "Autocorrelation of the residual, 1 at lag 0; shape (n_lags + 1,)."]
    auto_band: Annotated[
        float, "Half width of its band: a white residual stays within at each lag with probability `level`."
    ]
    cross_lags: Annotated[
        np.ndarray,
        "Lags of the cross-correlations; at positive ones the residual comes after the input; shape (2 n_lags + 1,).",
    ]
    cross: Annotated[dict[str, np.ndarray], "Correlation of the residual with each input; shape (2 n_lags + 1,)."]
    cross_band: Annotated[
        dict[str, float],
        "Half width of the band of a residual that is independent of the input, given the colour of both.",
    ]
    p_white: Annotated[float, "Probability of as much autocorrelation in a white residual (Ljung-Box)."]
    p_input: Annotated[
        dict[str, float], "Probability of as much correlation at lags 0 and above with an input that has no influence."
    ]
    interval: Annotated[float, "Time between rows, s."]
    level: Annotated[float, "Probability of the bands at each lag."]
    n_rows: Annotated[int, "Rows used."]

    def outside(self, name: str | None = None) -> int:
        """Return how many lags leave the band: of the autocorrelation, or of an input from lag 0 on."""
        if name is None:
            return int(np.sum(np.abs(self.auto[1:]) > self.auto_band))
        later = self.cross[name][self.cross_lags >= 0]
        return int(np.sum(np.abs(later) > self.cross_band[name]))

    def as_dict(self) -> dict[str, Any]:
        """Return the test as plain numbers."""
        return {
            "n_rows": self.n_rows,
            "interval": self.interval,
            "level": self.level,
            "whiteness": {
                "lags": self.lags.tolist(),
                "correlation": self.auto.tolist(),
                "band": self.auto_band,
                "outside": self.outside(),
                "p_value": self.p_white,
            },
            "inputs": {
                name: {
                    "lags": self.cross_lags.tolist(),
                    "correlation": self.cross[name].tolist(),
                    "band": self.cross_band[name],
                    "outside": self.outside(name),
                    "p_value": self.p_input[name],
                }
                for name in self.cross
            },
        }


def residual_test(
    residual: Any,
    inputs: Mapping[str, Any],
    groups: Any = None,
    *,
    lags: int = 25,
    interval: float = 1.0,
    level: float = 0.99,
) -> ResidualTest:
    r"""Test whether a residual is white and uncorrelated with inputs; correlations stay within runs.

    .. math::

        \hat r_e(k) = \frac{\sum_t e_t e_{t-k}}{\sum_t e_t^2}, \qquad
        Q = N (N + 2) \sum_{k=1}^{M} \frac{\hat r_e(k)^2}{N - k} \sim \chi^2_M, \qquad
        \xi_u = N\,\hat r_{eu}^T \hat P^{-1} \hat r_{eu} \sim \chi^2_{M + 1}, \quad
        \hat P_{ij} = \sum_\tau \hat r_e(\tau)\,\hat r_u(\tau + i - j)

    Parameters
    ----------
    residual : array_like, shape (n_samples,)
        Measured less modelled, evenly sampled within each run.
    inputs : mapping of str to array_like, shape (n_samples,)
        Signals that the model reads; constant or mostly missing ones are left out.
    groups : array_like, shape (n_samples,), optional
        Run of each row, contiguous; without it all rows are one run.
    lags : int, default=25
        Largest lag, rows.
    interval : float, default=1.0
        Time between rows, s.
    level : float, default=0.99
        Probability with which chance stays within a band, at each lag.

    Returns
    -------
    ResidualTest
        Correlations and bands.

    Raises
    ------
    ShapeError
        If lengths differ.
    ShortTrajectoryError
        If no run is four times as long as the lags.

    References
    ----------
    L. Ljung, "System Identification: Theory for the User", 2nd edition, Prentice Hall, 1999, section 16.6.

    G. M. Ljung, G. E. P. Box, "On a measure of lack of fit in time series models", Biometrika 65(2), 1978.
    https://doi.org/10.1093/biomet/65.2.297

    Examples
    --------
    >>> import numpy as np
    >>> from pamid.compare.whiteness import residual_test
    >>> rng = np.random.default_rng(0)
    >>> u = rng.standard_normal(2000)
    >>> e = rng.standard_normal(2000) + 0.3 * np.roll(u, 3)  # what comes 3 rows after u is not modelled
    >>> test = residual_test(e, {"u": u}, lags=10)
    >>> int(test.cross_lags[np.argmax(test.cross["u"])]), test.p_input["u"] < 0.001
    (3, True)
    """
    from scipy.stats import chi2, norm

    e = np.asarray(residual, dtype=float)
    given = {str(name): np.asarray(x, dtype=float) for name, x in inputs.items()}
    if any(len(x) != len(e) for x in given.values()) or (groups is not None and len(groups) != len(e)):
        raise ShapeError("residual, inputs and groups differ in length.", "one entry a row in each", "Correct them.")
    runs = _runs(e, groups, lags)
    if not runs:
        longest = max((b - a for a, b in _edges(e, groups)), default=0)
        raise ShortTrajectoryError(
            f"The longest run has {longest} rows.",
            f"{_LEAST * lags} rows for {lags} lags",
            f"Look at {max(longest // _LEAST, 1)} lags at most (--lags).",
        )
    n = sum(r.stop - r.start for r in runs)
    reach = max(lags, min(10 * lags, max(r.stop - r.start for r in runs) // _LEAST))
    mean = float(np.mean(np.concatenate([e[r] for r in runs])))
    parts = [e[r] - mean for r in runs]
    auto = _correlation(parts, parts, reach)[reach:]
    z = float(norm.ppf(0.5 + level / 2))
    k = np.arange(1, lags + 1)
    Q = n * (n + 2) * float(np.sum(np.square(auto[1 : lags + 1]) / (n - k)))
    cross, band, p_input = {}, {}, {}
    for name, x in given.items():
        both = runs if np.all(np.isfinite(x)) else _runs(e + x, groups, lags)
        centre = float(np.mean(np.concatenate([x[r] for r in both]))) if both else 0.0
        others = [x[r] - centre for r in both]
        if not any(np.any(o) for o in others):
            continue  # stands still or is not known: nothing can be said of it
        parts, m = [e[r] - mean for r in both], sum(r.stop - r.start for r in both)
        c = _correlation(parts, others, lags)
        spread = _joint_spread(auto, _correlation(others, others, reach)[reach:], lags)
        later = c[lags:]
        xi = m * float(later @ np.linalg.pinv(spread, hermitian=True, rcond=1e-8) @ later)
        cross[name], band[name] = c, z * float(np.sqrt(spread[0, 0] / m))
        p_input[name] = float(chi2.sf(xi, np.linalg.matrix_rank(spread, hermitian=True, rtol=1e-8)))
    return ResidualTest(
        np.arange(lags + 1), auto[: lags + 1], z / float(np.sqrt(n)), np.arange(-lags, lags + 1), cross, band,
        float(chi2.sf(Q, lags)), p_input, float(interval), float(level), n,
    )  # fmt: skip


def _runs(e: np.ndarray, groups: Any, lags: int) -> list[slice]:
    """Return the rows of each run without a hole that is long enough for the lags."""
    return [slice(a, b) for a, b in _edges(e, groups) if b - a >= _LEAST * lags]


def _edges(e: np.ndarray, groups: Any) -> list[tuple[int, int]]:
    """Return first and last row of each run, cut as well where the residual is not known."""
    names = np.zeros(len(e)) if groups is None else np.asarray(groups)
    known = np.isfinite(e)
    breaks = np.flatnonzero((names[1:] != names[:-1]) | (known[1:] != known[:-1])) + 1
    ends = [0, *breaks.tolist(), len(e)]
    return [(a, b) for a, b in pairwise(ends) if b > a and known[a]]


def _correlation(left: list[np.ndarray], right: list[np.ndarray], reach: int) -> np.ndarray:
    """Return the correlation of left now with right k rows before, k from -reach to reach, over all runs."""
    from scipy.signal import correlate

    total = np.zeros(2 * reach + 1)
    for a, b in zip(left, right, strict=True):
        whole = correlate(a, b, mode="full", method="fft")  # entry len(b) - 1 + k: sum of a[t] b[t - k]
        at, room = len(b) - 1, min(reach, len(a) - 1)
        total[reach - room : reach + room + 1] += whole[at - room : at + room + 1]
    size = np.sqrt(sum(float(a @ a) for a in left) * sum(float(b @ b) for b in right))
    return total / size if size > 0 else total


def _joint_spread(auto: np.ndarray, other: np.ndarray, lags: int) -> np.ndarray:
    """Return the covariance, times n, of correlations at lags 0 to `lags` of two signals that are unrelated."""
    from scipy.linalg import toeplitz

    reach = len(auto) - 1
    taper = 1.0 - np.arange(reach + 1) / (reach + 1)
    a, b = auto * taper, other * taper
    two = np.concatenate([a[:0:-1], a])
    both = np.concatenate([b[:0:-1], b])
    sums = np.convolve(two, both[::-1])
    middle = len(sums) // 2
    return np.asarray(toeplitz(sums[middle : middle + lags + 1]))
