"""The hybrid models in common: a volume network, one or two laws that read it, and a trainer."""

from __future__ import annotations

import warnings
from abc import abstractmethod
from collections.abc import Sequence
from typing import Any, ClassVar, Self

import numpy as np
from sklearn.base import RegressorMixin
from sklearn.utils import check_random_state
from sklearn.utils.validation import check_is_fitted

from pamid.constants import ATMOSPHERIC_PRESSURE
from pamid.errors import (
    ExcitationWarning,
    ExtrapolationWarning,
    FitError,
    InterruptedFitWarning,
    MissingTrajectoryError,
    ParameterError,
    ShapeError,
    TooFewTrajectoriesError,
    UnknownOptionError,
)
from pamid.fitting.stream_memory import Rows
from pamid.laws.base import Law
from pamid.signals.plausibility import check_units
from pamid.signals.state import STATE_SIGNALS, State
from pamid.volume.anchored import AnchoredVolume
from pamid.volume.base import VolumeJet, VolumeModel, slope_of
from pamid.volume.checks import check_volume
from pamid.volume.neural import InputScale, NeuralVolume

from ._base import SignalEstimator
from ._progress import ProgressMixin, fit_progress
from ._streaming import Streaming
from ._trajectories import trajectory_codes

CHUNK = 2048
"""Rows evaluated at a time: what a layer leaves stays in the cache, and memory stays flat however long the log."""

VOLUMES = ("anchored", "neural")

AUTO_FRACTION = 0.2
"""Share of the trajectories that ``validation_fraction="auto"`` holds out."""

AUTO_TRAJECTORIES = 5
"""Trajectories below which ``validation_fraction="auto"`` holds none out."""


