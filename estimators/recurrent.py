"""A recurrent network on runs: the baseline with memory that knows no physics."""

from collections.abc import Sequence
from dataclasses import KW_ONLY
from typing import Any, ClassVar, Self

import numpy as np
from sklearn.utils.validation import column_or_1d

from pamid.errors import ParameterError
from pamid.fitting.epochs import (
    AdamSteps,
    Best,
    Weights,
    held_out_rows,
    local_generator,
    run_epochs,
    to_tensors,
)
from pamid.fitting.recurrent import CELLS, Network, Piece, detached, index_table, initial_weights, pieces_of

from ._checks import check_counts, check_option, check_sizes, warn_of_still_columns
from ._parameters import parameters
from ._plain_network import PlainNetwork
from ._progress import fit_progress
from ._sequences import SequenceMixin
from ._streaming import SequenceStreaming
from ._trajectories import trajectory_slices

_STEPS_AT_ONCE = 262_144  # rows times sequences predicted at a time, which bounds the memory of a prediction


@parameters
class Recurrent(SequenceStreaming, SequenceMixin, PlainNetwork):
    r"""Recurrent network from the muscle's signals and their history to a force or a mass flow.

    .. math:: h_t = f(h_{t-1}, s_t), \qquad y_t = w^\top h_t + b

    with a gated recurrent unit, a long short-term memory or a plain Elman cell as :math:`f`, on standardised signals
    :math:`s` and target. The state :math:`h` starts again in each run: it is what the cell reaches when the
    first row is held for `burn_in` rows, in the fit as in a prediction. Nothing passes from one run to the
    next.

    Parameters
    ----------
    inputs : sequence of str, default=("eps", "P")
        Signals that the network reads: contraction ratio (dimensionless), absolute pressure (Pa); rates (1/s, Pa/s)
        or any other column may be added.
    cell : {"gru", "lstm", "elman"}, default="gru"
        Kind of recurrent cell.
    hidden : int, default=16
        Units of each layer.
    layers : int, default=1
        Recurrent layers.
    window : int, default=50
        Rows over which the error is traced back in time, after which one step is made; the state is carried on.
    segment_length : int or None, default=1000
        Longer runs are cut, in the fit alone, into segments of so many rows that run side by side; each is preceded by
        the `burn_in` rows before it. None keeps runs whole.
    burn_in : int, default=25
        Rows that lead into a run or a segment before its first row counts.
    learning_rate : float, default=0.01
        First rate of Adam, dimensionless, lowered along a half cosine.
    batch_size : int, default=32
        Segments that run side by side.
    max_iter : int, default=50
        Maximum number of epochs.
    random_state : int or RandomState, optional
        Seed of the initial weights, the order of segments and the choice of held-out runs.

    Attributes
    ----------
    weights_ : dict of str to ndarray
        Weights of the cells, with torch's names, and ``out_weight``, ``out_bias``.
    loss_curve_ : list of float
        Training loss of each epoch: mean squared error in units of the target's variance.

    See Also
    --------
    MLP : A network without memory.

    Notes
    -----
    There is no `sample_weight`: a row repeated is one more step in time here, not a row that counts twice. A fit that
    is interrupted keeps its best weights so far and warns. Callbacks of scikit-learn are supported
    (``set_callbacks``).

    References
    ----------
    K. Cho et al., "Learning phrase representations using RNN encoder-decoder for statistical machine translation",
    EMNLP 2014. https://doi.org/10.3115/v1/D14-1179

    S. Hochreiter, J. Schmidhuber, "Long short-term memory", Neural Computation 9(8), 1997.
    https://doi.org/10.1162/neco.1997.9.8.1735

    J. L. Elman, "Finding structure in time", Cognitive Science 14(2), 1990.
    https://doi.org/10.1207/s15516709cog1402_1

    P. J. Werbos, "Backpropagation through time: what it does and how to do it", Proceedings of the IEEE 78(10), 1990.
    https://doi.org/10.1109/5.58337

    Examples
    --------
    A force that lags behind the pressure cannot be predicted from one row alone:

    >>> import numpy as np, pandas as pd
    >>> from pamid.estimators import Recurrent
    >>> rng = np.random.default_rng(0)
    >>> P = np.repeat(rng.uniform(1e5, 7e5, 60), 10)
    >>> force = np.zeros(600)
    >>> for k in range(1, 600):
    ...     force[k] = force[k - 1] + 0.3 * (1e-3 * P[k] - force[k - 1])
    >>> X = pd.DataFrame({"P": P, "trajectory": np.repeat(["a", "b", "c"], 200)})
    >>> model = Recurrent(("P",), hidden=8, max_iter=40, random_state=0).fit(X, force)
    >>> bool(model.score(X, force) > 0.9)
    True
    """

    inputs: Sequence[str] = ("eps", "P")
    _: KW_ONLY
    cell: str = "gru"
    hidden: int = 16
    layers: int = 1
    window: int = 50
    segment_length: int | None = 1000
    burn_in: int = 25
    learning_rate: float = 1e-2
    batch_size: int = 32
    max_iter: int = 50
    patience: int = 20
    tol: float = 1e-4

    # scikit-learn's checks ask for predictions that do not change with the order of rows; what has a memory gives
    # them only where each row is a run of its own, which the values of the first column make it
    _small: ClassVar[dict[str, Any]] = {
        "inputs": ("x",), "trajectory_column": 0, "hidden": 2, "window": 4, "burn_in": 2, "max_iter": 2,
        "random_state": 0,
    }  # fmt: skip
    _checked = (_small, _small | {"cell": "lstm", "layers": 2, "segment_length": None})

    def fit(self, X: Any, y: Any, groups: Any = None) -> Self:
        """Train the network from new weights.

        Parameters
        ----------
        X : DataFrame or array_like, shape (n_samples, n_columns)
            Signals, SI units, in time order within each run, at one sampling period throughout.

        Raises
        ------
        MissingTrajectoryError
            If nothing says which rows form a run.
        InterleavedTrajectoryError
            If the rows of a run are not contiguous.
        DivergedError
            If the loss is not finite from the first epoch.
        """
        self._check_parameters()
        rng = local_generator(self.random_state)
        table, given = self._read(X, y, reset=True)
        columns, target = self._signals(table, self.inputs), column_or_1d(given, warn=True).astype(float)
        codes = self._codes(X, table, groups)
        warn_of_still_columns(columns, self.inputs, type(self).__name__)
        held_out = np.zeros(len(target), dtype=bool)
        if self.early_stopping:
            held_out = held_out_rows(codes, self.validation_fraction, rng, type(self).__name__)
        self._set_scales(columns[~held_out], target[~held_out])
        inputs, wanted = self._scaled(columns, target)
        slices = trajectory_slices(codes)
        training = pieces_of([s for s in slices if not held_out[s.start]], self.segment_length)
        validation = pieces_of([s for s in slices if held_out[s.start]], None)
        initial = initial_weights(rng, self.cell, len(self.inputs), int(self.hidden), int(self.layers))
        network = self._network(initial)
        tensors = network.parameters()
        adam = AdamSteps(tensors, float(self.learning_rate))
        best = Best(int(self.patience), float(self.tol))

        def one_epoch(epoch: int) -> float:
            adam.anneal(epoch / int(self.max_iter))
            return self._epoch(network, adam, inputs, wanted, training, rng)

        def validate() -> float:
            rows = np.concatenate([p.rows() for p in validation])
            outputs = self._run(network, inputs, validation)
            return float(np.mean((outputs[rows] - np.asarray(wanted.cpu())[rows]) ** 2))

        # lets a callback score on the rows of the fit without being given the runs
        self._codes_of_fit = codes
        try:
            with fit_progress(self, X=X, y=y, max_epochs=int(self.max_iter)) as progress:
                run_epochs(
                    progress,
                    best,
                    tensors,
                    one_epoch,
                    validate if validation else None,
                    one_step=len(training) <= int(self.batch_size)
                    and max(p.stop - p.start for p in training) <= int(self.window),
                    attributes=lambda weights: {"weights_": weights},
                )
        finally:
            del self._codes_of_fit
        self.weights_ = initial if best.weights is None else best.weights
        self.loss_curve_ = progress.losses
        self.validation_curve_ = best.curve if validation else []
        self.n_iter_ = max(progress.n_epochs, 1)
        self._remember(X, y, groups=groups)
        return self

    def predict(self, X: Any, groups: Any = None) -> np.ndarray:
        """Run the network along each run, from its burn-in to its end."""
        table = self._read_fitted(X, "weights_")
        pieces = pieces_of(trajectory_slices(self._codes(X, table, groups)), None)
        inputs, _ = self._scaled(self._signals(table, self.inputs), None)
        outputs = self._run(self._network(self.weights_), inputs, pieces)
        return outputs * self.target_scale_ + self.target_mean_

    # --- data ---------------------------------------------------------------------------------------------------
    def _check_parameters(self) -> None:
        check_option(self, "cell", CELLS)
        check_counts(self, "hidden", "layers", "window", "batch_size", "max_iter", "patience")
        check_sizes(self, learning_rate=0.0, tol=0.0, burn_in=0.0)
        if self.segment_length is not None and int(self.segment_length) < 1:
            raise ParameterError(
                f"segment_length is {self.segment_length!r}.", "at least one row, or None", "Correct segment_length."
            )

    def _scaled(self, columns: np.ndarray, target: np.ndarray | None) -> tuple[Any, Any]:
        import torch

        inputs = torch.as_tensor((columns - self.input_mean_) / self.input_scale_, device=self.device)
        if target is None:
            return inputs, None
        return inputs, torch.as_tensor((target - self.target_mean_) / self.target_scale_, device=self.device)

    # --- network ------------------------------------------------------------------------------------------------
    def _network(self, weights: Weights) -> Network:
        tensors = to_tensors(weights, self.device)
        return Network(self.cell, len(self.inputs), int(self.hidden), int(self.layers), tensors)

    def _lead_in(self, network: Network, inputs: Any, lead: np.ndarray) -> Any:
        """State that the leading rows bring about; no error is traced back into it."""
        import torch

        if lead.shape[1] == 0:
            return None
        with torch.no_grad():
            return network.run(inputs[torch.as_tensor(lead, device=inputs.device)])[1]

    def _epoch(
        self, network: Network, adam: AdamSteps, inputs: Any, wanted: Any, pieces: list[Piece], rng: np.random.Generator
    ) -> float:
        """One pass over all pieces, a step per window; returns the mean squared error met on the way."""
        import torch

        order = rng.permutation(len(pieces))
        total, count = 0.0, 0
        for start in range(0, len(order), int(self.batch_size)):
            batch = [pieces[k] for k in order[start : start + int(self.batch_size)]]
            lead, table, real = index_table(batch, int(self.burn_in))
            state = self._lead_in(network, inputs, lead)
            for left in range(0, table.shape[1], int(self.window)):
                here = slice(left, left + int(self.window))
                rows = torch.as_tensor(table[:, here], device=inputs.device)
                mask = torch.as_tensor(real[:, here], device=inputs.device)
                outputs, state = network.run(inputs[rows], state)
                error = (((outputs - wanted[rows]) ** 2) * mask).sum()
                n = int(mask.sum())
                adam.step(error / n)
                state = detached(state)
                total, count = total + float(error.detach()), count + n
        return total / count

    def _run(self, network: Network, inputs: Any, pieces: list[Piece]) -> np.ndarray:
        """Outputs at the rows of the pieces, each run from its burn-in to its end, in bounded memory."""
        import torch

        result = np.empty(len(inputs))
        by_length = sorted(pieces, key=lambda p: p.stop - p.start)  # little padding where neighbours are alike
        for start in range(0, len(by_length), 1024):
            batch = by_length[start : start + 1024]
            lead, table, real = index_table(batch, int(self.burn_in))
            state = self._lead_in(network, inputs, lead)
            step = max(1, _STEPS_AT_ONCE // len(batch))
            for left in range(0, table.shape[1], step):
                here = slice(left, left + step)
                with torch.no_grad():
                    outputs, state = network.run(inputs[torch.as_tensor(table[:, here], device=inputs.device)], state)
                result[table[:, here][real[:, here]]] = outputs.cpu().numpy()[real[:, here]]
        return result
