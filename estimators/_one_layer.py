"""Networks of one hidden layer: their fit, and where `InverseModel` and `ForwardModel` had data."""

from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY, field
from typing import Any, ClassVar, Self

import numpy as np

from pamid.errors import ParameterError, ShapeError
from pamid.fitting.epochs import local_generator, standardisation
from pamid.fitting.one_layer import forward, forward_by_columns, initial_weights, marquardt_on_rows, unflatten
from pamid.fitting.stream_memory import Rows

from ._base import SignalRegressor
from ._checks import check_counts, check_sizes, row_weights, warn_of_still_columns
from ._parameters import parameters
from ._progress import ProgressMixin, descend
from ._sequences import SequenceMixin, last_direction
from ._streaming import Streaming
from ._trajectories import trajectory_codes

DIRECTION = "direction"
"""Signal of exported code that says where the turning input last went: 1 up, −1 down, 0 before it moved."""

CELL = 0.25
"""Edge of the cells that note where the fit had data, in standard deviations of each input."""
_CANDIDATE_STEPS = 15
_SLOW = 5  # steps without improvement that end a training


@parameters
class OneLayerNetwork(ProgressMixin):
    """A network of one hidden layer, trained by Levenberg–Marquardt from the best of some initial weights.

    Parameters
    ----------
    max_iter : int
        Maximum number of Levenberg–Marquardt steps.
    tol : float
        Relative improvement of the loss that counts, dimensionless; five steps with less end the fit.
    n_starts : int
        Initial weights tried for a few steps; the best are trained further.
    """

    _: KW_ONLY
    hidden: int = 10
    alpha: float = 0.01
    max_iter: int = 200
    tol: float = 1e-5
    n_starts: int = 3
    random_state: Any = None

    weights_: dict[str, np.ndarray] = field(init=False)

    def _check_network(self) -> None:
        check_counts(self, "hidden", "max_iter", "n_starts")
        check_sizes(self, alpha=0.0, tol=0.0)

    def _train(self, x: np.ndarray, z: np.ndarray, weight: np.ndarray, data: tuple[Any, Any], per: float) -> None:
        """Train on scaled rows; the loss is told per unit of weight."""
        rng = local_generator(self.random_state)
        shape = (x.shape[1], int(self.hidden), z.shape[1])
        starts = [initial_weights(rng, *shape) for _ in range(int(self.n_starts))]
        trials = [marquardt_on_rows(w, x, z, weight, float(self.alpha)) for w in starts]
        if len(trials) > 1:  # a few steps from each start, then on from the best
            for trial in trials:
                for _ in range(_CANDIDATE_STEPS):
                    if not trial.step():
                        break
        best = min(trials, key=lambda t: t.loss)

        def weights() -> dict[str, Any]:
            return {"weights_": unflatten(best.x, *shape)}

        descend(self, best, data, per=per, patience=_SLOW, attributes=weights, stacklevel=7)
        self.weights_ = unflatten(best.x, *shape)


