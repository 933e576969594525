r"""Has the relation that a model describes changed, at a stated rate of false alarms: a rank CUSUM over blocks.

What a model leaves is neither white nor alike everywhere: hysteresis, friction and whatever else it lacks leave loops.
So a squared residual is divided by what residuals of a healthy stretch are at like signals, and means over blocks are
compared with those of the healthy stretch by their rank alone. With g the growth of an error that counts as a change,

.. math:: C_k = \max\bigl(0,\; C_{k-1} + \ln\kappa - (1 - \kappa) \ln p_k\bigr), \qquad
    p_k = \frac{1 + \#\{i : g^2 s_i \ge s_k\}}{n + 1}.

Without a change the ranks' distribution does not depend on that of the residuals. The threshold of C is therefore found
by simulating streams of ranks, n healthy blocks each, as autocorrelated as the blocks of the healthy stretch are, and
letting as many of them alarm as is allowed.

References
----------
V. Vovk, A. Gammerman, G. Shafer, "Algorithmic Learning in a Random World", 2nd ed., Springer 2022, chapter 8.

A. D. Sokal, "Monte Carlo methods in statistical mechanics", in: Functional Integration, NATO ASI Series B 361, 1997.
https://doi.org/10.1007/978-1-4899-0319-8_6
"""

import warnings
from typing import Any, Self

import numpy as np

from ..errors import ParameterError, StreamChangeWarning

KAPPA = 0.2
"""Exponent of the evidence of a rank, dimensionless."""

NEAR = 20
"""Healthy rows at similar signals that give the expected residual."""

KEPT = 4_000
"""Healthy rows that are kept for it."""

BLOCKS = 60
"""Blocks of a healthy stretch: as few, and so as long, as allow four later ones in a row to be distinguished."""

TIMES = 2.0
"""Least length of a block in integrated autocorrelation times; the remaining correlation raises the threshold."""

STREAMS = 5_000
"""Streams that are simulated to find the threshold."""

AT_ONCE = 500
"""Streams that are simulated together."""

NOT_SIGNALS = ("time", "trajectory")