class HybridModel(Streaming, ProgressMixin, RegressorMixin, SignalEstimator):
    """Base of the hybrid estimators; a subclass names its laws and its targets."""

    reads: ClassVar[tuple[str, ...]] = STATE_SIGNALS
    __metadata_request__fit: ClassVar[dict[str, bool]] = {"groups": True}
    __metadata_request__partial_fit: ClassVar[dict[str, bool]] = {"groups": True}

    rest_length: float
    rest_diameter: float
    volume_model: str
    hidden_layer_sizes: Sequence[int]
    activation: str
    trainer: Any
    max_iter: int | None
    batch_size: int | None
    weight_decay: float | None
    validation_fraction: float | str
    dtype: str
    device: str
    random_state: Any

    @abstractmethod
    def _laws(self) -> tuple[Law, ...]:
        """Return the laws that read the volume, one a column of the target."""

    @property
    def _atmosphere(self) -> float:
        return getattr(self, "atmospheric_pressure", ATMOSPHERIC_PRESSURE)

    def __sklearn_tags__(self) -> Any:
        tags = super().__sklearn_tags__()
        # A law of physics cannot follow targets that no muscle could give.
        tags.regressor_tags.poor_score = True
        return tags

    # --- fitting ------------------------------------------------------------------------------------------------

    def _fit(self, X: Any, Y: np.ndarray, sample_weight: Any, groups: Any, original: tuple[Any, Any]) -> Self:
        """Fit on a validated table X and targets Y of shape (n_samples, n_laws)."""
        import torch

        from pamid.training.anchor import fit_anchor
        from pamid.training.network import initial_parameters

        self._check_parameters()
        rng = check_random_state(self.random_state)
        state, laws = self._state(X), self._laws()
        weight = _checked_weight(sample_weight, X)
        self._warn_before(state, Y)
        held_out = self._hold_out(original[0], groups, len(X), rng, self._trainer())
        train = weight * ~held_out
        inputs = np.column_stack(state)
        anchored = self.volume_model == "anchored"
        self.input_scale_ = InputScale.of(inputs, train, correction=anchored)
        self.input_range_ = _range(inputs[train > 0])
        self.target_scale_ = np.array([_spread(Y[:, k], train) for k in range(len(laws))])
        self.anchor_: VolumeModel | None = None
        if anchored:
            # A handful of parameters needs every run; what is held out judges the correction alone.
            self.anchor_ = fit_anchor(
                [(law, state, Y[:, k], weight) for k, law in enumerate(laws)],
                rest_length=self.rest_length,
                rest_diameter=self.rest_diameter,
                atmospheric_pressure=self._atmosphere,
                random_state=rng,
            )
        self.volume_scale_ = self._volume_scale(state, train)
        problem = self._problem(state, Y, weight)
        widths = (inputs.shape[1], *self.hidden_layer_sizes, 1)
        start = initial_parameters(widths, rng, getattr(torch, self.dtype), self.device)
        if anchored:
            # The correction starts from nothing, so that a fit is never worse than its anchor.
            start[-2].zero_()
            start[-1].zero_()
        counted = (np.isfinite(Y) & (weight > 0)[:, None]).T.ravel()
        rows = torch.as_tensor(np.tile(held_out, len(laws))[counted], device=self.device)
        split = problem.split(rows) if held_out.any() else (problem, None)
        self._train(split, start, rng, original)
        self._remember(*original, sample_weight, groups)
        return self

    def _train(self, split: tuple[Any, Any], start: list[Any], rng: Any, original: tuple[Any, Any]) -> None:
        trainer = self._trainer()
        with fit_progress(self, X=original[0], y=original[1], max_epochs=trainer.max_iter) as progress:
            result = trainer.run(
                split[0],
                start,
                self.activation,
                rng,
                validation=split[1],
                callback=lambda loss, p: progress.report(loss, attributes=lambda: {"weights_": _numpy(p)}),
            )
        self._keep(result)

    def _keep(self, result: Any) -> None:
        from pamid.training import Status

        self.weights_ = _numpy(result.parameters)
        self.n_iter_ = max(result.n_iter, 1)
        self.loss_curve_ = result.loss_curve
        self.validation_curve_ = result.validation_curve
        self.status_ = result.status.name.lower()
        if result.status is Status.INTERRUPTED:
            warnings.warn(Status.INTERRUPTED.value, InterruptedFitWarning, stacklevel=4)
        if result.status is Status.DIVERGED:
            raise FitError(Status.DIVERGED.value, "a finite loss", "Check units and outliers; lower the learning rate.")

    def partial_fit(self, X: Any, y: Any, sample_weight: Any = None, groups: Any = None) -> Self:
        """Take in a batch of a stream, and train on with all rows so far.

        Up to 5,000 different rows are remembered; beyond, a fair sample that stands for the whole stream. Each time
        that the memory has doubled the model is fitted to it anew, scaling and anchor included; in between the network
        takes as many further iterations as the batch has a share in the stream, and the training error on the memory
        never rises. So passes approach one `fit` on all rows. Where two batches in a row say that the muscle is another
        one, rows from before count less, by as much as they are off. Memory does not grow.

        Parameters
        ----------
        X : DataFrame or array, shape (n_samples, n_columns)
            Signals of the muscle.
        y : array, shape (n_samples,) or (n_samples, 2)
            What was measured, as in `fit`.
        sample_weight : array, shape (n_samples,), optional
            Weights of the samples.
        groups : array, shape (n_samples,), optional
            Trajectory of each row.

        Returns
        -------
        self
            The fitted model.

        Warns
        -----
        StreamChangeWarning
            If the stream has changed.
        """
        return self._partial_fit_rows(X, y, sample_weight, groups)

    def _continue(self, rows: Rows, share: float) -> None:
        """Train on from where the network stands."""
        import torch

        state, rng = self._state(rows.X), check_random_state(self.random_state)
        inputs = np.column_stack(state)
        self.input_range_ = _range(np.vstack([self.input_range_, inputs]) if hasattr(self, "input_range_") else inputs)
        problem = self._problem(state, rows.y, rows.weight)
        here = [torch.as_tensor(w, dtype=getattr(torch, self.dtype), device=self.device) for w in self.weights_]
        trainer = self._trainer()
        trainer.set_params(max_iter=max(1, int(np.ceil(share * trainer.max_iter))), checkpoint=None)
        if trainer.keeps_last:
            trainer.set_params(keep="best")  # the error on the memory must not rise
        result = trainer.run(problem, here, self.activation, rng)
        result.loss_curve = [*self.loss_curve_, *result.loss_curve]
        result.validation_curve = self.validation_curve_
        result.n_iter += self.n_iter_
        self._keep(result)

    def _stream_table(self, X: Any, y: Any) -> tuple[np.ndarray, np.ndarray]:
        table, target = self._read_targets(X, y, reset=False)
        if target.shape[1] != len(self._laws()):
            raise ShapeError(
                f"y has {target.shape[1]} columns.", f"{len(self._laws())}, as in the first fit", "Correct y."
            )
        return table, target

    def _problem(self, state: State, Y: np.ndarray, weight: np.ndarray) -> Any:
        """Put the laws into the network's coordinates, one block of rows a law."""
        import torch

        from pamid.training.problem import TrainingProblem

        xi, slope = self.input_scale_.apply(np.column_stack(state))
        blocks = []
        for k, law in enumerate(self._laws()):
            c = law.coefficients(state)
            factor = self.volume_scale_ / self.target_scale_[k]
            direction = np.zeros_like(xi)
            direction[:, 0] = factor * c.V_eps * slope[:, 0]
            direction[:, 2] = factor * c.V_P * slope[:, 2]
            y = Y[:, k]
            if self.anchor_ is not None:
                y = y - law.predict(*self.anchor_.jet(state), state)
            counted = np.where(np.isfinite(y), weight, 0.0)
            y = np.where(np.isfinite(y), y, 0.0)
            blocks.append((xi, direction, factor * np.asarray(c.V), y / self.target_scale_[k], counted))
        stacked = [np.concatenate(part) for part in zip(*blocks, strict=True)]
        return TrainingProblem.from_arrays(*stacked, dtype=getattr(torch, self.dtype), device=self.device)

    def _volume_scale(self, state: State, weight: np.ndarray) -> float:
        """Choose the volume of one unit of output, so that the laws' targets are of the order of one."""
        _, slope = self.input_scale_.apply(np.column_stack(state))
        logs = []
        for k, law in enumerate(self._laws()):
            c = law.coefficients(state)
            size = np.asarray(c.V) ** 2 + (c.V_eps * slope[:, 0]) ** 2 + (c.V_P * slope[:, 2]) ** 2
            rms = np.sqrt(np.average(size, weights=weight))
            logs.append(np.log(self.target_scale_[k] / rms) if rms > 0 else 0.0)
        return float(np.exp(np.mean(logs)))

    def _hold_out(self, X: Any, groups: Any, n: int, rng: Any, trainer: Any) -> np.ndarray:
        """Draw the whole trajectories that early stopping watches."""
        fraction = AUTO_FRACTION if self.validation_fraction == "auto" else float(self.validation_fraction)
        if self.validation_fraction == "auto" and trainer.keeps_last:
            fraction = 0.0  # rows that nothing is decided by are better learnt from
        codes = trajectory_codes(X, groups) if fraction else None
        if codes is None:
            if fraction and self.validation_fraction != "auto":
                raise MissingTrajectoryError(
                    f"validation_fraction={fraction:g}, and neither groups nor a column 'trajectory'.",
                    "one of the two, to hold whole trajectories out",
                    "Pass groups=, keep a 'trajectory' column in a DataFrame, or set validation_fraction=0.",
                )
            return np.zeros(n, dtype=bool)
        names = np.unique(codes)
        if self.validation_fraction == "auto" and len(names) < AUTO_TRAJECTORIES:
            return np.zeros(n, dtype=bool)
        if len(names) < 3:
            raise TooFewTrajectoriesError(
                f"validation_fraction={fraction:g} with {len(names)} trajectories.",
                "at least three trajectories to hold one out",
                "Give more trajectories, or set validation_fraction=0.",
            )
        count = min(max(1, round(fraction * len(names))), len(names) - 2)
        return np.isin(codes, rng.choice(names, count, replace=False))

    def _trainer(self) -> Any:
        from sklearn.base import clone

        from pamid.training import trainer_named

        trainer = clone(trainer_named(self.trainer))
        wanted = {"max_iter": self.max_iter, "batch_size": self.batch_size, "weight_decay": self.weight_decay}
        return trainer.set_params(**{name: value for name, value in wanted.items() if value is not None})

    def _check_parameters(self) -> None:
        if self.volume_model not in VOLUMES:
            raise UnknownOptionError(
                f"volume_model={self.volume_model!r} is not known.",
                f"one of {', '.join(VOLUMES)}",
                "Choose one of them.",
            )
        for name in ("rest_length", "rest_diameter"):
            value: Any = getattr(self, name)
            if not (isinstance(value, int | float) and np.isfinite(value) and value > 0):
                raise ParameterError(f"{name}={value!r}.", "a positive length in m", "Correct it.")
            if value > 10:
                raise ParameterError(
                    f"{name}={value:g} looks like mm.", "a length in m", f"Divide by 1000: {name}={value / 1000:g}."
                )
        share: Any = self.validation_fraction
        if share != "auto" and not (isinstance(share, int | float) and 0 <= share < 1):
            raise ParameterError(
                f"validation_fraction={share!r}.", "'auto', or a share from 0 to below 1", "Correct it."
            )
        if self.dtype not in ("float32", "float64"):
            raise UnknownOptionError(f"dtype={self.dtype!r} is not known.", "'float32' or 'float64'", "Choose one.")

    def _warn_before(self, state: State, Y: np.ndarray) -> None:
        """Warn about units and about data that hardly tell what is to be identified, before a fit spends its time."""
        targets = {law.target: Y[:, k] for k, law in enumerate(self._laws())}
        check_units(state._asdict() | targets, ambient_pressure=self._atmosphere)
        for k, law in enumerate(self._laws()):
            if len(Y) > 1 and np.nanmax(Y[:, k]) == np.nanmin(Y[:, k]):
                warnings.warn(
                    f"The target of the {law.equation} equation is constant ({Y[0, k]:g} {law.unit}). Expected one "
                    "that varies. Check the channel, or record a run that moves the muscle.",
                    ExcitationWarning,
                    stacklevel=4,
                )

    # --- using --------------------------------------------------------------------------------------------------

    def _state(self, X: np.ndarray) -> State:
        return State(*(self._signal(X, name) for name in STATE_SIGNALS))

    @property
    def volume_(self) -> VolumeModel:
        """The identified volume: anything with ``jet(state)``."""
        self._check_fitted("weights_")
        network = NeuralVolume(self.weights_, self.input_scale_, self.volume_scale_, self.activation)
        return network if self.anchor_ is None else AnchoredVolume(self.anchor_, network)

    def volume(self, X: Any) -> VolumeJet:
        """Return the identified volume and its derivatives at each sample.

        Parameters
        ----------
        X : DataFrame or array, shape (n_samples, n_columns)
            Signals of the muscle.

        Returns
        -------
        VolumeJet
            V (m³), ∂V/∂ε (m³) and ∂V/∂P (m³/Pa), each of shape (n_samples,).

        Warns
        -----
        VolumeWarning
            If the volume makes no physical sense there: not positive, shrinking as the muscle contracts, or far from
            the size of the muscle.

        Notes
        -----
        Force alone tells the slope of the volume, not its level; the level is then that of the anchor, or, for the
        published network, means nothing and is not checked.
        """
        check_is_fitted(self, "weights_")
        X, _ = self._read(X, reset=False)
        jet = self._jet(X)
        known = self.anchor_ is not None or any(law.equation == "flow" for law in self._laws())
        check_volume(
            jet,
            self._state(X),
            rest_volume=np.pi * self.rest_diameter**2 / 4.0 * self.rest_length,
            level_known=known,
        )
        return jet

    def _jet(self, X: np.ndarray) -> VolumeJet:
        volume = self.volume_
        parts = [volume.jet(self._state(X[i : i + CHUNK])) for i in range(0, len(X), CHUNK)]
        return VolumeJet(*(np.concatenate(column) for column in zip(*parts, strict=True)))

    def _warn_of_extrapolation(self, X: np.ndarray) -> None:
        """Warn where a prediction is asked outside the range of the fit; a narrow margin around it is not counted."""
        seen = getattr(self, "input_range_", None)
        if seen is None:  # a model file of an earlier version
            return
        x = X[:, [self.signal_columns_[name] for name in STATE_SIGNALS]]
        margin = MARGIN * (seen[1] - seen[0])
        outside = np.abs(x - 0.5 * (seen[0] + seen[1])) > 0.5 * (seen[1] - seen[0]) + margin
        if outside.any() and np.mean(outside.any(axis=1)) > OUTSIDE:
            worst = int(np.argmax(outside.sum(axis=0)))
            warnings.warn(
                f"{outside.any(axis=1).mean():.0%} of {len(x)} samples lie outside the range of the data of the fit, "
                f"most in {STATE_SIGNALS[worst]}: {x[:, worst].min():.4g} to {x[:, worst].max():.4g}, where the fit "
                f"saw {seen[0, worst]:.4g} to {seen[1, worst]:.4g}. Expected samples like those of the fit. Fit on "
                "data that reach as far, or do not rely on these predictions.",
                ExtrapolationWarning,
                stacklevel=4,
            )

    def _predict(self, X: np.ndarray) -> np.ndarray:
        """Apply every law to the identified volume; shape (n_samples, n_laws)."""
        self._warn_of_extrapolation(X)
        volume, laws = self.volume_, self._laws()
        out = np.empty((len(X), len(laws)))
        alone = all(law.slope_alone for law in laws)
        for i in range(0, len(X), CHUNK):
            state = self._state(X[i : i + CHUNK])
            jet = VolumeJet(0.0, slope_of(volume, state), 0.0) if alone else volume.jet(state)
            for k, law in enumerate(laws):
                out[i : i + CHUNK, k] = law.predict(*jet, state)
        return out

    @property
    def n_parameters_(self) -> int:
        """Number of trained parameters of the network."""
        check_is_fitted(self, "weights_")
        return int(sum(w.size for w in self.weights_))


