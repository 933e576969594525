"""Where a model and measured data part, which unmodelled effect is the cause, and how far the gap closes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any, ClassVar, Self

import numpy as np
from sklearn.base import RegressorMixin
from sklearn.utils import check_random_state
from sklearn.utils.validation import check_is_fitted, column_or_1d

from pamid.errors import ExcitationError, MissingColumnError, UnknownOptionError

from ._base import SignalEstimator, Signals
from ._trajectories import has_trajectory_column, trajectory_codes

ROLES = {
    "eps": "position", "deps": "velocity", "q": "position", "dq": "velocity", "P": "pressure", "dP": "pressure_rate",
    "u": "command", "time": "time", "mdot": "flow", "F": "force",
}  # fmt: skip
"""Roles of the columns that pamid names."""
NAMES = ("time", "position", "velocity", "pressure", "pressure_rate", "command", "flow", "force")
EQUATIONS = ("force", "torque", "flow")


class GapDiagnoser(RegressorMixin, SignalEstimator):
    r"""Diagnose the gap between a model of one equation and measured data, and predict with the gap closed.

    The residual :math:`y - f(X)` of any fitted model f is held against every effect of the library that the signals
    allow: friction, hysteresis, elasticity, creep, loads, faults of sensors. What a flexible learner on the same
    signals and their past could not predict on held-out trajectories counts as noise; an effect that leaves far more
    than that is not the cause, and the verdict is then ``"unknown"``.

    .. math:: \hat y = f(X) + \sum_i g_i(X;\,\hat\phi_i)

    Parameters
    ----------
    nominal : estimator, callable or None, default=None
        The model: a fitted regressor or pipeline, or a function that takes X and returns the modelled target. None
        models nothing, so that y itself is the gap. A model that has to survive `sklearn.base.clone` fitted goes into
        a `sklearn.frozen.FrozenEstimator`.
    effects : "all" or sequence of str, default="all"
        The library: names of effects that may be causes, see `pamid.effects.all_effects`.
    signals : mapping of str to str or int, optional
        Column of each role, by name or position: ``time`` (s), ``position``, ``velocity``, ``pressure`` (Pa),
        ``pressure_rate`` (Pa/s), ``command``, ``flow`` (kg/s), ``force`` (N). By default the columns that pamid names:
        ``eps`` or ``q``, ``deps`` or ``dq``, ``P``, ``dP``, ``u``, ``mdot``, ``F``, ``time``, or the roles themselves.
    equation : {"force", "torque", "flow"}, default="force"
        What y is: effects add to it with the hook of that name.
    position_scale : float or None, default=None
        Length or angle that counts as a strain of one: effects see position over it. None takes 1 for a contraction
        ratio and five times the range for anything else.
    sampling_interval : float, default=1e-3
        Sampling interval, s, where no column tells the time.
    plant : pamid.effects.Plant or None, default=None
        Numbers of the bench, for effects of a muscle's geometry, gas or valve; without it they are left out.
    one_trajectory : bool, default=False
        Whether all rows are one trajectory, where neither groups nor a column says otherwise.
    random_state : int, RandomState or None, default=None
        Draws behind p-values and intervals.

    Attributes
    ----------
    diagnosis_ : pamid.gap.Diagnosis
        The whole answer.
    verdict_ : str
        ``"cause"``, ``"class"``, ``"several"``, ``"unknown"`` or ``"none"``.
    gap_ : bool
        Whether model and data part beyond the noise.
    p_value_ : float
        Probability of as much evidence without a gap.
    where_ : dict
        Regions, bands of frequency and trajectories in which the gap lies.
    candidates_, causes_, closure_ : list
        The library with confidences; the causes with shares, parameters and intervals; how far the gap closes.
    next_experiment_ : NextExperiment or None
        What to record next.
    effects_ : dict
        The causes with the values of their parameters, in strains where a position enters.
    position_scale_ : float
        The length or angle that counts as a strain of one.
    explainable_floor_ : float
        What a flexible learner leaves on held-out trajectories, in the unit of y.
    signal_columns_ : dict of str to int
        Column of each role.
    n_features_in_ : int
        Number of columns seen in fit.
    feature_names_in_ : ndarray
        Their names, if X was a DataFrame with text names.

    See Also
    --------
    pamid.gap.diagnose : The same for a whole bench, with its simulator's tolerances.

    References
    ----------
    K. Kaheman, E. Kaiser, B. Strom, J. N. Kutz, S. L. Brunton, "Learning discrepancy models from experimental data",
    arXiv:1909.08574, 2019. https://doi.org/10.48550/arXiv.1909.08574

    Examples
    --------
    >>> import numpy as np, pandas as pd
    >>> from pamid.estimators import GapDiagnoser
    >>> t = np.tile(np.arange(0, 4, 0.002), 4)
    >>> run, w = np.repeat(np.arange(4), 2000), np.repeat([2.0, 4.0, 7.0, 9.0], 2000)
    >>> X = pd.DataFrame({"time": t, "eps": 0.1 + 0.05 * np.sin(w * t), "deps": 0.05 * w * np.cos(w * t)})
    >>> rng = np.random.default_rng(0)
    >>> y = -30.0 * X["deps"] + 0.2 * rng.standard_normal(len(X))
    >>> diagnoser = GapDiagnoser(random_state=0).fit(X, y, groups=run)
    >>> diagnoser.verdict_, diagnoser.causes_[0].effects
    ('cause', ('viscous_friction',))
    """

    __metadata_request__fit: ClassVar = {"groups": True}
    __metadata_request__predict: ClassVar = {"groups": True}
    __metadata_request__score: ClassVar = {"groups": True}

    def __init__(
        self,
        nominal: Any = None,
        effects: str | Sequence[str] = "all",
        *,
        signals: Signals | None = None,
        equation: str = "force",
        position_scale: float | None = None,
        sampling_interval: float = 1e-3,
        plant: Any = None,
        one_trajectory: bool = False,
        random_state: Any = None,
    ) -> None:
        self.nominal = nominal
        self.effects = effects
        self.signals = signals
        self.equation = equation
        self.position_scale = position_scale
        self.sampling_interval = sampling_interval
        self.plant = plant
        self.one_trajectory = one_trajectory
        self.random_state = random_state

    def fit(self, X: Any, y: Any, groups: Any = None) -> Self:
        """Diagnose.

        Parameters
        ----------
        X : DataFrame or array, shape (n_samples, n_columns)
            Signals, and whatever the nominal model reads.
        y : array_like, shape (n_samples,)
            Measured target.
        groups : array_like, shape (n_samples,), optional
            Trajectory of each row; without it a column ``trajectory`` serves.

        Returns
        -------
        GapDiagnoser
            Itself, fitted.

        Raises
        ------
        MissingTrajectoryError
            Nothing tells trajectories.
        MissingColumnError
            X has no column with a role.
        ExcitationError
            No signal moves.
        """
        from pamid.effects import all_effects
        from pamid.gap.engine import explain
        from pamid.gap.signal_evidence import SignalEvidence, explainable_floor, strain_scale

        if self.equation not in EQUATIONS:
            raise UnknownOptionError(
                f"equation is {self.equation!r}.", f"one of {', '.join(EQUATIONS)}", "Say what y is."
            )
        library = list(all_effects()) if isinstance(self.effects, str) and self.effects == "all" else list(self.effects)
        if strange := [name for name in library if name not in all_effects()]:
            raise UnknownOptionError(
                f"The library has no effect {', '.join(map(repr, strange))}.",
                "names of pamid.effects.all_effects()",
                "Correct the names.",
            )
        codes = self._codes(X, groups)
        table, y = self._read(X, y, reset=True)
        y = column_or_1d(y, warn=True).astype(float)
        rng = check_random_state(self.random_state)
        signals = self._table(table, codes)
        if not any(np.ptp(x) > 0 for role, x in signals.items() if role != "time"):
            raise ExcitationError(
                f"None of the signals {', '.join(signals)} moves.", "motion", "Record runs in which position changes."
            )
        position = signals.get("position", np.zeros(1))
        self.position_scale_ = float(self.position_scale or strain_scale(position))
        dt = self._interval(signals, codes)
        nominal = self._nominal(table)
        floor, _ = explainable_floor(signals, y - nominal(signals), codes, dt)
        self.explainable_floor_ = floor
        evidence = SignalEvidence(
            signals, y, nominal, codes, dt, self.equation, self.plant, self.position_scale_, floor, self._labels()
        )
        notes = ["What a flexible learner on the same signals and their past leaves on held-out runs counts as noise."]
        self.diagnosis_ = explain(evidence, library, np.random.RandomState(rng.randint(2**31 - 1)), notes)
        found = self.diagnosis_
        self.verdict_, self.gap_, self.p_value_ = found.verdict, found.gap, found.p_value
        self.where_ = {"regions": found.regions, "bands": found.bands, "trajectories": found.trajectories}
        self.candidates_, self.causes_, self.closure_ = found.candidates, found.causes, found.closure
        self.next_experiment_ = found.next_experiment
        self.effects_ = {c.effects[0]: {k: p.value for k, p in c.parameters.items()} for c in found.causes}
        return self

    def predict(self, X: Any, groups: Any = None) -> np.ndarray:
        """Predict with the causes added to the nominal model.

        Parameters
        ----------
        X : DataFrame or array, shape (n_samples, n_columns)
            Signals, as in `fit`.
        groups : array_like, shape (n_samples,), optional
            Trajectory of each row, for causes with memory.

        Returns
        -------
        ndarray, shape (n_samples,)
            Nominal model plus effects, in the unit of y.
        """
        from pamid.gap.signal_evidence import SignalEvidence

        check_is_fitted(self)
        table, _ = self._read(X, reset=False)
        codes = self._codes(X, groups)
        signals, nominal = self._table(table, codes), self._nominal(table)
        modelled = nominal(signals)
        if not self.effects_:
            return modelled
        dt = self._interval(signals, codes)
        evidence = SignalEvidence(
            signals, modelled, nominal, codes, dt, self.equation, self.plant, self.position_scale_
        )
        return modelled + evidence.added(self.effects_)

    def score(self, X: Any, y: Any, sample_weight: Any = None, groups: Any = None) -> float:
        """Return the coefficient of determination of the prediction, dimensionless.

        Parameters
        ----------
        X : DataFrame or array, shape (n_samples, n_columns)
            Signals.
        y : array_like, shape (n_samples,)
            Measured target.
        sample_weight : array_like, shape (n_samples,), optional
            Weights.
        groups : array_like, shape (n_samples,), optional
            Trajectory of each row.

        Returns
        -------
        float
            R².
        """
        from sklearn.metrics import r2_score

        return float(r2_score(y, self.predict(X, groups=groups), sample_weight=sample_weight))

    # --- signals --------------------------------------------------------------------------------------------
    def _codes(self, X: Any, groups: Any) -> np.ndarray:
        several = groups is not None or has_trajectory_column(X)
        codes = trajectory_codes(
            X,
            groups,
            one_trajectory=self.one_trajectory or (not several and hasattr(self, "diagnosis_")),
            needed_by=type(self).__name__,
        )
        assert codes is not None
        return codes

    def _locate(self, n_columns: int) -> dict[str, int]:
        names = [str(n) for n in getattr(self, "feature_names_in_", ())]
        given = dict(self.signals or {})
        if unknown := sorted(set(given) - set(NAMES)):
            raise UnknownOptionError(
                f"signals maps {', '.join(unknown)}.", f"roles: {', '.join(NAMES)}", "Name the role of each column."
            )
        found: dict[str, int] = {}
        for k, name in enumerate(names):
            role = ROLES.get(name, name if name in NAMES else "")
            if role and role not in found and not given:
                found[role] = k
        for role, column in given.items():
            at = names.index(column) if isinstance(column, str) and column in names else column
            if isinstance(at, str) or not 0 <= int(at) < n_columns:
                raise MissingColumnError(
                    f"X has no column {column!r} for {role}; it has {', '.join(names) or f'{n_columns} columns'}.",
                    "a name or position of a column",
                    "Correct signals=.",
                )
            found[role] = int(at)
        if not set(found) - {"time"}:
            raise MissingColumnError(
                f"No column of X has a role; it has {', '.join(names) or f'{n_columns} without names'}.",
                "position, velocity, pressure, ...",
                "Map them, for instance signals={'position': 'stroke', 'velocity': 'speed', 'time': 't'}.",
            )
        return found

    def _labels(self) -> dict[str, str]:
        names = [str(n) for n in getattr(self, "feature_names_in_", ())]
        return {role: names[k] if names else f"X[{k}]" for role, k in self.signal_columns_.items()}

    def _table(self, table: np.ndarray, codes: np.ndarray) -> dict[str, np.ndarray]:
        """Return the signals by role; a velocity that was not given is differentiated within each trajectory."""
        signals = {role: table[:, k] for role, k in self.signal_columns_.items()}
        for rate, of in (("velocity", "position"), ("pressure_rate", "pressure")):
            if rate not in signals and of in signals:
                signals[rate] = _rates(signals[of], codes, self._interval(signals, codes))
        return signals

    def _interval(self, signals: dict[str, np.ndarray], codes: np.ndarray) -> float:
        if "time" not in signals:
            return float(self.sampling_interval)
        steps = np.diff(signals["time"])[np.diff(codes) == 0]
        steps = steps[steps > 0]
        return float(np.median(steps)) if len(steps) else float(self.sampling_interval)

    def _nominal(self, table: np.ndarray) -> Callable[[Any], np.ndarray]:
        names = getattr(self, "feature_names_in_", None)

        def modelled(signals: dict[str, np.ndarray]) -> np.ndarray:
            if self.nominal is None:
                return np.zeros(len(table))
            X: Any = table.copy()
            for role, k in self.signal_columns_.items():
                X[:, k] = signals[role]
            if names is not None:
                import pandas as pd

                X = pd.DataFrame(X, columns=names)
            out = self.nominal.predict(X) if hasattr(self.nominal, "predict") else self.nominal(X)
            return np.asarray(out, dtype=float).reshape(len(table))

        return modelled

    @staticmethod
    def _checked_instances() -> list[GapDiagnoser]:
        roles = {"position": 0, "velocity": 0}
        library = ("viscous_friction", "bladder_elasticity", "force_bias")
        return [GapDiagnoser(effects=library, signals=roles, one_trajectory=True, random_state=0)]


def _rates(x: np.ndarray, codes: np.ndarray, dt: float) -> np.ndarray:
    from scipy.signal import savgol_filter

    out = np.zeros(len(x))
    borders = [0, *(np.flatnonzero(np.diff(codes)) + 1).tolist(), len(codes)]
    for a, b in pairwise(borders):
        width = min(2 * max(2, round(0.02 / dt)) + 1, (b - a) - (b - a + 1) % 2)
        if width >= 5:
            out[a:b] = savgol_filter(x[a:b], width, 3, deriv=1, delta=dt)
        elif b - a > 1:
            out[a:b] = np.gradient(x[a:b], dt)
    return out
