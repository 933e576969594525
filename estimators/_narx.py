"""What autoregressive models with inputs share: lags within runs, one step ahead, free runs, and the fit to both."""

import warnings
from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import KW_ONLY, field
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np
from sklearn.utils.validation import column_or_1d

from pamid.errors import UnstableRunWarning
from pamid.fitting import free_run
from pamid.fitting.epochs import standardisation
from pamid.fitting.marquardt import Marquardt

from ._base import SignalRegressor, fitted_attributes
from ._checks import check_counts, check_sizes, warn_of_still_columns
from ._parameters import parameters
from ._progress import ProgressMixin, descend
from ._sequences import SequenceMixin
from ._streaming import SequenceStreaming
from ._trajectories import trajectory_slices


class FreeRun(NamedTuple):
    """A free run: outputs that follow from the inputs and the start alone."""

    y: np.ndarray
    """Outputs, in the unit of the target, within the bounds of the run. Shape (n_samples,)."""
    held: np.ndarray
    """Samples at which the run would have left the outputs of the fit and was held at their edge: it is unstable
    there, or was never asked so much. Shape (n_samples,)."""
    extrapolated: np.ndarray
    """Samples whose inputs lie outside the range of the fit, shape (n_samples,)."""

    def told(self, model: str, outputs: str) -> np.ndarray:
        """Return the outputs that a model predicts, and warn where the run had to be held."""
        if self.held.any():
            warnings.warn(
                f"{model} left the {outputs} of the fit at {int(self.held.sum())} of {len(self.y)} rows. "
                "Expected a free run within them. It was held at their edge; simulate() tells where.",
                UnstableRunWarning,
                stacklevel=4,
            )
        return self.y