def _numpy(parameters: Sequence[Any]) -> list[np.ndarray]:
    return [p.detach().cpu().numpy().astype(float) for p in parameters]


MARGIN = 0.1
"""Share of a signal's range by which a sample may lie outside it before it counts as outside."""

OUTSIDE = 0.01
"""Share of samples outside the range that is worth a warning."""


def _range(x: np.ndarray) -> np.ndarray:
    """Return the least and greatest value of each column, shape (2, n_columns)."""
    return np.stack([x.min(axis=0), x.max(axis=0)])


def _spread(y: np.ndarray, weight: np.ndarray) -> float:
    keep = np.isfinite(y) & (weight > 0)
    if not keep.any():
        return 1.0
    mean = np.average(y[keep], weights=weight[keep])
    spread = float(np.sqrt(np.average((y[keep] - mean) ** 2, weights=weight[keep])))
    return spread if spread > 1e-12 * abs(mean) and spread > 0 else max(abs(float(mean)), 1.0)


def _checked_weight(sample_weight: Any, X: np.ndarray) -> np.ndarray:
    from sklearn.utils.validation import _check_sample_weight

    weight = _check_sample_weight(sample_weight, X, dtype=np.float64, ensure_non_negative=True)
    if not np.any(weight > 0):
        raise ValueError("sample_weight is zero for every sample. Expected at least one positive weight.")
    return weight


__all__ = ["HybridModel"]
