"""A plain feed-forward network on the muscle's signals: the baseline that knows no physics."""

from collections.abc import Sequence
from dataclasses import KW_ONLY
from itertools import pairwise
from typing import Any, ClassVar, Self

import numpy as np

from pamid.errors import ParameterError
from pamid.fitting.epochs import (
    AdamSteps,
    Best,
    Weights,
    held_out_rows,
    local_generator,
    penalty,
    run_epochs,
    to_tensors,
)

from ._checks import check_counts, check_option, check_sizes, warn_of_still_columns
from ._parameters import parameters
from ._plain_network import PlainNetwork
from ._progress import FitProgress, fit_progress
from ._streaming import Streaming
from ._trajectories import trajectory_codes

ACTIVATIONS = ("tanh", "softplus", "relu")
OPTIMIZERS = ("adam", "lbfgs")
_CHUNK = 65536  # rows predicted at a time, which bounds the memory of a prediction


@parameters
class MLP(Streaming, PlainNetwork):
    r"""Plain network from the muscle's signals to a force or a mass flow.

    .. math:: y = \bar y + \sigma_y\, N\!\left(\frac{s - \bar s}{\sigma_s}\right), \quad
        s = (\varepsilon, P, \dot P) \text{ or any other signals}

    trained on the mean squared error. Rows are independent: the network has no memory.

    Parameters
    ----------
    inputs : sequence of str, default=("eps", "P", "dP")
        Signals that the network reads: contraction ratio (dimensionless), absolute pressure (Pa), its rate (Pa/s);
        also ``"deps"`` (1/s) or any other column.
    hidden : sequence of int, default=(64, 64)
        Units of each hidden layer.
    activation : {"tanh", "softplus", "relu"}, default="tanh"
        Function of the hidden units.
    optimizer : {"adam", "lbfgs"}, default="adam"
        Adam on mini-batches, its rate lowered along a half cosine; or L-BFGS on all rows at once.
    learning_rate : float, default=0.003
        First rate of Adam, dimensionless, as inputs and target are standardised.
    batch_size : int, default=256
        Rows of a mini-batch. If there are no more rows than that, every step uses them all.
    max_iter : int, default=200
        Maximum number of epochs (Adam) or iterations (L-BFGS).
    alpha : float, default=0.0
        Weight decay: factor of the sum of squared weights in the loss, dimensionless.
    random_state : int or RandomState, optional
        Seed of the initial weights, the order of rows and the choice of held-out runs.

    Attributes
    ----------
    weights_ : dict of str to ndarray
        Weight matrices ``W0``, ``W1``, ... of shape (n_in, n_out), and biases ``b0``, ``b1``, ...
    loss_curve_ : list of float
        Training loss of each epoch: mean squared error in units of the target's variance, and the weight decay.

    See Also
    --------
    Recurrent : A network with memory.

    Notes
    -----
    Sample weights are equivalent to repeated rows, up to rounding, where a step uses all rows. A fit that is
    interrupted keeps its best weights so far and warns. Callbacks of scikit-learn are supported (``set_callbacks``).

    References
    ----------
    D. P. Kingma, J. Ba, "Adam: a method for stochastic optimization", ICLR 2015.
    https://doi.org/10.48550/arXiv.1412.6980

    D. C. Liu, J. Nocedal, "On the limited memory BFGS method for large scale optimization", Mathematical Programming
    45, 1989. https://doi.org/10.1007/BF01589116

    Examples
    --------
    >>> import numpy as np, pandas as pd
    >>> from pamid.estimators import MLP
    >>> rng = np.random.default_rng(0)
    >>> X = pd.DataFrame({"eps": rng.uniform(0, 0.25, 400), "P": rng.uniform(1e5, 7e5, 400)})
    >>> force = 1e-3 * (X["P"] - 1e5) * (1 - 3 * X["eps"])
    >>> model = MLP(("eps", "P"), hidden=(8,), optimizer="lbfgs", random_state=0).fit(X, force)
    >>> bool(model.score(X, force) > 0.999)
    True
    """

    inputs: Sequence[str] = ("eps", "P", "dP")
    _: KW_ONLY
    hidden: Sequence[int] = (64, 64)
    activation: str = "tanh"
    optimizer: str = "adam"
    learning_rate: float = 3e-3
    batch_size: int = 256
    max_iter: int = 200
    alpha: float = 0.0
    patience: int = 30
    tol: float = 1e-5

    _small: ClassVar[dict[str, Any]] = {"hidden": (3,), "max_iter": 4, "random_state": 0}
    _checked = (_small, _small | {"inputs": ("x",), "activation": "softplus", "optimizer": "lbfgs", "alpha": 1e-4})

    def fit(self, X: Any, y: Any, sample_weight: Any = None, groups: Any = None) -> Self:
        """Train the network from new weights.

        Parameters
        ----------
        groups : array_like, shape (n_samples,), optional
            Run of each row, read if `early_stopping` is set; a column ``trajectory`` of a DataFrame serves
            too.

        Raises
        ------
        MissingTrajectoryError
            If early stopping is asked for and nothing names the runs.
        DivergedError
            If the loss is not finite from the first epoch.
        """
        self._check_parameters()
        rng = local_generator(self.random_state)
        table, target, weights = self._read_weighted(X, y, sample_weight, reset=True)
        columns = self._signals(table, self.inputs)
        warn_of_still_columns(columns, self.inputs, type(self).__name__)
        held_out = np.zeros(len(target), dtype=bool)
        if self.early_stopping:
            codes = trajectory_codes(X, groups)
            held_out = held_out_rows(codes, self.validation_fraction, rng, type(self).__name__)
        used = ~held_out & (weights > 0)
        self._set_scales(columns[used], target[used], weights[used])
        training = self._scaled(columns[used], target[used], weights[used])
        validation = self._scaled(columns[held_out], target[held_out], weights[held_out]) if held_out.any() else None
        initial = self._initial_weights(rng)
        best = Best(int(self.patience), float(self.tol))
        train = self._train_adam if self.optimizer == "adam" else self._train_lbfgs
        with fit_progress(self, X=X, y=y, max_epochs=int(self.max_iter)) as progress:
            train(initial, training, validation, progress, best, rng, int(self.max_iter))
        self.weights_ = initial if best.weights is None else best.weights
        self.loss_curve_ = progress.losses
        self.validation_curve_ = best.curve if validation is not None else []
        self.n_iter_ = max(progress.n_epochs, 1)
        self._remember(X, y, sample_weight, groups)
        return self

    def predict(self, X: Any) -> np.ndarray:
        """Evaluate the network."""
        columns = self._signals(self._read_fitted(X, "weights_"), self.inputs)
        result = np.empty(len(columns))
        for start in range(0, len(columns), _CHUNK):
            chunk = slice(start, start + _CHUNK)
            result[chunk] = self._forward_numpy((columns[chunk] - self.input_mean_) / self.input_scale_)
        return result * self.target_scale_ + self.target_mean_

    # --- data ---------------------------------------------------------------------------------------------------
    def _check_parameters(self) -> None:
        check_counts(self, "batch_size", "max_iter", "patience")
        check_sizes(self, learning_rate=0.0, alpha=0.0, tol=0.0)
        check_option(self, "activation", ACTIVATIONS)
        check_option(self, "optimizer", OPTIMIZERS)
        if any(int(units) < 1 for units in self.hidden):
            raise ParameterError(f"hidden is {self.hidden!r}.", "at least one unit in each layer", "Correct hidden.")

    def _scaled(self, columns: np.ndarray, target: np.ndarray, weights: np.ndarray) -> tuple[Any, Any, Any]:
        """Standardised inputs and target, and weights of mean one, as tensors."""
        import torch

        arrays = (
            (columns - self.input_mean_) / self.input_scale_,
            (target - self.target_mean_) / self.target_scale_,
            weights / weights.mean() if weights.any() else weights,
        )
        inputs, wanted, shares = (torch.as_tensor(a, dtype=torch.float64, device=self.device) for a in arrays)
        return inputs, wanted, shares

    # --- network ------------------------------------------------------------------------------------------------
    def _initial_weights(self, rng: np.random.Generator) -> Weights:
        """Glorot's initialisation for smooth functions, He's for relu."""
        sizes = [len(self.inputs), *(int(units) for units in self.hidden), 1]
        weights: Weights = {}
        for layer, (n_in, n_out) in enumerate(pairwise(sizes)):
            bound = np.sqrt(6.0 / n_in) if self.activation == "relu" else np.sqrt(6.0 / (n_in + n_out))
            weights[f"W{layer}"] = rng.uniform(-bound, bound, (n_in, n_out))
            weights[f"b{layer}"] = np.zeros(n_out)
        return weights

    def _forward(self, tensors: dict[str, Any], inputs: Any) -> Any:
        import torch

        function: Any = getattr(torch.nn.functional, self.activation)
        x = inputs
        last = len(tensors) // 2 - 1
        for layer in range(last):
            x = function(torch.addmm(tensors[f"b{layer}"], x, tensors[f"W{layer}"]))
        return torch.addmm(tensors[f"b{last}"], x, tensors[f"W{last}"])[:, 0]

    def _forward_numpy(self, x: np.ndarray) -> np.ndarray:
        last = len(self.weights_) // 2 - 1
        for layer in range(last):
            x = x @ self.weights_[f"W{layer}"] + self.weights_[f"b{layer}"]
            if self.activation == "tanh":
                x = np.tanh(x)
            elif self.activation == "relu":
                x = np.maximum(x, 0.0)
            else:
                x = np.logaddexp(x, 0.0)
        return (x @ self.weights_[f"W{last}"] + self.weights_[f"b{last}"])[:, 0]

    def _loss(self, tensors: dict[str, Any], rows: tuple[Any, Any, Any]) -> Any:
        inputs, target, weights = rows
        error = (weights * (self._forward(tensors, inputs) - target) ** 2).mean()
        return error + penalty(list(tensors.values()), float(self.alpha))

    def _error(self, tensors: dict[str, Any], rows: tuple[Any, Any, Any]) -> float:
        import torch

        inputs, target, weights = rows
        with torch.no_grad():
            return float((weights * (self._forward(tensors, inputs) - target) ** 2).mean())

    # --- training -----------------------------------------------------------------------------------------------
    def _epoch(
        self, tensors: dict[str, Any], adam: AdamSteps, rows: tuple[Any, Any, Any], rng: np.random.Generator
    ) -> float:
        """One pass over the rows; returns the mean of the losses met on the way."""
        import torch

        n, size = len(rows[0]), int(self.batch_size)
        if n > size:
            order = torch.as_tensor(rng.permutation(n), device=rows[0].device)
            rows = (rows[0][order], rows[1][order], rows[2][order])
        total = 0.0
        for start in range(0, n, size):
            batch = (rows[0][start : start + size], rows[1][start : start + size], rows[2][start : start + size])
            loss = self._loss(tensors, batch)
            adam.step(loss)
            total += float(loss.detach()) * len(batch[0])
        return total / n

    def _train_adam(
        self, initial: Weights, training: Any, validation: Any, progress: FitProgress, best: Best, rng: Any, epochs: int
    ) -> None:
        tensors = to_tensors(initial, self.device)
        adam = AdamSteps(tensors, float(self.learning_rate))

        def one_epoch(epoch: int) -> float:
            adam.anneal(epoch / epochs)
            return self._epoch(tensors, adam, training, rng)

        run_epochs(
            progress,
            best,
            tensors,
            one_epoch,
            None if validation is None else lambda: self._error(tensors, validation),
            one_step=len(training[0]) <= int(self.batch_size),
            attributes=lambda weights: {"weights_": weights},
        )

    def _train_lbfgs(
        self, initial: Weights, training: Any, validation: Any, progress: FitProgress, best: Best, rng: Any, epochs: int
    ) -> None:
        import torch
        from scipy.optimize import OptimizeResult, minimize

        shapes = {name: w.shape for name, w in initial.items()}

        def split(flat: np.ndarray) -> Weights:
            parts = np.split(flat, np.cumsum([int(np.prod(s)) for s in shapes.values()])[:-1])
            return {name: part.reshape(shapes[name]).copy() for name, part in zip(shapes, parts, strict=True)}

        def value_and_gradient(flat: np.ndarray) -> tuple[float, np.ndarray]:
            tensors = to_tensors(split(flat), self.device)
            loss = self._loss(tensors, training)
            gradients = torch.autograd.grad(loss, list(tensors.values()))
            return float(loss.detach()), np.concatenate([g.cpu().numpy().ravel() for g in gradients])

        def after_iteration(intermediate_result: OptimizeResult) -> None:
            weights = split(intermediate_result.x)
            loss = float(intermediate_result.fun)
            score = loss
            if validation is not None:
                score = self._error(to_tensors(weights, self.device), validation)
            enough = best.offer(score, lambda: weights)
            shown = None if validation is None else score
            if progress.report(loss, validation_loss=shown, attributes=lambda: {"weights_": best.weights}) or enough:
                raise StopIteration

        start = np.concatenate([w.ravel() for w in initial.values()])
        minimize(
            value_and_gradient,
            start,
            jac=True,
            method="L-BFGS-B",
            callback=after_iteration,
            options={"maxiter": epochs, "maxcor": 20, "ftol": 1e-15, "gtol": 1e-9, "maxfun": 10**9},
        )
