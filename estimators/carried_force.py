"""Force of a muscle by named effects and an equivalent pressure, carried from another muscle by geometry."""

from __future__ import annotations

import warnings
from dataclasses import KW_ONLY, field
from typing import Any, ClassVar, Self

import numpy as np
from sklearn.frozen import FrozenEstimator

from pamid.adapters._named_process import (
    BAR,
    Amplitudes,
    BraidLaw,
    CarriedLaw,
    HeldOut,
    NamedProcess,
    NamedRows,
    fit_process,
)
from pamid.constants import ATMOSPHERIC_PRESSURE
from pamid.effects._equivalent import MEMORIES, ROUGH, pasts
from pamid.errors import AdaptationWarning, FitError, IncompatibleError

from ._base import SignalRegressor
from ._blend import share_of_fresh
from ._checks import check_counts, check_sizes
from ._effects import whole_log
from ._parameters import parameters
from ._source import inside
from ._streaming import Streaming
from ._trajectories import trajectory_codes

BRAID_UNITS = ("m²", "m²", "m²", "N", "N", "N")
CARRIED_UNITS = ("-", "-", "Pa", "Pa", "Pa", "N")
BEYOND_CHANCE = 2.0
"""Standard errors over runs by which a fit without the source must be better to get a share."""
CARRIED_SIZES = (1.0, 1.0, BAR, BAR / 0.1, BAR / 0.1**2)