@parameters
class OutputModel(SequenceStreaming, SequenceMixin, SignalRegressor):
    """An output that inputs drive along runs.

    Parameters
    ----------
    inputs : sequence of str
        Signals that drive the output: absolute pressure (Pa), load (kg), valve command or any other column.
    """

    equations = ("dynamic",)

    inputs: Sequence[str] = ("P", "load")
    _: KW_ONLY
    start: str | None = None

    @property
    def reads(self) -> tuple[str, ...]:  # type: ignore[override]
        return tuple(dict.fromkeys((*self.inputs, *((self.start,) if self.start else ()))))

    def _read_runs(self, X: Any, y: Any, groups: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Validate what a fit is given, note means and scales, and return inputs, output and the run of each row."""
        table, y = self._read(X, y, reset=True)
        target = np.asarray(column_or_1d(y, warn=True), dtype=float)
        codes = self._codes(X, table, groups)
        columns, ones = self._signals(table, self.inputs), np.ones(len(target))
        self.input_mean_, self.input_scale_ = standardisation(columns, ones)
        mean, scale = standardisation(target[:, None], ones)
        self.output_mean_, self.output_scale_ = float(mean[0]), float(scale[0])
        return columns, target, codes

    def _scaled(self, columns: np.ndarray, target: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return standardised inputs and output."""
        return (columns - self.input_mean_) / self.input_scale_, (target - self.output_mean_) / self.output_scale_


@parameters
class NARXRegressor(ProgressMixin, OutputModel):
    """An output from its own past and that of the inputs; subclasses give the function of the lags.

    Parameters
    ----------
    output_lags : int
        Past rows of the output that the model reads.
    input_lags : int
        Rows of the inputs that it reads, the present one first.
    horizon : int
        Rows of the free runs that the fit uses; 1 for single steps.
    start : str, optional
        Signal that holds, in the first row of each run, the output before it; by default a free run starts
        from the mean of the first outputs of the fit.
    margin : float
        Share of the range of the outputs of the fit by which a free run may leave it, dimensionless.
    max_iter : int
        Maximum number of Levenberg–Marquardt steps.
    tol : float
        Relative improvement of the loss that counts, dimensionless; three steps with less end the fit.

    Attributes
    ----------
    input_mean_, input_scale_, input_low_, input_high_ : ndarray, shape (n_inputs,)
        Mean, standard deviation and range of the inputs, in their units.
    output_mean_, output_scale_, output_low_, output_high_ : float
        The same of the output.
    step_scale_ : float
        Root mean square of the output's step from row to row, in units of `output_scale_`.
    start_mean_ : float
        Mean of the first outputs of the runs of the fit.
    loss_curve_ : list of float
        Mean squared error over the horizon after each step of the fit, in units of the output's variance.
    n_iter_ : int
        Steps of the fit.
    n_parameters_ : int
        Number of parameters.
    """

    _settings: ClassVar = {"": {}, "one step": {"horizon": 1}}

    _: KW_ONLY
    horizon: int = 50
    start: str | None = None
    margin: float = 0.2
    max_iter: int = 60
    tol: float = 1e-4

    delay: int = field(default=0, init=False)
    alpha: float = field(default=0.0, init=False)

    # --- what a subclass gives ----------------------------------------------------------------------------------
    @abstractmethod
    def _one_step(self, phi: np.ndarray, step: np.ndarray) -> np.ndarray:
        """Fit the function to single steps, set its structure, and return its parameters as a vector."""

    @abstractmethod
    def _function(self, theta: np.ndarray, phi: np.ndarray) -> np.ndarray:
        """Return the scaled step (n,) from scaled lags (n, n_lags)."""

    @abstractmethod
    def _derivatives(self, theta: np.ndarray, phi: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the step (n,), ∂step/∂φ (n, n_lags) and ∂step/∂θ (n, n_parameters)."""

    @abstractmethod
    def _keep(self, theta: np.ndarray, covariance: np.ndarray) -> None:
        """Store the parameters as fitted attributes."""

    @abstractmethod
    def _theta(self) -> np.ndarray:
        """Return the stored parameters as a vector."""

    def _model(self) -> free_run.StepModel:
        return free_run.StepModel(self._function, self._derivatives)

    # --- fit ----------------------------------------------------------------------------------------------------
    def fit(self, X: Any, y: Any, groups: Any = None) -> Self:
        """Fit to single steps, then to free runs over `horizon` rows.

        Parameters
        ----------
        X : DataFrame or array_like, shape (n_samples, n_columns)
            Inputs, SI units, in time order within each run, at one sampling period throughout.
        y : array_like, shape (n_samples,)
            Output, for instance absolute pressure (Pa) or contraction ratio.

        Raises
        ------
        MissingTrajectoryError
            If nothing says which rows form a run.
        InterleavedTrajectoryError
            If the rows of a run are not contiguous.
        """
        self._check_parameters()
        columns, target, codes = self._read_runs(X, y, groups)
        warn_of_still_columns(columns, self.inputs, type(self).__name__)
        self.input_low_, self.input_high_ = columns.min(axis=0), columns.max(axis=0)
        self.output_low_, self.output_high_ = float(target.min()), float(target.max())
        slices = trajectory_slices(codes)
        self.start_mean_ = float(np.mean([target[s.start] for s in slices]))
        u, z = self._scaled(columns, target)
        inputs, past, phi = self._lags(u, z, slices)
        step = z - past[:, 0]
        self.step_scale_ = float(np.sqrt(np.mean(step * step))) or 1.0
        theta = self._one_step(phi, step / self.step_scale_)
        model = self._model()
        stretches = free_run.segments(inputs, z, past, slices, int(self.horizon))
        self._codes_of_fit = codes  # lets a callback score on the rows of the fit without being given the runs
        steps = Marquardt(
            theta,
            lambda at: free_run.normal_equations(model, at, stretches, self.step_scale_),
            lambda at: free_run.squared_error(model, at, stretches, self.step_scale_),
            float(self.alpha) * len(target) * 1e-6,
        )
        try:
            descend(self, steps, (X, y), per=len(target), patience=3, attributes=lambda: self._attributes(steps.x))
        finally:
            del self._codes_of_fit
        found = free_run.normal_equations(model, steps.x, stretches, self.step_scale_)
        variance = found.loss / max(len(target) - len(theta), 1)
        covariance = variance * np.linalg.pinv(found.matrix, hermitian=True)
        self._keep(steps.x, covariance)
        self.n_parameters_ = len(theta)
        self._remember(X, y, groups=groups)
        return self

    # --- prediction ---------------------------------------------------------------------------------------------
    def predict(self, X: Any, groups: Any = None) -> np.ndarray:
        """Simulate each run freely, and warn where it had to be held."""
        return self.simulate(X, groups=groups).told(type(self).__name__, "outputs")

    def simulate(self, X: Any, groups: Any = None) -> FreeRun:
        """Simulate each run freely.

        The output before the first row is the signal `start`, or the mean of the first outputs of the fit. A run that
        leaves the outputs of the fit by more than `margin` of their range is held at that edge and flagged.

        Returns
        -------
        FreeRun
            Outputs and flags.
        """
        table = self._read_fitted(X, "start_mean_")
        slices = trajectory_slices(self._codes(X, table, groups))
        columns = self._signals(table, self.inputs)
        span = 1e-9 * (self.input_high_ - self.input_low_)
        beyond = ((columns < self.input_low_ - span) | (columns > self.input_high_ + span)).any(axis=1)
        first = np.array([s.start for s in slices])
        start = self._signal(table, self.start)[first] if self.start else np.full(len(first), self.start_mean_)
        u, start = self._scaled(columns, start)
        room = float(self.margin) * max(self.output_high_ - self.output_low_, 1e-9 * self.output_scale_)
        low, high = (
            (edge - self.output_mean_) / self.output_scale_
            for edge in (self.output_low_ - room, self.output_high_ + room)
        )
        lags = free_run.input_lags(u, slices, int(self.input_lags), int(self.delay))
        past = np.repeat(start[:, None], int(self.output_lags), axis=1)
        y, held = free_run.free_run(self._model(), self._theta(), lags, past, slices, self.step_scale_, (low, high))
        return FreeRun(y * self.output_scale_ + self.output_mean_, held, beyond)

    def predict_one_step(self, X: Any, y: Any, groups: Any = None) -> np.ndarray:
        """Predict each row from the measured outputs before it.

        Parameters
        ----------
        y : array_like, shape (n_samples,)
            Measured output.

        Returns
        -------
        ndarray, shape (n_samples,)
            Output one row ahead, in the unit of y.
        """
        self._check_fitted("start_mean_")
        table, y = self._read(X, y, reset=False)
        slices = trajectory_slices(self._codes(X, table, groups))
        u, z = self._scaled(self._signals(table, self.inputs), np.asarray(column_or_1d(y), dtype=float))
        _, past, phi = self._lags(u, z, slices)
        ahead = past[:, 0] + self.step_scale_ * self._function(self._theta(), phi)
        return np.asarray(ahead * self.output_scale_ + self.output_mean_)

    # --- data ---------------------------------------------------------------------------------------------------
    def _check_parameters(self) -> None:
        check_counts(self, "output_lags", "input_lags", "horizon", "max_iter")
        check_sizes(self, alpha=0.0, margin=0.0, tol=0.0)

    def _lags(self, u: np.ndarray, z: np.ndarray, slices: list[slice]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the lags of the inputs, those of the output, and both together for each row."""
        inputs = free_run.input_lags(u, slices, int(self.input_lags), int(self.delay))
        past = free_run.output_lags(z, slices, int(self.output_lags))
        return inputs, past, np.concatenate([past, inputs], axis=1)

    def _attributes(self, theta: np.ndarray) -> dict[str, Any]:
        """What a callback needs for a fitted copy."""
        self._keep(theta, np.zeros((len(theta), len(theta))))
        return fitted_attributes(self)
