"""Rates of measured signals: smoothing and differentiation of one run, tuned by the signal itself."""

import importlib
import warnings
from collections.abc import Sequence
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np

from pamid.errors import (
    NonFiniteError,
    ParameterError,
    SamplingError,
    SamplingWarning,
    ShapeError,
    ShortTrajectoryError,
    TimeOrderError,
    UnknownOptionError,
)

from ..names import require_one_of
from .noise import noise_level

METHODS = ("savgol", "spline", "kalman")
"""Names of the methods; each is a module of this package with `gain`, `smooth` and `CURVED_ENDS`."""

_JITTER = 1e-3
_WARN_JITTER = 0.25
_GAP = 20.0
_LONGEST_GRID = 20


class Grid(NamedTuple):
    """Sampling of one run."""

    period: float
    """Sampling period, s: the median step, or the mean of equal steps."""
    t: np.ndarray | None
    """Times from the first sample in units of the period; None for equal steps. Shape (n_samples,)."""


def _method(name: str) -> ModuleType:
    require_one_of(name, METHODS, f"method is {name!r}.", "Choose one of them.")
    return importlib.import_module(f"pamid.signals.{name}")


def sampling_grid(t: Any = None, sampling_period: float | None = None, *, warn: bool = True) -> Grid:
    """Return how a run is sampled."""
    if t is None:
        if sampling_period is None:
            raise ParameterError(
                "Neither t nor sampling_period is given.", "one of them", "Pass t or sampling_period, in s."
            )
        if not np.isfinite(sampling_period) or sampling_period <= 0:
            raise ParameterError(f"sampling_period is {sampling_period}.", "a positive time in s", "Correct it.")
        return Grid(float(sampling_period), None)
    t = np.asarray(t, dtype=float).ravel()
    if not np.isfinite(t).all():
        raise NonFiniteError(
            f"time has {int((~np.isfinite(t)).sum())} NaN or infinite values.", "finite times", "Remove these rows."
        )
    steps = np.diff(t)
    if not steps.size:
        return Grid(float(sampling_period or 1.0), None)
    if (bad := int((steps <= 0).sum())) > 0:
        row = int((steps <= 0).argmax()) + 1
        raise TimeOrderError(
            f"time does not increase at {bad} of {len(steps)} steps, first from {t[row - 1]:.6g} s to {t[row]:.6g} s "
            f"in row {row + 1}.",
            "times that increase within a run",
            "Sort by time and drop repeated times, or pass one run at a time.",
        )
    period = float(np.median(steps))
    if np.abs(steps - period).max() <= _JITTER * period + 4 * np.finfo(float).eps * np.abs(t).max():
        return Grid(float(t[-1] - t[0]) / len(steps), None)
    if warn and (said := irregularity(t)):
        warnings.warn(said, SamplingWarning, stacklevel=3)
    return Grid(period, (t - t[0]) / period)


def irregularity(t: np.ndarray) -> str | None:
    """Describe the irregularity of increasing times, if it deserves a warning."""
    steps = np.diff(t)
    if not steps.size:
        return None
    period = float(np.median(steps))
    if steps.max() > _GAP * period:
        longest = float(steps.max())
        return f"The longest step is {longest:.3g} s at a period of {period:.3g} s: rates across such gaps are guesses."
    share = float(np.mean(np.abs(steps - period) > _WARN_JITTER * period))
    if share > 0.01:
        return (
            f"{share:.0%} of the steps differ by more than {_WARN_JITTER:.0%} from the period of {period:.3g} s; rates "
            "are smoothed accordingly and given at the times of the samples."
        )
    return None