@parameters
class CarriedForce(Streaming, SignalRegressor):
    r"""Tension of a muscle as a map of contraction and an equivalent pressure, both adapted from a source muscle if
    given.

    .. math:: F = A_0\,g(\varepsilon, p^*), \qquad p^* = p + \sum_k w_k (p_k - p)

    The memories :math:`p_k` of the gauge pressure are those of a tube (lags), of bladder and braid (relaxations) and
    of hysteresis (plays). Without a source, g is a braid with an elastic bladder that falls slack, and a Gaussian
    process for the remainder. With a source, g is the source's, scaled by the bore: its gain, the scale of its
    contraction, the threshold pressure and the preload are adapted, the weights :math:`w_k` stay near the source's, a
    Gaussian process learns the remainder. Where a fit without the source does significantly better on held-out runs,
    these decide how much of the source is kept.

    Signals: ``eps`` and ``P``; with memory ``time`` and a column ``trajectory``, whole runs in order of time. Rows
    of weight 0 are remembered and not fitted: that is how few samples of force come with a whole log of pressure.

    Parameters
    ----------
    source : estimator, optional
        A fitted `CarriedForce` of another muscle, best in a `sklearn.frozen.FrozenEstimator`, so that clones keep its
        fit. It stays untouched.
    max_contraction : float, optional
        Contraction at which the muscle no longer pulls at its working pressure, as data sheets state it. If both
        muscles state it, contractions are compared as shares of it.
    pressure_memory : bool, default=True
        Whether the pressure's past is read. Without it rows are independent.
    max_samples : int, default=600
        Maximum number of samples that are fitted, evenly spaced; the cost grows with their cube.

    Attributes
    ----------
    parameters_, standard_errors_, units_ : dict
        Named parameters, their standard errors and units. Without a source: area times the coefficients of
        1, ε, ε² on the pressure and the bladder's force. With one: logarithm of the gain on what geometry says, scale
        of the contraction less 1, threshold's shift, its slope and curvature in ε, preload.
    memory_ : dict
        Weight of each memory of the pressure.
    source_kept_ : float
        Share of the prediction that comes from the source; 0 without one.
    held_out_errors_ : dict
        Errors on held-out runs, N, with noisy samples weighted less: "carried", "fresh".
    process_ : NamedProcess
        Named part and remainder.

    See Also
    --------
    StaticPIHM : A network in place of the process; its weights are what `QAdapter` carries.

    Notes
    -----
    A sample taken while the pressure jumps counts for less. Widths of the priors were set with the measured muscles of
    `benchmarks/carried.py` in sight; where the bore is another, the evidence gives a factor on those of the gain, the
    contraction, the threshold and the preload. Times and widths of the memories do not depend on the muscle's size:
    on these muscles that is best.

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn.frozen import FrozenEstimator
    >>> from pamid.estimators import CarriedForce
    >>> from pamid.volume.braided import chou_hannaford
    >>> eps, P = (v.ravel() for v in np.meshgrid(np.linspace(0.0, 0.2, 6), np.linspace(2e5, 6e5, 12)))
    >>> X, F = np.c_[eps, P], chou_hannaford(P, eps, rest_diameter=0.01, braid_angle=0.45)
    >>> A = CarriedForce(rest_diameter=0.01, pressure_memory=False).fit(X, F)
    >>> B = CarriedForce(FrozenEstimator(A), rest_diameter=0.02, pressure_memory=False).fit(X[::9], 4.4 * F[::9])
    >>> bool(B.score(X, 4.4 * F) > 0.999)
    True
    >>> round(float(np.exp(B.parameters_["gain"])), 1)
    1.1
    """

    source: Any = None
    _: KW_ONLY
    rest_diameter: float = 0.02
    max_contraction: float | None = None
    pressure_memory: bool = True
    atmospheric_pressure: float = ATMOSPHERIC_PRESSURE
    max_samples: int = 600

    equations = ("force",)
    _settings: ClassVar = {"": {"pressure_memory": False}}
    process_: NamedProcess = field(init=False)
    fresh_: NamedProcess | None = field(init=False)

    @property
    def reads(self) -> tuple[str, ...]:  # type: ignore[override]  # noqa: D102
        return ("eps", "P", "time") if self.pressure_memory else ("eps", "P")

    def fit(self, X: Any, y: Any, sample_weight: Any = None, groups: Any = None) -> Self:
        """Identify the muscle, from the source if there is one.

        Parameters
        ----------
        X : DataFrame or array, shape (n_samples, n_columns)
            Columns ``eps`` (dimensionless) and ``P`` (Pa, absolute), with memory ``time`` (s) and ``trajectory``.
        y : array_like, shape (n_samples,)
            Tension, N. Its values on rows of weight 0 are ignored.
        groups : array_like, shape (n_samples,), optional
            Run of each row: rows of a run are held out together and share an error.
        """
        check_sizes(self, rest_diameter=1e-6, atmospheric_pressure=0.0)
        if self.max_contraction is not None:
            check_sizes(self, max_contraction=1e-3)
        check_counts(self, "max_samples")
        table, y_, weight = self._read_weighted(X, y, sample_weight, reset=True, ensure_min_samples=2)
        source = None if self.source is None else self._source_process()
        eps, p, past = self._seen(table)
        rows = np.flatnonzero(weight > 0)
        if len(rows) < 2:
            raise FitError(f"{len(rows)} samples have a weight.", "two or more", "Give weights to more rows.")
        # Identical rows carry no more information than one of them, however often a stream repeats them.
        alike = np.column_stack([eps, p, past, y_])[rows]
        _, first, back = np.unique(alike, axis=0, return_index=True, return_inverse=True)
        weight, given = weight.copy(), weight
        weight[rows[first]] = np.bincount(back.ravel(), weights=given[rows])
        rows = rows[np.sort(first)]
        rows = rows[np.unique(np.linspace(0, len(rows) - 1, min(len(rows), self.max_samples)).round().astype(int))]
        codes = trajectory_codes(X, groups)
        if codes is None:  # identical rows must not predict each other when one is held out
            codes = np.unique(np.column_stack([eps, p]), axis=0, return_inverse=True)[1].ravel()
        jump = past[rows, ROUGH] if self.pressure_memory else np.zeros(len(rows))
        samples = NamedRows(
            eps[rows],
            p[rows],
            past[rows],
            y_[rows] / self._unit(),
            weight[rows] / weight[rows].mean(),
            codes[rows],
            jump,
        )
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore", RuntimeWarning)
            fresh = fit_process(BraidLaw(), samples, Amplitudes(), np.zeros(past.shape[1]))
            self._take(samples, fresh, source)
        self._name_results()
        self._remember(X, y, sample_weight, groups)
        return self

    def predict(self, X: Any) -> np.ndarray:
        """Predict the tension, N.

        Parameters
        ----------
        X : DataFrame or array, shape (n_samples, n_columns)
            The signals that the fit read; with memory whole runs in order of time.
        """
        seen = self._seen(self._read_fitted(X, "process_"))
        out = self.process_.predict(*seen)
        if self.fresh_ is not None:
            out = self.source_kept_ * out + (1.0 - self.source_kept_) * self.fresh_.predict(*seen)
        return np.asarray(self._unit() * out)

    # --- parts ------------------------------------------------------------------------------------------------
    def _unit(self) -> float:
        """Force of `BAR` on the bore, N."""
        return float(np.pi * self.rest_diameter**2 / 4.0 * BAR)

    def _seen(self, table: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return contraction, gauge pressure and its memories less it, in units of `BAR`."""
        eps, P = self._signal(table, "eps"), self._signal(table, "P")
        past = np.empty((len(P), 0))
        if self.pressure_memory:
            log = whole_log(self, table)
            past = pasts(P, log.dt, log.starts) / BAR
        return eps, (P - self.atmospheric_pressure) / BAR, past

    def _source_process(self) -> CarriedForce:
        found = inside(self.source)
        if not isinstance(found, CarriedForce) or "process_" not in vars(found):
            raise IncompatibleError(
                f"The source is {type(found).__name__}" + (", not fitted." if isinstance(found, CarriedForce) else "."),
                "a fitted CarriedForce",
                "Fit one on the muscle whose data are plenty, and pass FrozenEstimator(fitted).",
            )
        if found.pressure_memory != self.pressure_memory:
            raise IncompatibleError(
                f"pressure_memory={self.pressure_memory}, and the source has pressure_memory={found.pressure_memory}.",
                "the same",
                "Set it alike.",
            )
        return found

    def _take(self, rows: NamedRows, fresh: tuple[NamedProcess, HeldOut], source: CarriedForce | None) -> None:
        process, without = fresh
        self.fresh_, self.source_kept_ = None, 0.0
        self.held_out_errors_ = {"fresh": self._unit() * without.error}
        self.process_ = process
        if source is None:
            return
        stretch = 1.0
        if self.max_contraction is not None and source.max_contraction is not None:
            stretch = float(source.max_contraction / self.max_contraction)
        law = CarriedLaw(source.process_, float(self.rest_diameter / source.rest_diameter), stretch)
        start = Amplitudes(noise=source.process_.amplitudes.noise, recall=0.03)
        self.process_, found = fit_process(law, rows, start, source.process_.recall)
        without = HeldOut(without.left, found.trust)  # both judged on the same samples alike
        self.held_out_errors_ = {"fresh": self._unit() * without.error, "carried": self._unit() * found.error}
        self.source_kept_ = 1.0
        blocks = np.unique(rows.run, return_inverse=True)[1]
        gain = np.bincount(blocks, weights=found.trust * (found.left**2 - without.left**2))
        if gain.sum() > BEYOND_CHANCE * float(np.sqrt(gain @ gain)):
            self.source_kept_ -= share_of_fresh(found.left - without.left, found.left, found.trust, blocks)
            self.fresh_ = process
        errors = self.held_out_errors_
        if self.source_kept_ < 0.5:
            warnings.warn(
                f"The source helps little: runs held out leave {errors['carried']:.3g} N with it and "
                f"{errors['fresh']:.3g} N without. Expected less with a source. Predictions keep "
                f"{self.source_kept_:.0%} of it. Use a source more like the target, or none.",
                AdaptationWarning,
                stacklevel=4,
            )

    def _name_results(self) -> None:
        law, unit = self.process_.law, self._unit()
        carried = isinstance(law, CarriedLaw)
        sizes = np.array([*CARRIED_SIZES, unit] if carried else [unit / BAR] * 3 + [unit] * 3)
        errors = np.sqrt(np.maximum(np.diag(self.process_.covariance)[: len(law.names)], 0.0))
        self.parameters_ = dict(zip(law.names, (sizes * self.process_.theta).tolist(), strict=True))
        self.standard_errors_ = dict(zip(law.names, (sizes * errors).tolist(), strict=True))
        self.units_ = dict(zip(law.names, CARRIED_UNITS if carried else BRAID_UNITS, strict=True))
        self.memory_ = dict(zip(MEMORIES, self.process_.recall.tolist(), strict=True)) if self.pressure_memory else {}
        self.n_parameters_ = len(self.process_.theta) + len(self.process_.recall)

    def _in_order(self) -> bool:
        return bool(self.pressure_memory)

    def _continue(self, rows: Any) -> None:
        self._refit(rows, bool(self._memory["grouped"]))  # rows of weight 0 have not faded, they are remembered

    @classmethod
    def _checked_instances(cls) -> list[CarriedForce]:
        one = dict.fromkeys(("eps", "P"), 0)
        rng = np.random.default_rng(0)
        source = cls(pressure_memory=False, signals=one, rest_diameter=0.01)
        source.fit(rng.uniform(0.0, 1.0, (12, 1)), rng.uniform(0.0, 1.0, 12))
        return [
            cls(pressure_memory=False, signals=one),
            cls(FrozenEstimator(source), pressure_memory=False, signals=one),
        ]
