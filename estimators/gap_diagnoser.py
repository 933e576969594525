"""Where a model and measured data part, which unmodelled effect is the cause, and how far the gap closes."""

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY, replace
from typing import Any, ClassVar, Self

import numpy as np
import pandas as pd
from sklearn.base import RegressorMixin
from sklearn.utils import check_random_state
from sklearn.utils.validation import check_is_fitted, column_or_1d

from pamid.errors import UnknownOptionError
from pamid.gap.at_ports import diagnose_evidence
from pamid.gap.learned import learn
from pamid.gap.learned import predict as remaining
from pamid.gap.one_equation import equation_of, facing, plain, rebuilt
from pamid.names import require_one_of
from pamid.simulators.problem import Problem

from ._base import SignalEstimator, Signals
from ._gap import (
    EQUATIONS,
    diagnosis_of,
    hybrid_with,
    is_simulator,
    located,
    predict_simulator,
    read_by,
    run_names,
    spoken,
)
from ._parameters import parameters
from ._sequences import SequenceScore
from ._streaming import SequenceStreaming
from ._trajectories import has_trajectory_column, run_codes


@parameters
class GapDiagnoser(SequenceStreaming, SequenceScore, RegressorMixin, SignalEstimator):
    r"""Diagnose the gap between a model of one equation and measured data, and predict with the gap closed.

    The residual :math:`y - f(X)` of any fitted model f is compared with every effect of the library that the signals
    allow: friction, hysteresis, elasticity, creep, loads, faults of sensors. Differences between neighbouring samples
    and between repeated runs count as noise; an effect that leaves far more than that is not the cause, and the verdict
    is then ``"unknown"``.

    .. math:: \hat y = f(X) + \sum_i g_i(X;\,\hat\phi_i)

    Parameters
    ----------
    nominal : estimator, callable, pamid.simulators.Simulator or None, default=None
        The model: a fitted regressor or pipeline, or a function that takes X and returns the modelled target. None
        models nothing: y is the gap. A `sklearn.frozen.FrozenEstimator` survives `sklearn.base.clone` fitted. For a
        simulator, y is a Series named after a state or output; ``corrected_`` is the simulator with the causes, and
        `predict` a free run of it.
    effects : "all" or sequence of str, default="all"
        The library: names of effects that may be causes, see `pamid.effects.all_effects`.
    signals : mapping of str to str or int, optional
        Column of each role, by name or position: ``time`` (s), ``position``, ``velocity``, ``pressure`` (Pa),
        ``pressure_rate`` (Pa/s), ``command``, ``flow`` (kg/s), ``force`` (N). By default the columns that pamid names:
        ``eps`` or ``q``, ``deps`` or ``dq``, ``P``, ``dP``, ``u``, ``mdot``, ``F``, ``time``, or the roles themselves.
        A pressure in another unit than pascal is taken as such, for a flow as the head over an outlet. Without a
        position, what drives the system (a voltage, a load) takes its place.
    equation : {"force", "torque", "flow"}, default="force"
        What y is: effects add to it with the hook of that name.
    position_scale : float or None, default=None
        Length or angle that counts as a strain of one: effects see position over it. None takes 1 for a contraction
        ratio (a column ``eps``) and five times the range for anything else, be it m, mm, rad or V.
    sampling_interval : float, default=1e-3
        Sampling interval, s, where no column tells the time.
    plant : pamid.effects.Plant or None, default=None
        Numbers of the bench, for effects of a muscle's geometry, gas or valve; without it they are left out.
    units : mapping of str to str, optional
        Unit of the ``target`` and of the signals ``position`` and ``pressure``, such as ``{"target": "V",
        "position": "rad"}``: those in which the causes' parameters are reported. By default SI for a muscle, else
        "target unit", "position unit", "pressure unit".
    sense : "auto", 1 or -1, default="auto"
        1 where y is what an actuator delivers, from which friction subtracts; -1 where y is the driving force, to which
        friction adds. "auto" takes the one that explains clearly more, and 1 with a plant.
    learned_remainder : bool, default=False
        Whether `predict` also adds a nonparametric function of the signals, fitted to what the causes leave, see
        `pamid.gap.learned`; with the verdict ``"unknown"`` that is the whole gap. It explains nothing, and holds for
        the states that were seen.
    random_state : int, RandomState or None, default=None
        Draws behind p-values and intervals.

    Attributes
    ----------
    diagnosis_ : pamid.gap.Diagnosis
        The whole answer.
    verdict_ : str
        ``"cause"``, ``"class"``, ``"several"``, ``"unknown"`` or ``"none"``.
    gap_ : bool
        Whether model and data disagree beyond the noise.
    p_value_ : float
        Probability of as much evidence without a gap.
    where_ : dict
        Regions, bands of frequency and runs in which the gap lies.
    candidates_, causes_, closure_ : list
        The library with confidences; the causes with shares, parameters and intervals; how far the gap closes.
    next_run_ : NextExperiment or None
        The run to record next: each signal held, or moved as a sine (amplitude in its unit, rad/s), within what the log
        visited, such that the two likeliest explanations differ most; None where nothing is undecided.
    effects_ : dict
        The causes with the values of their parameters, in the units of y, position and pressure.
    scaling_ : pamid.simulators.placement.Scales
        Sizes of the log that correspond to one in the units of the library; effects add to y where that of the target
        is negative.
    findings_, windows_ : dict
        What `diagnosis_` is made of.
    remainder_ : dict of str to ndarray
        The learned remainder; empty without one. Its ``share`` is the share of the mean square of what the causes leave
        that it predicts on unseen runs.
    position_scale_ : float
        The length or angle that counts as a strain of one.
    noise_floor_ : float
        Standard deviation of the noise of a window's mean of y less the model, in the unit of y, from differences
        between neighbouring samples and between repeated runs.
    explainable_floor_ : float
        What a flexible learner leaves on held-out runs, in the unit of y.
    explainable_share_ : float
        Share of the gap beyond the noise that this learner predicts.
    signal_columns_ : dict of str to int
        Column of each role.

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

    nominal: Any = None
    effects: str | Sequence[str] = "all"
    _: KW_ONLY
    signals: Signals | None = None
    equation: str = "force"
    position_scale: float | None = None
    sampling_interval: float = 1e-3
    plant: Any = None
    units: Mapping[str, str] | None = None
    sense: str | int = "auto"
    one_trajectory: bool = False
    learned_remainder: bool = False
    random_state: Any = None

    def fit(self, X: Any, y: Any, groups: Any = None, where: Any = None) -> Self:
        """Diagnose.

        Parameters
        ----------
        X : DataFrame or array, shape (n_samples, n_columns)
            Signals, and whatever the nominal model reads.
        y : array_like, shape (n_samples,)
            Measured target.
        where : array_like of bool, shape (n_samples,), optional
            Rows that count, such as those of a muscle under tension; windows with any other are left out.

        Raises
        ------
        MissingTrajectoryError
            Nothing names the runs.
        MissingColumnError
            X has no column with a role.
        ExcitationError
            No signal moves.
        """
        if is_simulator(self.nominal):
            return self._fit_simulator(X, y, groups)
        codes = self._codes(X, groups)
        table, y = self._read(X, y, reset=True, ensure_min_samples=2)
        y = column_or_1d(y, warn=True).astype(float)
        rng = check_random_state(self.random_state)
        self._check_settings()
        problem = self._problem(table, y, np.array(run_names(X, groups, codes))[codes], where)
        evidence = facing(
            problem, self.sense, self.effects, interval=self.sampling_interval, position=self.position_scale
        )
        self.position_scale_ = evidence.position
        found, _, [learned] = diagnose_evidence(evidence, self.effects, int(rng.randint(2**31 - 1)))
        self.noise_floor_ = float(np.median(evidence.noise))
        self.explainable_floor_, self.explainable_share_ = learned.rms, learned.share
        self.scaling_ = replace(evidence.scales, target=evidence.equation.sense * evidence.scales.target)
        self._write(found)
        self.remainder_ = {}
        if self.learned_remainder:
            left = np.where(evidence.without, 0.0, y - self._corrected(table, codes))
            of = evidence.equation
            self.remainder_ = learn(of.table, left, codes, of.dt, seed=int(rng.randint(2**31 - 1)))
        self._remember(X, y, groups=groups)
        return self

    def partial_fit(self, X: Any, y: Any, groups: Any = None) -> Self:
        """Take in a further log of the same machine, and diagnose all logs together.

        The runs of all calls are held and diagnosed together, as one ``fit`` on all of them would; a repeated run adds
        nothing. Above 100,000 rows whole runs are dropped at random, so that memory does not grow.

        Parameters
        ----------
        groups : array_like, shape (n_samples,), optional
            Run of each row; without it a column ``trajectory`` serves, and without both the log is one
            run.
        """
        return self._partial_fit_rows(X, y, None, groups)

    _memory_rows: ClassVar[int | None] = 100_000
    _checked = (
        {
            "effects": ("viscous_friction", "bladder_elasticity", "force_bias"),
            "signals": {"position": 0, "velocity": 0},
            "one_trajectory": True,
            "random_state": 0,
        },
    )

    def _stream_codes(self, X: Any, table: np.ndarray, groups: Any) -> np.ndarray:
        return self._codes(X, groups)

    def _fit_simulator(self, X: Any, y: Any, groups: Any) -> Self:
        found, self.target_ = diagnosis_of(self.nominal, self.effects, self.random_state, X, y, groups)
        self._write(found)
        self.corrected_ = self.nominal if found.corrected is None else found.corrected
        self.feature_names_in_ = np.array([str(c) for c in X.columns], dtype=object)
        self.n_features_in_ = len(X.columns)
        return self

    def _write(self, found: Any) -> None:
        self.findings_, self.windows_ = plain(found)
        self.verdict_, self.gap_, self.p_value_ = found.verdict, bool(found.gap), float(found.p_value)
        self.where_ = {"regions": found.regions, "bands": found.bands, "trajectories": found.trajectories}
        self.candidates_, self.causes_, self.closure_ = found.candidates, found.causes, found.closure
        self.next_run_ = found.next_run
        self.effects_ = {c.effects[0]: {k: float(p.value) for k, p in c.parameters.items()} for c in found.causes}

    @property
    def diagnosis_(self) -> Any:
        """The whole answer, a `pamid.gap.Diagnosis`."""
        if not hasattr(self, "findings_"):
            raise AttributeError(f"{type(self).__name__} has no diagnosis before fit.")
        return rebuilt(self.findings_, self.windows_)

    @property
    def next_experiment_(self) -> Any:
        """The old name of `next_run_`, for one version."""
        if not hasattr(self, "next_run_"):
            raise AttributeError(f"{type(self).__name__} has no next run before fit.")
        warnings.warn("GapDiagnoser.next_experiment_ is called next_run_.", FutureWarning, stacklevel=2)
        return self.next_run_

    def _problem(self, table: np.ndarray, y: np.ndarray, groups: np.ndarray, where: Any = None) -> Problem:
        """Return the equation on a table."""
        names = getattr(self, "feature_names_in_", None)

        def modelled(X: pd.DataFrame) -> np.ndarray:
            if self.nominal is None:
                return np.zeros(len(X))
            read: Any = X if names is not None else X.to_numpy()
            fitted = hasattr(self.nominal, "predict")
            out = self.nominal.predict(read_by(self.nominal, read)) if fitted else self.nominal(read)
            return np.asarray(out, dtype=float).reshape(len(X))

        columns = [str(n) for n in names] if names is not None else [f"X[{k}]" for k in range(table.shape[1])]
        labels = {role: columns[k] for role, k in self.signal_columns_.items()}
        return Problem(
            pd.DataFrame(table, columns=columns), y, modelled, groups, labels, self.equation, "", self.plant, [],
            self.units or {}, None if where is None else column_or_1d(where).astype(bool),
        )  # fmt: skip

    def _check_settings(self) -> None:
        require_one_of(self.equation, EQUATIONS, f"equation is {self.equation!r}.", "Say what y is.")
        if self.sense not in ("auto", 1, -1):
            raise UnknownOptionError(f"sense is {self.sense!r}.", "'auto', 1 or -1", "Say which way effects act on y.")
        if strange := sorted(set(self.units or {}) - {"target", "position", "pressure"}):
            raise UnknownOptionError(
                f"units names {', '.join(map(repr, strange))}.", "target, position, pressure", "Correct units=."
            )

    def predict(self, X: Any, groups: Any = None) -> np.ndarray:
        """Predict with the causes added to the nominal model.

        Parameters
        ----------
        groups : array_like, shape (n_samples,), optional
            Run of each row, for causes with memory.

        Returns
        -------
        ndarray, shape (n_samples,)
            Nominal model plus effects, and the learned remainder where that is wanted, in the unit of y.
        """
        check_is_fitted(self)
        if is_simulator(self.nominal):
            return predict_simulator(self.corrected_, self.target_, X, groups)
        table, _ = self._read(X, reset=False)
        codes = self._codes(X, groups)
        predicted = self._corrected(table, codes)
        if self.remainder_:
            of = equation_of(self._problem(table, predicted, codes), 1, self.sampling_interval)
            predicted = predicted + remaining(self.remainder_, of.table, codes, of.dt)
        return predicted

    def to_estimator(self) -> Any:
        """Return a hybrid model, not yet fitted, that holds the causes as its `effects`.

        Returns
        -------
        StaticPIHM or ThermodynamicPIHM
            For a muscle of the size that `plant` gives. Causes that it cannot contain raise a warning.

        Raises
        ------
        IncompatibleError
            If the diagnosis is not of a muscle's force or flow.
        """
        check_is_fitted(self, "causes_")
        return hybrid_with(self.causes_, self.equation, self.plant)

    def _corrected(self, table: np.ndarray, codes: np.ndarray) -> np.ndarray:
        """Return the nominal model with the causes added."""
        scales, problem = self.scaling_, self._problem(table, np.zeros(len(table)), codes)
        if not self.effects_:
            return np.asarray(problem.nominal(problem.X))
        found = equation_of(problem, int(np.sign(scales.target)), self.sampling_interval)
        places = found.placements(replace(scales, target=abs(scales.target)))
        return found.modelled([(places[name], places[name].made(values)) for name, values in self.effects_.items()])

    def __sklearn_tags__(self) -> Any:
        tags = super().__sklearn_tags__()
        tags.regressor_tags.poor_score = True  # it adds only named effects of the library to a model
        return tags

    # --- signals --------------------------------------------------------------------------------------------
    def _codes(self, X: Any, groups: Any) -> np.ndarray:
        several = groups is not None or has_trajectory_column(X)
        one = self.one_trajectory or (not several and hasattr(self, "findings_"))
        return run_codes(self, X, groups, one_trajectory=one)

    def _locate(self, n_columns: int) -> dict[str, int]:
        return located(self, n_columns)

    def _repr_html_inner(self) -> str:
        """Put the verdict before scikit-learn's picture of the estimator."""
        picture = str(super()._repr_html_inner())
        return spoken(self.verdict_, self.causes_) + picture if hasattr(self, "findings_") else picture