def differentiate(
    y: Any,
    t: Any = None,
    *,
    method: str = "savgol",
    tuning: str | float | Sequence[float] | np.ndarray = "auto",
    sampling_period: float | None = None,
    second: bool = False,
    warn: bool = True,
) -> tuple[np.ndarray, ...]:
    """Smooth the signals of one run and give their rates, at the given times and of the given length.

    Parameters
    ----------
    y : array_like, shape (n_samples,) or (n_samples, n_channels)
        Signals, any unit.
    t : array_like, shape (n_samples,), optional
        Times, s, increasing; unequal steps are allowed.
    method : {"savgol", "spline", "kalman"}, default="savgol"
        Savitzky-Golay filter (cubic), cubic smoothing spline, Kalman/RTS smoother of constant acceleration.
    tuning : "auto", float or sequence of float, default="auto"
        Cut-off frequency (gain 1/√2), Hz, one for all or one per channel; "auto": that of the least estimated error of
        the rate, for each channel on its own (`pamid.signals.tune_cutoff`).
    sampling_period : float, optional
        Time between samples, s, where there is no t.
    second : bool, default=False
        Whether to give the second rate too.
    warn : bool, default=True
        Whether to warn of irregular steps and gaps.

    Returns
    -------
    smoothed : ndarray, shape of y
        The smoothed signals, unit of y.
    rate : ndarray, shape of y
        Their rates, unit of y per s.
    second_rate : ndarray, shape of y
        With `second`: the rates of the rates, unit of y per s².

    Raises
    ------
    ShortTrajectoryError
        With fewer than 2 samples.
    NonFiniteError
        If y or t has NaN or infinite values.
    TimeOrderError
        If t does not increase.
    ParameterError
        If tuning, method or sampling period are invalid.

    Warns
    -----
    SamplingWarning
        If steps are irregular or there are gaps.

    Notes
    -----
    With unequal steps the spline uses the times as they are; the other methods work on equal steps of the median
    period, to which signals are carried by linear interpolation, and are read back by cubic Hermite interpolation.
    Below 8 samples a polynomial through all of them (of degree 2 at most) gives the rates.

    Examples
    --------
    >>> import numpy as np
    >>> from pamid.signals import differentiate
    >>> t = np.arange(0, 2, 1e-3)
    >>> noisy = np.sin(2 * np.pi * t) + 1e-3 * np.random.default_rng(0).standard_normal(t.size)
    >>> smoothed, rate = differentiate(noisy, t, method="kalman")
    >>> bool(np.std(rate - 2 * np.pi * np.cos(2 * np.pi * t)) < 0.1)
    True
    """
    module = _method(method)
    y, flat = _as_channels(y)
    grid = sampling_grid(t, sampling_period, warn=warn)
    n = len(y)
    if t is not None and np.size(t) != n:
        raise ShapeError(
            f"t has {np.size(t)} entries for {n} samples.", "one time per sample", "Pass times of one run."
        )
    if n < 8:
        results = _few(y, grid)
    else:
        equal, back = _on_equal_steps(y, grid, method)
        cutoffs = _cutoffs(tuning, y, grid, method)
        results = _smooth_channels(module, equal, cutoffs * grid.period, grid if back is None else None)
        if back is not None:
            results = _read_back(results, back)
    smoothed, rate, rate2 = results[0], results[1] / grid.period, results[2] / grid.period**2
    out = (smoothed, rate, rate2) if second else (smoothed, rate)
    return tuple(x[:, 0] for x in out) if flat else out


def tune_cutoff(
    signals: Any, times: Any = None, *, method: str = "savgol", sampling_period: float | None = None
) -> float:
    """Choose the cut-off frequency of a signal recorded over one or several runs.

    Parameters
    ----------
    signals : array_like, shape (n_samples,), or list of them
        One signal; a list holds one array per run.
    times : array_like or list of them, optional
        Times, s, likewise.
    method : {"savgol", "spline", "kalman"}, default="savgol"
        The method that will smooth.
    sampling_period : float, optional
        Time between samples, s, where there are no times.

    Returns
    -------
    float
        Cut-off frequency, Hz, with the least estimated squared error of the rate: Stein's unbiased risk estimate
        for the derivative, with the noise level estimated from the signal itself.

    Examples
    --------
    >>> import numpy as np
    >>> from pamid.signals import tune_cutoff
    >>> t = np.arange(0, 4, 1e-3)
    >>> noise = np.random.default_rng(0).standard_normal(t.size)
    >>> slow, fast = (tune_cutoff(np.sin(w * t) + 1e-2 * noise, t) for w in (3, 60))
    >>> slow < fast
    True
    """
    module = _method(method)
    single = not isinstance(signals, list | tuple) or not np.ndim(signals[0])
    runs = [signals] if single else list(signals)
    clocks = ([times] if single else list(times)) if times is not None else [None] * len(runs)
    channels = [_as_channels(y)[0][:, 0] for y in runs]
    return _tuned(module, channels, [sampling_grid(t, sampling_period, warn=False) for t in clocks])


def _tuned(module: ModuleType, runs: Sequence[np.ndarray], grids: Sequence[Grid]) -> float:
    """Return the best cut-off frequency of one channel over its runs."""
    from .tuning import tune

    both = list(zip(runs, grids, strict=True))
    equal = [_on_equal_steps(y[:, None], grid, "savgol")[0][:, 0] for y, grid in both]
    noises = [_noise(y, grid) for y, grid in both]
    return tune(equal, [grid.period for grid in grids], module.gain, noises, curved_ends=module.CURVED_ENDS)