@parameters
class OneLayerRegressor(Streaming, OneLayerNetwork, SequenceMixin, SignalRegressor):
    """A network of one hidden layer; subclasses name inputs and outputs.

    Parameters
    ----------
    alpha : float
        Weight decay: factor of the squared weights in the sum of squares of the standardised targets, dimensionless.
    forget_rows : float, optional
        Rows over which `partial_fit` forgets; by default all rows count alike.

    Attributes
    ----------
    weights_ : dict of str to ndarray
        ``W0`` (n_inputs, hidden), ``b0``, ``W1`` (hidden, n_outputs), ``b1``.
    input_mean_, input_scale_, input_low_, input_high_ : ndarray, shape (n_inputs,)
        Mean, standard deviation and range of the inputs, in their units.
    target_mean_, target_scale_, target_low_, target_high_ : ndarray, shape (n_outputs,)
        The same of the outputs.
    cells_ : ndarray of int, shape (n_cells, n_inputs)
        Cells of the input space that held rows of the fit.
    loss_curve_ : list of float
        Loss after each step, per row, in units of the targets' variances.
    n_iter_ : int
        Steps of the last fit, and of `partial_fit` since.
    n_outputs_ : int
        Number of outputs; 0 for one without an axis of its own.
    """

    _turning: ClassVar[str]
    """The input whose last direction may be a further input."""

    inputs: Sequence[str] = ()
    _: KW_ONLY
    direction: bool = False
    direction_step: float = 1e5
    forget_rows: float | None = None

    cells_: np.ndarray = field(init=False)
    input_low_: np.ndarray = field(init=False)
    input_high_: np.ndarray = field(init=False)
    target_low_: np.ndarray = field(init=False)
    target_high_: np.ndarray = field(init=False)

    @property
    def reads(self) -> tuple[str, ...]:  # type: ignore[override]
        return tuple(self.inputs)

    @property
    def sequential(self) -> bool:
        return bool(self.direction)

    def fit(self, X: Any, y: Any, sample_weight: Any = None, groups: Any = None) -> Self:
        """Train the network from new weights.

        Parameters
        ----------
        y : array_like, shape (n_samples,) or (n_samples, n_outputs)
            Target.
        groups : array_like, shape (n_samples,), optional
            Run of each row, read if `direction` is set; a column ``trajectory`` of a DataFrame serves too.

        Raises
        ------
        MissingTrajectoryError
            If the direction of motion is asked for and nothing names the runs.
        """
        self._check_parameters()
        if y is None:
            raise ShapeError(
                f"{type(self).__name__} requires y to be passed, but the target y is None.", "a target", "Pass y."
            )
        table, given = self._read(X, y, reset=True)
        target = self._target(given)
        self.n_outputs_ = 0 if target.ndim == 1 else target.shape[1]  # 0: one output, without an axis of its own
        target, weight = self._output_columns(target), row_weights(sample_weight, table)
        columns = self._columns(X, table, groups)
        used = weight > 0
        warn_of_still_columns(columns[:, : len(self.inputs)], self.inputs, type(self).__name__)
        self._set_scales(columns[used], target[used], weight[used])
        x, z = self._scaled(columns[used], target[used])
        self._train(x, z, weight[used], (X, y), float(weight[used].sum()))
        self._remember(X, y, sample_weight, groups)
        return self

    def partial_fit(self, X: Any, y: Any, sample_weight: Any = None, groups: Any = None) -> Self:
        """Take in a batch of a stream: the fit of all rows so far, or of late ones if `forget_rows` is set.

        Up to 5,000 different rows are remembered, with `direction` 20,000 in whole runs; beyond, a fair sample.
        With `forget_rows` their weight fades by 1/e over so many rows. Once most of it has faded, the network goes on
        from where it stands, which it keeps as far as the memory says nothing, and its error on the memory never rises.
        A change of the muscle is not detected here: `pamid.online.ChangeMonitor` does that, and `fit` starts again.
        """
        return self._partial_fit_rows(X, y, sample_weight, groups)

    def _continue(self, rows: Rows) -> None:
        """Train on from where the network stands; scales stay."""
        columns = self._columns(rows.X, rows.X, rows.unit)
        x, z = self._scaled(columns, rows.y)
        # Faded rows add no information, but theirs is in the weights: nothing pulls these to zero.
        steps = marquardt_on_rows(self.weights_, x, z, rows.weight, float(self.alpha), held=True)
        slow, taken = 0, 0
        while taken < int(self.max_iter) and slow < _SLOW:
            before = steps.loss
            if not steps.step():
                break
            slow = slow + 1 if steps.loss > before * (1.0 - float(self.tol)) else 0
            taken += 1
        self.weights_ = unflatten(steps.x, x.shape[1], int(self.hidden), z.shape[1])
        self.cells_ = np.unique(np.concatenate([self.cells_, self._cells(x)]), axis=0)
        self.input_low_ = np.minimum(self.input_low_, columns.min(axis=0))
        self.input_high_ = np.maximum(self.input_high_, columns.max(axis=0))
        self.target_low_ = np.minimum(self.target_low_, rows.y.min(axis=0))
        self.target_high_ = np.maximum(self.target_high_, rows.y.max(axis=0))
        self.n_iter_ += taken

    def _fade(self, weight: float) -> float:
        return 1.0 if self.forget_rows is None else float(np.exp(-weight / float(self.forget_rows)))

    def _in_order(self) -> bool:
        return bool(self.direction)

    def _memory_columns(self, rows: Rows) -> bool:
        return self.n_outputs_ > 0

    def _stream_table(self, X: Any, y: Any) -> tuple[np.ndarray, np.ndarray]:
        self._check_parameters()
        table, y = self._read(X, y, reset=False)
        return table, self._output_columns(self._target(y))

    def _stream_codes(self, X: Any, table: np.ndarray, groups: Any) -> np.ndarray | None:
        return self._codes(X, table, groups) if self.direction else trajectory_codes(X, groups)

    def predict(self, X: Any, groups: Any = None) -> np.ndarray:
        """Evaluate the network; the answer stays within its bounds.

        Returns
        -------
        ndarray, shape (n_samples,) or (n_samples, n_outputs)
            Prediction in the units of y.
        """
        return self._bounded(*self._answer(X, groups))

    # --- what a subclass gives ----------------------------------------------------------------------------------
    def _bounded(self, bare: np.ndarray, outside: np.ndarray) -> np.ndarray:
        """Bound an answer, and warn or raise as the estimator says."""
        raise NotImplementedError

    @staticmethod
    def _target(y: Any) -> np.ndarray:
        return np.asarray(y, dtype=float)

    def _limits(self) -> tuple[np.ndarray, np.ndarray]:
        """Return between what the answer is held."""
        raise NotImplementedError

    def formulas(self, signals: Mapping[str, Any]) -> dict[str, tuple[str, Any]]:
        """Return the predictions as formulas of the signals, which may be symbols: what an export writes."""
        named = [*self.inputs, *((DIRECTION,) if self.direction else ())]
        bare = forward_by_columns(self.weights_, [signals[n] for n in named], self.input_mean_, self.input_scale_)
        low, high = (a.tolist() for a in self._limits())
        mean, scale = self.target_mean_.tolist(), self.target_scale_.tolist()
        return {
            name: (unit, np.clip(y * scale[k] + mean[k], low[k], high[k]))
            for k, (y, (name, unit)) in enumerate(zip(bare, self._answers(len(mean)), strict=True))
        }

    def _answers(self, number: int) -> list[tuple[str, str]]:
        """Return names and units of the answers."""
        return [(f"y{k}", "unit of the fit") for k in range(number)]

    # --- data ---------------------------------------------------------------------------------------------------
    def _check_parameters(self) -> None:
        self._check_network()
        check_sizes(self, direction_step=1e-12)
        if self.forget_rows is not None:
            check_sizes(self, forget_rows=1.0)
        if self.direction and self._turning not in self.inputs:
            raise ParameterError(
                f"direction is set, and inputs are {tuple(self.inputs)!r}.",
                f"{self._turning} among the inputs, whose direction it is",
                f"Add {self._turning!r} to inputs, or set direction=False.",
            )

    def _output_columns(self, target: np.ndarray) -> np.ndarray:
        target = target.reshape(len(target), -1)
        if target.shape[1] != max(self.n_outputs_, 1):
            raise ShapeError(
                f"y has {target.shape[1]} columns.",
                f"{max(self.n_outputs_, 1)}, as in the fit",
                "Pass the same targets.",
            )
        return target

    def _columns(self, X: Any, table: np.ndarray, groups: Any) -> np.ndarray:
        columns = [self._signal(table, name) for name in self.inputs]
        if self.direction:
            codes = self._codes(X, table, groups)
            columns.append(last_direction(self._signal(table, self._turning), codes, float(self.direction_step)))
        return np.column_stack(columns)

    def _set_scales(self, columns: np.ndarray, target: np.ndarray, weight: np.ndarray) -> None:
        self.input_mean_, self.input_scale_ = standardisation(columns, weight)
        self.target_mean_, self.target_scale_ = standardisation(target, weight)
        self.input_low_, self.input_high_ = columns.min(axis=0), columns.max(axis=0)
        self.target_low_, self.target_high_ = target.min(axis=0), target.max(axis=0)
        self.cells_ = self._cells((columns - self.input_mean_) / self.input_scale_)

    def _scaled(self, columns: np.ndarray, target: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return (columns - self.input_mean_) / self.input_scale_, (target - self.target_mean_) / self.target_scale_

    # --- answers ------------------------------------------------------------------------------------------------
    def _answer(self, X: Any, groups: Any) -> tuple[np.ndarray, np.ndarray]:
        """Return the network's bare answer (n, n_outputs) and which rows lie outside the data of the fit."""
        table = self._read_fitted(X, "weights_")
        x = (self._columns(X, table, groups) - self.input_mean_) / self.input_scale_
        return forward(self.weights_, x) * self.target_scale_ + self.target_mean_, self._outside(x)

    @staticmethod
    def _cells(x: np.ndarray) -> np.ndarray:
        """Cells of the scaled input space that hold rows."""
        return np.unique(np.round(np.clip(x, -1e6, 1e6) / CELL).astype(np.int64), axis=0)

    def _outside(self, x: np.ndarray) -> np.ndarray:
        """Rows that lie in no cell of the fit, nor beside one."""
        here = np.round(np.clip(x, -1e6, 1e6) / CELL).astype(np.int64)
        which = np.zeros(1, dtype=int)
        if len(here) > 1:
            here, which = np.unique(here, axis=0, return_inverse=True)
        near = np.zeros(len(here), dtype=bool)
        for start in range(0, len(here), 512):
            part = here[start : start + 512, None, :] - self.cells_[None]
            near[start : start + 512] = (np.abs(part).max(axis=2) <= 1).any(axis=1)
        return ~near[which.ravel()]
