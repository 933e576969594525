"""The noise of a signal, estimated from the signal itself."""

import numpy as np

DIFFERENCE = 20.0**0.5
"""Standard deviation of the third difference of white noise of unit variance, √(1 + 9 + 9 + 1)."""
_MAD = 0.6744897501960817
"""Median of the absolute value of a standard normal variable."""
SPREAD = 1.49
"""Standard deviation of `white_noise` relative to the noise, times the root of the number of rows: 3,000 draws of 100
to 3,200 rows (tests/signals/test_noise.py)."""
_EXACT, _SHARED = 1e-9, 1e-6  # rounding of numbers as a share of the largest; smallest step as a share of the range
_CLOSE, _FEW = 3.5, 40  # steps that four samples span at most, and how many such fours are enough


def third_differences(x: np.ndarray, at: np.ndarray | None = None) -> np.ndarray:
    """Return the third differences of samples, or their substitute for unequal steps."""
    if at is None:
        return np.diff(x, 3)
    span = at[3:] - at[:-3]
    if not len(span):
        return np.zeros(0)
    # Motion grows with the cube of the span: only the closest samples show noise, but a few dozen are needed.
    close = np.flatnonzero(span <= max(_CLOSE, float(np.partition(span, k := min(_FEW, len(span)) - 1)[k])))
    rows = close[:, None] + np.arange(4)
    t, weights = at[rows], np.ones((len(close), 4))
    for i in range(4):
        for k in range(4):
            if k != i:
                weights[:, i] /= t[:, i] - t[:, k]
    weights *= DIFFERENCE / np.linalg.norm(weights, axis=1, keepdims=True)
    return np.asarray(np.sum(weights * x[rows], axis=1))


def white_noise(differences: np.ndarray) -> float:
    """Return the deviation of white noise from third differences, σ̂ = median(|Δ³y|) / (0.6745 √20)."""
    return median(np.abs(differences)) / _MAD / DIFFERENCE


def median(x: np.ndarray) -> float:
    """Return the median of a few thousand numbers as `numpy.median` does, in a fifth of its time."""
    n = len(x)
    if n < 3 or np.isnan(x @ x):
        return float(np.median(x))
    middle = n // 2
    ordered = np.partition(x, (middle - 1, middle))
    return float(ordered[middle] if n % 2 else 0.5 * (ordered[middle - 1] + ordered[middle]))


def quantisation_step(y: np.ndarray) -> float:
    """Return the step of a quantised signal, 0 if there is none.

    The step is the smallest difference between neighbouring levels, kept if nine in ten differences between successive
    samples are whole multiples of it, and levels are ten times fewer than samples.
    """
    y = np.asarray(y, dtype=float).ravel()
    levels = np.unique(y)
    if len(levels) < 3 or len(levels) > len(y) / 3:
        return 0.0
    spacing = np.diff(levels)
    # Rounding in the last digits splits one level into several: only differences well above it count.
    spacing = spacing[spacing > 1e-9 * max(abs(levels[0]), abs(levels[-1]))]
    if not spacing.size:
        return 0.0
    step = float(np.median(spacing[spacing < 1.5 * spacing.min()]))
    multiples = np.diff(levels) / step
    return step if np.mean(np.abs(multiples - np.round(multiples)) < 0.05) >= 0.9 else 0.0


def common_step(y: np.ndarray) -> float:
    """Return the largest step of which all differences between levels are multiples, 0 where they share none.

    A column that is written with three decimals has steps of 0.001, or multiples of it.
    """
    levels = np.unique(np.asarray(y, dtype=float))
    left = np.diff(levels)
    if not left.size:
        return 0.0
    least = _EXACT * max(abs(levels[0]), abs(levels[-1]))
    while True:  # Euclid's algorithm, of all differences at once
        step = float(left.min())
        if step < _SHARED * float(levels[-1] - levels[0]):
            return 0.0
        rest = np.remainder(left, step)
        rest = np.unique(rest[(rest > least) & (step - rest > least)])
        if not rest.size:
            return step
        left = np.append(rest, step)


def noise_level(y: np.ndarray, t: np.ndarray | None = None) -> float:
    """Estimate the standard deviation of white noise on a signal.

    Parameters
    ----------
    y : ndarray, shape (n_samples,)
        A signal, in any unit.
    t : ndarray, shape (n_samples,), optional
        Increasing times, if the steps are not equal.

    Returns
    -------
    float
        Standard deviation of the noise, in the unit of y; at least that of the signal's own quantisation, Δ/√12.

    Notes
    -----
    `white_noise` of the third differences. With unequal steps these are replaced by the residuals from the line through
    both neighbours, divided by their spread √(1 + a² + b²) (Gasser, Sroka and Jennen-Steinmetz 1986, DOI
    10.1093/biomet/73.3.625).

    Examples
    --------
    >>> import numpy as np
    >>> from pamid.signals import noise_level
    >>> rng = np.random.default_rng(0)
    >>> t = np.linspace(0, 1, 20_000)
    >>> round(noise_level(np.sin(20 * t) + 0.01 * rng.standard_normal(t.size)), 3)
    0.01
    """
    y = np.asarray(y, dtype=float).ravel()
    if len(y) < 5:
        return 0.0
    if t is None:
        sigma = white_noise(third_differences(y))
    else:
        a = (t[2:] - t[1:-1]) / (t[2:] - t[:-2])
        residual = (a * y[:-2] + (1 - a) * y[2:] - y[1:-1]) / np.sqrt(1 + a * a + (1 - a) ** 2)
        sigma = float(np.median(np.abs(residual))) / _MAD
    return max(sigma, quantisation_step(y) / 12.0**0.5)
