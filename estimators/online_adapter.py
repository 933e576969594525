"""A hybrid model that follows its muscle: a Kalman filter over the factor on its volume and parameters of effects."""

from collections.abc import Sequence
from dataclasses import KW_ONLY
from typing import Any, ClassVar, Self

import numpy as np
from sklearn.utils.validation import check_array, check_consistent_length, check_is_fitted, column_or_1d

from pamid.effects.base import Effect
from pamid.effects.plant import Plant
from pamid.effects.spec import effect_of
from pamid.errors import IncompatibleError, ParameterError
from pamid.laws.base import Law
from pamid.online.alarm import DriftAlarm, threshold
from pamid.online.memory import StreamedEffect
from pamid.online.recursive import RecursiveEstimate
from pamid.signals.state import STATE_SIGNALS, State
from pamid.signals.stretches import equal_stretches
from pamid.volume.base import VolumeModel
from pamid.volume.scaled import ScaledVolume

from ._base import SignalRegressor
from ._checks import check_squares
from ._hybrid_use import predicted
from ._parameters import parameters
from ._source import hybrid_of, tiny_source
from ._trajectories import trajectory_codes


@parameters
class OnlineAdapter(SignalRegressor):
    r"""Follow a muscle that ages: a Kalman filter over a factor Q and the parameters of effects.

    .. math:: y = Q\,f(\varepsilon, \dot\varepsilon, P, \dot P) + \sum_e g_e(\cdot\,; \theta_e) + v

    with the source model's prediction f (force in N or flow in kg/s). ``fit`` takes a healthy stretch: it finds the
    reference of Q and θ, the noise, and how large the sums of the drift alarm are without drift. ``partial_fit`` takes
    the samples that follow, any number at a time, in their order; its state does not grow. Samples count less the older
    they are, outliers and readings of a frozen sensor are left out. Where two blocks in a row are likelier after a jump
    of the parameters than without one, by more than the odds of one in `forgetting_time`, what was before is forgotten
    at once, as far as the jump demands.

    Parameters
    ----------
    source : estimator
        A fitted hybrid model of one law, best in a `sklearn.frozen.FrozenEstimator`.
    effects : sequence of str or (str, dict), default=()
        Effects whose linear parameters are followed, by name and with values, such as ``"viscous_friction"``. Effects
        without a linear parameter are followed by linearisation about the current estimate.
    plant : Plant, optional
        The bench that effects refer to, ``BenchParameters.plant()``; needed with `effects`.
    sampling_interval : float, default=0.001
        s.
    forgetting_time : float, default=10
        Seconds after which a sample counts 1/e, and in which about one jump of the parameters is expected.
    scale_uncertainty : float, default=0.2
        Standard deviation of Q before any data, and the largest that forgetting leads to; dimensionless.
    effect_uncertainty : float, default=3
        The same for the effects' parameters, in units of their typical values.
    alarm_memory : float, default=0.5
        Memory of the drift alarm, s.
    alarm_hold : float, default=1.2
        Seconds for which its evidence must stay above its threshold; by then it is clear which parameter drifts.
    false_alarms_per_hour : float, default=1
        False alarms that are allowed in an hour of signal.
    play : float, default=0
        Half the play through which effects with memory follow the contraction, dimensionless.
    block : int, default=20
        Samples that the filter takes at once.
    signals : dict, optional
        Column of X for each of the signals ``eps``, ``deps``, ``P`` and ``dP``.

    Attributes
    ----------
    parameter_names_ : list of str
        ``"scale"`` for Q, then ``"<effect>.<parameter>"``.
    values_, uncertainty_ : ndarray, shape (n_parameters,)
        Present estimates and their standard deviations, each in its own unit.
    reference_ : ndarray, shape (n_parameters,)
        Those of the healthy stretch.
    volume_ : VolumeModel
        The gas volume at present: that of the source, times Q.
    effects_ : list of Effect
        The effects with their present parameters, for instance to export them.
    noise_ : float
        Standard deviation of a sample, N or kg/s.
    alarms_ : list of dict
        Drifts since the fit, at most the last hundred: ``parameter``, ``sample``, ``time`` (s since the fit),
        ``strength`` (above one) and ``change``.
    n_samples_seen_, n_rejected_ : int
        Samples taken, and left out as outliers, as missing or as those of a frozen sensor.

    See Also
    --------
    QAdapter : Adapt a model once, to another muscle.
    pamid.online.GapMonitor : Watch for effects that appear, with force and flow together.

    References
    ----------
    R. E. Kalman, "A new approach to linear filtering and prediction problems", Journal of Basic Engineering 82(1),
    1960. https://doi.org/10.1115/1.3662552

    Examples
    --------
    >>> import numpy as np, pandas as pd
    >>> from sklearn.frozen import FrozenEstimator
    >>> from pamid.estimators import OnlineAdapter, StaticPIHM
    >>> t = np.arange(0, 6, 0.001)
    >>> X = pd.DataFrame({"eps": 0.1 + 0.05 * np.sin(t), "deps": 0.05 * np.cos(t),
    ...                   "P": 3e5 + 1e5 * np.cos(3 * t), "dP": -3e5 * np.sin(3 * t)})
    >>> F = (X["P"] - 101325) * 5e-4 * (1 - 3 * X["eps"]) + np.random.default_rng(0).normal(0, 0.2, len(t))
    >>> model = StaticPIHM(hidden_layer_sizes=(8,), max_iter=20, random_state=0).fit(X[::30], F[::30])
    >>> online = OnlineAdapter(FrozenEstimator(model), forgetting_time=1.0).fit(X[:4000], F[:4000])
    >>> online.partial_fit(X[4000:], 1.1 * F[4000:]).alarms_[0]["parameter"]
    'scale'
    """

    source: Any
    effects: Sequence[Any] = ()
    _: KW_ONLY
    plant: Plant | None = None
    sampling_interval: float = 1e-3
    forgetting_time: float = 10.0
    scale_uncertainty: float = 0.2
    effect_uncertainty: float = 3.0
    alarm_memory: float = 0.5
    alarm_hold: float = 1.2
    false_alarms_per_hour: float = 1.0
    play: float = 0.0
    block: int = 20

    reads: ClassVar[tuple[str, ...]] = STATE_SIGNALS

    # --- fitting ------------------------------------------------------------------------------------------------
    def fit(self, X: Any, y: Any, groups: Any = None) -> Self:
        """Find reference, noise and calibration of the alarm on a healthy stretch.

        Parameters
        ----------
        X : DataFrame or array, shape (n_samples, n_columns)
            Signals of the muscle, in order of time.
        y : array, shape (n_samples,)
            What the source predicts, measured: force (N) or mass flow (kg/s).
        groups : array, shape (n_samples,), optional
            Run of each row; a column ``trajectory`` serves as well. Without either the rows are one run.
        """
        self._check_settings()
        table, y = self._read(X, y, reset=True)
        y = column_or_1d(y, warn=True)
        streamed = self._streamed()
        self.parameter_names_ = ["scale", *(f"{e.effect.name}.{n}" for e in streamed for n in e.names)]
        start = np.array([1.0, *(0.0 if e.linear else e.effect.values[n] for e in streamed for n in e.names)])
        self.spread_ = np.array(
            [self.scale_uncertainty, *(self.effect_uncertainty * _typical(e, n) for e in streamed for n in e.names)]
        )
        H, modelled = self._design(table, start, streamed, trajectory_codes(X, groups))
        noise, step = _robust(y - modelled), np.zeros_like(start)
        for _ in range(3):
            # A weak pull to the prior keeps unexcited parameters at their start.
            rows = np.vstack([H / noise, np.diag(1.0 / self.spread_)])
            step = np.linalg.lstsq(rows, np.append((y - modelled) / noise, 0.0 * start), rcond=None)[0]
            noise = _robust(y - modelled - H @ step)
        self.reference_, self.noise_ = start + step, noise
        alarm = self._alarm(streamed)
        blocks = [slice(i, i + self.block) for i in range(0, len(y), self.block)]
        # A sensor that is never quite still while all is well is stuck once it is.
        self.rests_ = any(len(y[b]) > 4 and np.ptp(y[b]) == 0.0 for b in blocks)
        residual = y - modelled - H @ step
        alarm.calibrate(np.array([alarm.statistic(H[b], residual[b], noise) for b in blocks]))
        self.alarm_scale_ = alarm.scale
        # Correlated residuals carry less information than as many independent ones.
        self.effective_noise_ = noise * float(np.clip(np.median(alarm.scale), 1.0, 30.0))
        estimate = RecursiveEstimate(start, self.spread_, np.inf)
        for b in blocks:
            estimate.update(H[b], y[b] - modelled[b] + H[b] @ start, self.effective_noise_)
        self.values_, self.covariance_ = self.reference_.copy(), estimate.covariance
        self.suspect_rows_ = estimate.suspect
        self.scatter_ = np.full(2, float(max(len(y) - len(start), 1)))
        self.alarms_: list[dict[str, Any]] = []
        self.n_samples_seen_, self.n_rejected_ = 0, 0
        alarm.restart()
        self.alarm_state_ = alarm.state
        self.effect_state_: list[dict[str, Any]] = [{} for _ in streamed]
        return self

    def partial_fit(self, X: Any, y: Any, groups: Any = None) -> Self:
        """Follow the next samples; the first call of all is a `fit`.

        Parameters
        ----------
        X : DataFrame or array, shape (n_samples, n_columns)
            Signals of the muscle, in order of time, going on where the last call ended.
        y : array, shape (n_samples,)
            Measured force (N) or mass flow (kg/s); NaN where there is none.
        groups : array, shape (n_samples,), optional
            Run of each row. What effects remember starts afresh where it changes within a call.
        """
        if not hasattr(self, "values_"):
            return self.fit(X, y, groups)
        table, _ = self._read(X, reset=False)
        y = column_or_1d(check_array(y, ensure_2d=False, ensure_all_finite="allow-nan", dtype=np.float64), warn=True)
        check_squares(y)
        check_consistent_length(table, y)
        streamed = self._streamed()
        for effect, state in zip(streamed, self.effect_state_, strict=True):
            effect.recall(state)
        alarm = self._alarm(streamed)
        alarm.scale, alarm.state = self.alarm_scale_, self.alarm_state_
        memory = self.forgetting_time / self.sampling_interval
        known = self.covariance_, self.suspect_rows_, self.scatter_
        estimate = RecursiveEstimate(self.values_, self.spread_, memory, *known)
        # What is not linear is linearised where a call begins; calls of a second or less keep that exact enough.
        H, modelled = self._design(table, self.values_, streamed, trajectory_codes(X, groups))
        target = y - modelled + H @ self.values_
        for i in range(0, len(y), self.block):
            b = slice(i, i + self.block)
            self._block(estimate, alarm, H[b], target[b], y[b])
        self.values_, self.covariance_ = estimate.value, estimate.covariance
        self.suspect_rows_ = estimate.suspect
        if estimate.scatter is not None:
            self.scatter_ = estimate.scatter
        self.alarm_state_ = alarm.state
        self.effect_state_ = [e.state for e in streamed]
        return self

    def _block(
        self, estimate: RecursiveEstimate, alarm: DriftAlarm, H: np.ndarray, target: np.ndarray, y: np.ndarray
    ) -> None:
        n = len(y)
        self.n_samples_seen_ += n
        if n > 4 and np.ptp(y) == 0.0 and (not self.rests_ or np.ptp(H @ estimate.value) > STILL * self.noise_):
            self.n_rejected_ += n
            return
        kept = estimate.update(H, target, self.effective_noise_)
        self.n_rejected_ += n - int(kept.sum())
        raised = alarm.update(H, np.where(kept, target - H @ self.reference_, np.nan), self.noise_)
        if raised is None:
            return
        name = self.parameter_names_[raised[0]]
        if self.alarms_ and self.alarms_[-1]["parameter"] == name:
            return  # the same drift goes on
        found = {
            "parameter": name,
            "sample": self.n_samples_seen_,
            "time": self.n_samples_seen_ * self.sampling_interval,
            "strength": raised[1],
            "change": alarm.estimate(raised[0]),
        }
        self.alarms_ = [*self.alarms_[1 - ALARMS :], found]

    # --- using --------------------------------------------------------------------------------------------------
    def predict(self, X: Any, groups: Any = None) -> np.ndarray:
        """Predict with the present parameters.

        Parameters
        ----------
        X : DataFrame or array, shape (n_samples, n_columns)
            Signals of the muscle; with effects that remember, in order of time.
        groups : array, shape (n_samples,), optional
            Run of each row; without them and without a column ``trajectory`` the rows are one run.

        Returns
        -------
        ndarray, shape (n_samples,)
            Force (N) or mass flow (kg/s).
        """
        table = self._read_fitted(X, "values_")
        streamed = self._streamed()
        # Without memory, it does not matter where a run begins.
        codes = trajectory_codes(X, groups) if streamed or groups is not None else None
        return self._design(table, self.values_, streamed, codes)[1]

    @property
    def uncertainty_(self) -> np.ndarray:
        """Standard deviations of the present values, each in its own unit."""
        check_is_fitted(self, "values_")
        return np.sqrt(np.diag(self.covariance_))

    @property
    def volume_(self) -> VolumeModel:
        """The gas volume as the adapter has it at present: that of the source, times Q."""
        check_is_fitted(self, "values_")
        return ScaledVolume(hybrid_of(self.source, type(self).__name__).volume_, float(self.values_[0]))

    @property
    def effects_(self) -> list[Effect]:
        """The effects with their present parameters, each within its bounds."""
        check_is_fitted(self, "values_")
        out, column = [], 1
        for e in self._streamed():
            values = np.clip(self.values_[column : column + len(e.names)], e.lower, e.upper)
            out.append(e.effect.replace(**dict(zip(e.names, map(float, values), strict=True))))
            column += len(e.names)
        return out

    # --- parts --------------------------------------------------------------------------------------------------
    def _design(
        self, table: np.ndarray, values: np.ndarray, streamed: list[StreamedEffect], codes: Any
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the derivatives by the parameters and the prediction at some values of them."""
        source = hybrid_of(self.source, type(self).__name__)
        state = State(*(self._signal(table, name) for name in STATE_SIGNALS))
        inner = np.empty((len(table), source.n_features_in_))
        for name, column in source.signal_columns_.items():
            inner[:, column] = getattr(state, name)
        f = predicted(source, inner)[:, 0]
        if not streamed:
            return f[:, None], values[0] * f
        H, total = np.empty((len(f), len(values))), values[0] * f
        H[:, 0] = f
        for a, b in [(0, len(f))] if codes is None else equal_stretches(codes):
            column = 1
            for effect in streamed:
                if a:
                    effect.restart()
                n = len(effect.names)
                run = State(*(s[a:b] for s in state))
                share, H[a:b, column : column + n] = effect.linearised(run, values[column : column + n])
                total[a:b] += share
                column += n
        return H, total

    def laws(self) -> tuple[Law, ...]:
        """Return the law that the source obeys."""
        return hybrid_of(self.source, type(self).__name__).laws()

    def _streamed(self) -> list[StreamedEffect]:
        source = hybrid_of(self.source, type(self).__name__)
        laws = source.laws()
        if len(laws) != 1:
            raise IncompatibleError(
                f"The source predicts {' and '.join(law.equation for law in laws)} together.",
                "a model of one law",
                "Use one adapter for StaticPIHM and one for ThermodynamicPIHM, or pamid.online.GapMonitor for both.",
            )
        if len(self.effects) and self.plant is None:
            raise ParameterError(
                "effects are given, and no plant.",
                "the numbers of the bench that effects refer to",
                "Pass plant=BenchParameters.from_toml('sim.toml').plant().",
            )
        plant, dt = self.plant, self.sampling_interval
        return [StreamedEffect(effect_of(e), laws[0].equation, plant, dt, self.play) for e in self.effects]  # type: ignore[arg-type]

    def _alarm(self, streamed: list[StreamedEffect]) -> DriftAlarm:
        # Parameters may move to both sides once the healthy stretch has shown a value inside their bounds.
        lower = np.concatenate([[-np.inf], *(e.lower for e in streamed)])
        dt = self.sampling_interval
        limit = threshold(self.false_alarms_per_hour, self.alarm_memory, len(lower))
        return DriftAlarm(self.reference_ <= lower, self.alarm_memory / dt, max(round(self.alarm_hold / dt), 1), limit)

    def _check_settings(self) -> None:
        for name in (
            *("sampling_interval", "forgetting_time", "scale_uncertainty", "effect_uncertainty", "alarm_memory"),
            *("alarm_hold", "false_alarms_per_hour", "block"),
        ):
            value = getattr(self, name)
            if not (np.isfinite(value) and value > 0):
                raise ParameterError(f"{name}={value!r}.", "a number above 0", "Correct it.")

    @classmethod
    def _checked_instances(cls) -> list[Self]:
        one = dict.fromkeys(STATE_SIGNALS, 0)
        return [cls(tiny_source(), signals=one)]


STILL = 4.0
"""Noise by which a model must move while a sensor does not before the sensor counts as stuck."""

ALARMS = 100
"""Number of alarms kept."""


def _robust(residual: np.ndarray) -> float:
    """Return the standard deviation by the median, so that outliers do not count."""
    spread = 1.4826 * float(np.nanmedian(np.abs(residual - np.nanmedian(residual))))
    return max(spread, 1e-9 * (1.0 + float(np.nanmax(np.abs(residual)))))


def _typical(effect: StreamedEffect, name: str) -> float:
    p = next(p for p in effect.effect.parameters if p.name == name)
    return abs(p.nominal) or min(p.upper, 1.0)