def _as_channels(y: Any) -> tuple[np.ndarray, bool]:
    y = np.asarray(y, dtype=float)
    if y.ndim not in (1, 2):
        raise ShapeError(f"y has {y.ndim} dimensions.", "(n_samples,) or (n_samples, n_channels)", "Reshape it.")
    flat = y.ndim == 1
    y = y[:, None] if flat else y
    if len(y) < 2:
        raise ShortTrajectoryError(
            f"The run has {len(y)} sample{'s' if len(y) != 1 else ''}.",
            "at least 2 samples for a rate",
            "Leave this run out.",
        )
    if not np.isfinite(y).all():
        row, channel = np.argwhere(~np.isfinite(y))[0]
        raise NonFiniteError(
            f"The signal has {int((~np.isfinite(y)).sum())} NaN or infinite values, first in row {row + 1} of channel "
            f"{channel}.",
            "finite values",
            "Fill in or drop these rows first.",
        )
    return y, flat


def _few(y: np.ndarray, grid: Grid) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    t = np.arange(len(y), dtype=float) if grid.t is None else grid.t
    middle = t.mean()
    powers = np.vander(t - middle, min(len(y), 3), increasing=True)
    c = np.linalg.lstsq(powers, y, rcond=None)[0]
    c = np.concatenate([c, np.zeros((3 - len(c), y.shape[1]))])
    x = (t - middle)[:, None]
    return c[0] + c[1] * x + c[2] * x**2, c[1] + 2 * c[2] * x, 2 * c[2] + 0 * x


def _on_equal_steps(y: np.ndarray, grid: Grid, method: str) -> tuple[np.ndarray, np.ndarray | None]:
    """Interpolate signals to equal steps; the spline needs none. Return the original times in steps, or None."""
    if grid.t is None or method == "spline":
        return y, None
    last = grid.t[-1]
    count = round(last) + 1
    if count > _LONGEST_GRID * len(y) + 1000:
        raise SamplingError(
            f"The run lasts {count} sampling periods and has {len(y)} samples.",
            "no gaps longer than the data between them",
            "Split the run at its gaps, or use method='spline'.",
        )
    steps = np.linspace(0.0, last, max(count, 8))
    equal = np.stack([np.interp(steps, grid.t, channel) for channel in y.T], axis=1)
    return equal, grid.t * ((len(steps) - 1) / last)


def _noise(y: np.ndarray, grid: Grid) -> float:
    """Noise level of one channel after interpolation to equal steps, where close samples count less."""
    if grid.t is None:
        return noise_level(y)
    weight = np.gradient(grid.t)
    return noise_level(y, grid.t) * float(np.sqrt(np.mean(weight**2)) / np.mean(weight))


def _cutoffs(tuning: Any, y: np.ndarray, grid: Grid, method: str) -> np.ndarray:
    channels = y.shape[1]
    if isinstance(tuning, str):
        if tuning != "auto":
            raise UnknownOptionError(f"tuning is {tuning!r}.", "'auto' or a cut-off frequency in Hz", "Correct it.")
        return np.array([_tuned(_method(method), [channel], [grid]) for channel in y.T])
    cutoffs = np.atleast_1d(np.asarray(tuning, dtype=float))
    if cutoffs.shape not in ((1,), (channels,)) or not np.isfinite(cutoffs).all() or (cutoffs <= 0).any():
        raise ParameterError(
            f"tuning is {tuning!r}.",
            f"'auto', or a positive cut-off frequency in Hz, one for all or one for each of {channels} channels",
            "Correct it.",
        )
    return np.broadcast_to(cutoffs, (channels,))


def _smooth_channels(
    module: ModuleType, y: np.ndarray, cutoffs: np.ndarray, grid: Grid | None
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Smooth the channels that share a cut-off together."""
    results = tuple(np.empty_like(y) for _ in range(3))
    extra = {"t": grid.t} if grid is not None and grid.t is not None else {}
    for cutoff in np.unique(cutoffs):
        channels = np.flatnonzero(cutoffs == cutoff)
        for whole, part in zip(results, module.smooth(y[:, channels], min(float(cutoff), 0.45), **extra), strict=True):
            whole[:, channels] = part
    return results  # type: ignore[return-value]


def _read_back(results: tuple[np.ndarray, ...], at: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Interpolate from equal steps to the given times, in steps."""
    from scipy.interpolate import CubicHermiteSpline, make_interp_spline

    value, rate, second = results
    steps = np.arange(len(value))
    carried = CubicHermiteSpline(steps, value, rate)(at), CubicHermiteSpline(steps, rate, second)(at)
    return *carried, make_interp_spline(steps, second, k=1)(at)