class ChangeMonitor:
    """Watch whether a fitted model still describes the stream; the model is not updated.

    ``calibrate`` takes a healthy stretch in time order that the model was not fitted on, ``update`` what comes next. An
    alarm is a reason to look: what to do, such as a new ``fit`` on the rows since, is for the user to decide. A
    block, a sixtieth of the healthy stretch, adds at most 1.7 to the evidence, so an alarm takes at least
    `threshold` / 1.7 blocks, often three or four.

    Parameters
    ----------
    model : object
        Anything with ``predict(X)``.
    sampling_interval : float, default=0.001
        s.
    false_alarms : float, default=0.01
        Share of streams of length `per` without a change in which an alarm is allowed, dimensionless.
    per : float, default=600.0
        s.
    growth : float, default=1.25
        What counts as a change: errors at similar signals larger by this factor, dimensionless. Smaller variations with
        the motion are tolerated.
    random_state : int, default=0
        Seed of the simulated streams.

    Attributes
    ----------
    block : int
        Samples of a block.
    correlation : float
        Correlation of neighbouring blocks of the healthy stretch, and a standard error.
    threshold : float
        Threshold of the evidence.
    evidence : float
        Present evidence, a sum over blocks that cannot fall below zero, dimensionless.
    changed_at : float or None
        Seconds of stream before the blocks that raised the alarm began; None without an alarm.
    n_left_out : int
        Blocks of the stream that held too few rows like those of the healthy stretch to be judged.

    Examples
    --------
    >>> import numpy as np
    >>> from pamid.estimators import PolynomialForce
    >>> from pamid.online import ChangeMonitor
    >>> t = np.arange(0, 240, 0.02)
    >>> X = np.column_stack([0.1 + 0.05 * np.sin(2.3 * t), 3e5 + 1e5 * np.sin(3.1 * t)])
    >>> F = 5e-4 * X[:, 1] - 300 * X[:, 0] + np.random.default_rng(0).normal(0, 2, len(t))
    >>> model = PolynomialForce(signals={"eps": 0, "P": 1}).fit(X[:3000], F[:3000])
    >>> monitor = ChangeMonitor(model, sampling_interval=0.02).calibrate(X[3000:8000], F[3000:8000])
    >>> monitor.update(X[8000:10000], F[8000:10000])
    False
    >>> monitor.update(X[10000:], 1.1 * F[10000:]), round(monitor.changed_at)
    (True, 40)
    """

    def __init__(
        self,
        model: Any,
        *,
        sampling_interval: float = 1e-3,
        false_alarms: float = 0.01,
        per: float = 600.0,
        growth: float = 1.25,
        random_state: int = 0,
    ) -> None:
        if not (0.0 < false_alarms < 1.0 and 0.0 < sampling_interval < per < np.inf and 1.0 <= growth < np.inf):
            raise ParameterError(
                f"false_alarms={false_alarms!r}, sampling_interval={sampling_interval!r}, per={per!r}, "
                f"growth={growth!r}.",
                "a share between 0 and 1, an interval below the span, both in s, and a growth of at least 1",
                "Correct them.",
            )
        self.model = model
        self.sampling_interval = sampling_interval
        self.false_alarms = false_alarms
        self.per = per
        self.growth = growth
        self.random_state = random_state

    def calibrate(self, X: Any, y: Any) -> Self:
        """Learn the model's residuals on healthy data in time order, rows that it was not fitted on; return itself.

        A stretch that is too short for the correlation time of its residuals raises a `ParameterError`.
        """
        signals, squares = self._residuals(X, y)
        known = np.isfinite(squares)
        if known.sum() < 2 * BLOCKS:
            raise ParameterError(
                f"The healthy stretch has {known.sum()} rows.", f"at least {2 * BLOCKS}", "Give a longer one."
            )
        self._floor = 1e-3 * float(squares[known].mean()) + np.finfo(float).tiny
        memory = autocorrelation_time(np.sqrt(np.where(known, squares, squares[known].mean())))
        n, self.block = BLOCKS, len(squares) // BLOCKS
        if self.block < TIMES * memory:
            raise ParameterError(
                f"The healthy stretch is {len(squares) * self.sampling_interval:.3g} s long, and the model's errors "
                f"are correlated over {memory * self.sampling_interval:.3g} s.",
                f"at least {TIMES * BLOCKS * memory * self.sampling_interval:.3g} s",
                "Give a longer stretch (--learn of the command), or a model with smaller errors.",
            )
        owner = np.minimum(np.arange(len(squares)) // self.block, n - 1)
        self._learn_place(signals, squares, owner, known)
        ratio = self._ratio(signals, squares, owner)
        blocks = np.array([self._statistic(ratio[owner == k]) for k in range(n)])
        blocks = blocks[np.isfinite(blocks)]
        self._healthy, self.correlation = np.sort(blocks), rank_autocorrelation(blocks)
        spans = int(np.ceil(self.per / (self.block * self.sampling_interval)))
        self.threshold = limit(len(blocks), spans, self.correlation, self.false_alarms, self.random_state)
        return self.restart()

    def restart(self) -> Self:
        """Forget the stream and any alarm, but not the healthy stretch; return itself."""
        self.evidence, self.n_left_out = 0.0, 0
        self.changed_at: float | None = None
        self._waiting = np.empty(0)
        self._n_blocks, self._began = 0, 0
        return self

    def update(self, X: Any, y: Any) -> bool:
        """Take the samples that follow, as in `calibrate`; return whether the stream has changed since, now or before.

        A `StreamChangeWarning` says so once, when it is detected.
        """
        if not hasattr(self, "threshold"):
            raise ParameterError("The monitor is not calibrated.", "a healthy stretch first", "Call calibrate.")
        signals, squares = self._residuals(X, y)
        self._waiting = np.concatenate([self._waiting, self._ratio(signals, squares, None)])
        while len(self._waiting) >= self.block:
            self._take(self._statistic(self._waiting[: self.block]))
            self._waiting = self._waiting[self.block :]
        return self.changed_at is not None

    def _take(self, statistic: float) -> None:
        """Take a block."""
        self._n_blocks += 1
        if not np.isfinite(statistic):
            self.n_left_out += 1
            return
        if self.evidence == 0.0:
            self._began = self._n_blocks - 1
        as_large = len(self._healthy) - int(np.searchsorted(self._healthy, statistic / self.growth**2))
        gain = evidence((1.0 + as_large) / (len(self._healthy) + 1.0))
        self.evidence = max(0.0, self.evidence + float(gain))
        if self.evidence > self.threshold and self.changed_at is None:
            self.changed_at = self._began * self.block * self.sampling_interval
            warnings.warn(
                f"The stream has changed at about {self.changed_at:.3g} s: at the same signals the model's error is at "
                f"least {self.growth:g} times what it was. Expected without a change in {self.false_alarms:.3g} of "
                f"streams of {self.per:.3g} s. Check the sensors; if the muscle was replaced, fit again on the rows "
                "since.",
                StreamChangeWarning,
                stacklevel=3,
            )

    # --- residuals at like signals ------------------------------------------------------------------------------
    def _residuals(self, X: Any, y: Any) -> tuple[np.ndarray, np.ndarray]:
        """Return the signals, shape (n_samples, n_signals), and the squared residuals."""
        named = getattr(X, "columns", None)
        signals = X if named is None else X[[c for c in named if c not in NOT_SIGNALS]]
        residual = np.asarray(y, dtype=float) - np.asarray(self.model.predict(X), dtype=float)
        return np.asarray(signals, dtype=float), np.square(residual)

    def _learn_place(self, signals: np.ndarray, squares: np.ndarray, owner: np.ndarray, known: np.ndarray) -> None:
        """Keep rows of the healthy stretch, and learn how near to each other they are."""
        from sklearn.neighbors import KDTree

        usable = np.flatnonzero(known & np.isfinite(signals).all(axis=1))
        kept = usable[np.unique(np.linspace(0, len(usable) - 1, min(KEPT, len(usable))).astype(int))]
        self._centre = signals[usable].mean(axis=0)
        self._width = np.maximum(signals[usable].std(axis=0), 1e-12 * np.abs(self._centre) + np.finfo(float).tiny)
        self._tree = KDTree((signals[kept] - self._centre) / self._width)
        self._squares, self._owner = squares[kept], owner[kept]
        self._reach = np.inf
        self._reach = float(np.quantile(self._neighbours(signals[kept], self._owner)[1], 0.99))

    def _neighbours(self, signals: np.ndarray, owner: np.ndarray | None) -> tuple[np.ndarray, np.ndarray]:
        """Return the mean square of healthy residuals near each row, of other blocks than its own, and how near."""
        # Rows of the own block are near in time, and as many as may lie between others.
        spare = 0 if owner is None else int(np.bincount(self._owner).max())
        most = min(NEAR + spare, len(self._squares))
        distance, near = self._tree.query((signals - self._centre) / self._width, k=most)
        if owner is not None:
            other = self._owner[near] != owner[:, None]
            first = np.argsort(~other, axis=1, kind="stable")[:, :NEAR]
            near, distance = np.take_along_axis(near, first, axis=1), np.take_along_axis(distance, first, axis=1)
        return self._squares[near].mean(axis=1), distance[:, -1]

    def _ratio(self, signals: np.ndarray, squares: np.ndarray, owner: np.ndarray | None) -> np.ndarray:
        """Return squared residuals in units of healthy ones at like signals; NaN where there are none."""
        out = np.full(len(squares), np.nan)
        known = np.flatnonzero(np.isfinite(squares) & np.isfinite(signals).all(axis=1))
        if len(known):
            usual, far = self._neighbours(signals[known], None if owner is None else owner[known])
            out[known] = np.where(far <= self._reach, squares[known] / (usual + self._floor), np.nan)
        return out

    @staticmethod
    def _statistic(ratio: np.ndarray) -> float:
        """Return the mean of a block; NaN where less than half of it may be judged."""
        known = np.isfinite(ratio)
        return float(ratio[known].mean()) if 2 * known.sum() > len(ratio) else float("nan")


def evidence(p: Any) -> Any:
    """Return the evidence of a rank p for a change, log κ p^(κ−1); its exponential has mean at most 1 without one."""
    return np.log(KAPPA) - (1.0 - KAPPA) * np.log(p)


def autocorrelation_time(x: np.ndarray) -> float:
    """Return the integrated autocorrelation time of a series, samples: 1 + 2 Σ ρ, summed over five such times."""
    x = x - x.mean()
    size = 1 << (2 * len(x) - 1).bit_length()
    covariance = np.fft.irfft(np.abs(np.fft.rfft(x, size)) ** 2, size)[: len(x)]
    if covariance[0] <= 0:
        return 1.0
    times = 2.0 * np.cumsum(covariance / covariance[0]) - 1.0
    enough = np.flatnonzero(np.arange(len(x)) >= 5.0 * times)
    return float(max(times[enough[0]] if len(enough) else len(x), 1.0))


def rank_autocorrelation(x: np.ndarray) -> float:
    """Return the rank correlation of neighbouring values plus a standard error, at least 0."""
    ranks = np.argsort(np.argsort(x)) - (len(x) - 1) / 2.0
    return float(np.clip(ranks[1:] @ ranks[:-1] / (ranks @ ranks) + 1.0 / np.sqrt(len(x)), 0.0, 0.95))


def limit(n_healthy: int, n_blocks: int, correlation: float, share: float, seed: int) -> float:
    """Return the quantile of C over streams without a change, by simulation."""
    rng = np.random.default_rng(seed)
    most = [_highest(n_healthy, n_blocks, correlation, rng) for _ in range(0, STREAMS, AT_ONCE)]
    return float(np.quantile(np.concatenate(most), 1.0 - share))


def _highest(n_healthy: int, n_blocks: int, correlation: float, rng: np.random.Generator) -> np.ndarray:
    """Simulate some streams without a change; return the highest C of each."""
    x = rng.standard_normal((n_healthy + n_blocks, AT_ONCE))
    x[1:] *= np.sqrt(1.0 - correlation**2)
    for k in range(1, len(x)):
        x[k] += correlation * x[k - 1]
    healthy, later = np.sort(x[:n_healthy].T, axis=1), x[n_healthy:].T
    as_large = n_healthy - np.array([np.searchsorted(h, v) for h, v in zip(healthy, later, strict=True)])
    gains = evidence((1.0 + as_large) / (n_healthy + 1.0))
    level = most = np.zeros(AT_ONCE)
    for gain in gains.T:
        level = np.maximum(0.0, level + gain)
        most = np.maximum(most, level)
    return most
