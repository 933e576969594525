"""Adaptation of a fitted hybrid model to another muscle: what all adapters share."""

import warnings
from dataclasses import KW_ONLY, field
from typing import Any, ClassVar, Self

import numpy as np
import pandas as pd
from sklearn.base import clone
from sklearn.utils import check_random_state
from sklearn.utils.validation import _check_feature_names_in, check_is_fitted

from pamid.errors import DuplicateColumnError, ExcitationWarning, IncompatibleError, ParameterError
from pamid.laws.base import Law
from pamid.signals.state import STATE_SIGNALS, State
from pamid.volume.base import VolumeJet
from pamid.volume.scaled import ScaledVolume

from ._base import fitted_attributes, state_of
from ._blend import FEW_TRAJECTORIES, Blending
from ._hybrid_fit import (
    FitSamples,
    arrays_of,
    check_parameters,
    checked_weight,
    counted_rows,
    early_stopping_rows,
    in_units,
    overridden,
    span_of,
    split_problem,
    spread_of,
    training_problem,
    warn_before,
)
from ._hybrid_use import jet_of
from ._laws import LawModel
from ._parameters import parameters
from ._pihm import HybridModel
from ._progress import fit_progress
from ._source import hybrid_of, tiny_source
from ._trajectories import trajectory_codes
from ._typed import TransformerMixin

VOLUME_COLUMNS = ("V", "V_eps", "V_P")
"""What `transform` appends: volume (m³), ∂V/∂ε (m³) and ∂V/∂P (m³/Pa)."""

DEFAULT_PULL = 1e-4
"""Pull toward the source where nothing determines its strength."""

PUBLISHED_BATCH = 128
"""Batch of Adam in an adaptation, as published."""


@parameters
class AdaptedModel(Blending, TransformerMixin, LawModel):
    """Base of the adapters; a subclass says what is trained.

    Parameters
    ----------
    source : estimator
        The fitted hybrid model of the muscle with plenty of data, best in a `sklearn.frozen.FrozenEstimator`, so that
        clones keep its fit. It stays untouched.
    rest_length, rest_diameter : float, optional
        L₀ and D₀ of the target muscle, m; those of the source by default.
    trainer : {"levenberg_marquardt", "adam"} or Trainer
        ``"adam"`` is the published algorithm with its hyperparameters.
    max_iter, batch_size : int, optional
        Override those of the trainer.
    weight_decay : float or "auto"
        Strength of the pull toward the source, relative to the mean squared residual in units of the variance of the
        target. ``"auto"`` sets it by cross-validation over whole runs, at the cost of one step;
        where it would raise the held-out error, the network stays as it is. For Adam it is the published decay.
    validation_fraction : float or "auto"
        Share of whole runs held out for early stopping.
    blend : {"auto"} or bool
        Whether held-out samples decide, once, the share of a fresh fit of the same samples in the predictions
        (`pamid.adapters.source_process`), so that they are not worse than without a source. ``"auto"`` leaves the
        published algorithm as published.
    warm_start : bool
        Whether another ``fit`` continues the present adaptation.
    signals : dict, optional
        Column of X for each of the signals ``eps`` (−), ``deps`` (1/s), ``P`` (Pa, absolute) and ``dP`` (Pa/s).
    random_state : int, RandomState or None
        Seed of the draws.

    Attributes
    ----------
    model_ : StaticPIHM, ThermodynamicPIHM or JointPIHM
        The model of the target muscle, of the source's class.
    n_parameters_ : int
        Number of adapted parameters.
    weight_decay_ : float
        Strength of the pull; infinite where the network stays as it is.
    blend_ : ndarray, shape (n_targets,)
        Share of the fresh fit in the predictions, 0 where the adapted model stays alone.
    source_kept_ : ndarray, shape (n_targets,)
        Share of the source in the predictions: of the adapted model, and of the source within the fresh fit.
    held_out_errors_ : list of dict
        Root mean square errors on held-out samples, in the target's unit: ``adapted``, ``fresh`` (without the source)
        and ``both`` (a fresh fit that reads the source's prediction).

    See Also
    --------
    QAdapter : Starts at the target's size by a factor on the volume.
    """

    reads: ClassVar[tuple[str, ...]] = STATE_SIGNALS
    method: ClassVar[str]
    """Name of the method on the command line."""
    _fitted = "model_"

    source: Any
    _: KW_ONLY
    rest_length: float | None = None
    rest_diameter: float | None = None
    trainer: Any = "levenberg_marquardt"
    max_iter: int | None = None
    batch_size: int | None = None
    weight_decay: float | str | None = "auto"
    validation_fraction: float | str = 0.0
    blend: bool | str = "auto"
    warm_start: bool = False
    device: str = "cpu"
    random_state: Any = None

    model_: HybridModel = field(init=False)
    psi_: list[np.ndarray] = field(init=False)
    loss_curve_: list[float] = field(init=False)
    validation_curve_: list[float] = field(init=False)

    base: Any = field(default="full", init=False)
    """How the network is adapted: the name of an adapter, or one with its parameters."""

    def _adapter(self) -> Any:
        """Return the adapter of the network's parameters."""
        from pamid.adapters.registry import adapter_named

        return adapter_named(self.base)

    def _place(self, model: HybridModel, rows: FitSamples) -> None:
        """Bring the source's volume to the target's size before anything is trained."""

    # --- fitting ------------------------------------------------------------------------------------------------
    def fit(self, X: Any, y: Any, sample_weight: Any = None, groups: Any = None) -> Self:
        """Adapt the source to measurements of the target muscle.

        Parameters
        ----------
        X : DataFrame or array, shape (n_samples, n_columns)
            Signals of the target muscle.
        y : array, shape (n_samples,), or (n_samples, 2) for a source of force and flow
            What the source predicts, measured on the target: force (N) or mass flow (kg/s).
        groups : array, shape (n_samples,), optional
            Run of each row; a column ``trajectory`` serves as well. With four runs or more the
            strength of the prior is chosen on whole ones.
        """
        source = hybrid_of(self.source, type(self).__name__)
        self._check_law(source, y)
        table, Y = self._read_targets(X, y, reset=True)
        weight, rng = checked_weight(sample_weight, table), check_random_state(self.random_state)
        going_on = bool(self.warm_start) and hasattr(self, "model_")
        model = self._target(self.model_ if going_on else source)
        if Y.shape[1] != len(model.laws()):
            raise IncompatibleError(
                f"y has {Y.shape[1]} column{'s' * (Y.shape[1] > 1)}, the source predicts "
                f"{' and '.join(law.target for law in model.laws())}.",
                "measurements of all that the source predicts",
                "Pass one column for each law (NaN where one was not measured), or adapt a source of one law.",
            )
        state = state_of(model, table)
        check_parameters(model)
        warn_before(model, state, Y)
        _warn_of_one_direction(state, weight)
        rows = FitSamples(table, Y, weight, trajectory_codes(X, groups)).without_repeats()
        model.input_range_ = span_of(np.column_stack(state_of(model, rows.table)))
        model.target_scale_ = np.array([spread_of(y_, rows.weight) for y_ in rows.Y.T])
        in_units(model, self._trainer_as_given())
        if not going_on:
            self._place(model, rows)
        self._train(model, source, rows, rng, (X, y), going_on)
        self.model_ = model
        self._remember(X, y, sample_weight, groups)
        return self

    def _target(self, base: HybridModel) -> HybridModel:
        """Return a model of the target that starts as a copy of another one; its arrays are never written to."""
        model = clone(base)
        fitted = fitted_attributes(base)
        for name in ("feature_names_in_", "n_features_in_", "signal_columns_"):  # of the target's own table
            fitted.pop(name, None)
            if name in vars(self):
                fitted[name] = getattr(self, name)
        for name, value in fitted.items():
            setattr(model, name, value)
        sizes = {"rest_length": self.rest_length, "rest_diameter": self.rest_diameter}
        model.set_params(**{name: size for name, size in sizes.items() if size is not None})
        model.set_params(signals=self.signals, device=self.device, validation_fraction=self.validation_fraction)
        return model

    @staticmethod
    def _rescale(model: HybridModel, factor: float, dead_volume: float = 0.0) -> None:
        """Multiply the volume of a model, whatever it is made of, and add a constant."""
        if factor != 1.0 and model.anchor_ is not None:
            model.anchor_ = ScaledVolume(model.anchor_, factor)
        model.volume_scale_ = model.volume_scale_ * factor
        if dead_volume:
            model.weights_ = [*model.weights_[:-1], model.weights_[-1] + dead_volume / model.volume_scale_]

    def _bound_adapter(self) -> Any:
        """Return the trainer's adapter: the adapter alone, where the factor is part of the volume's scale."""
        return self._adapter()

    def _train(
        self,
        model: HybridModel,
        source: HybridModel,
        rows: FitSamples,
        rng: Any,
        original: tuple[Any, Any],
        going_on: bool,
    ) -> None:
        import torch

        from pamid.adapters.base import Bound, n_parameters
        from pamid.training.trainer import mean_squared_residual

        (table, Y, weight, codes), dtype = rows, getattr(torch, model.dtype)
        self.start_ = source.weights_
        start = [torch.as_tensor(w, dtype=dtype, device=model.device) for w in self.start_]
        bound = Bound(self._bound_adapter(), start)
        generator = np.random.default_rng(rng.randint(2**31))
        psi = origin = bound.adapter.initial(start, generator)
        if going_on and [tuple(p.shape) for p in psi] == [p.shape for p in self.psi_]:
            psi = [torch.as_tensor(p, dtype=dtype, device=model.device) for p in self.psi_]
        self.psi_ = arrays_of(psi)
        problem = training_problem(model, state_of(model, table), Y, weight)
        counted = counted_rows(Y, weight)
        stacked = None if codes is None else np.tile(codes, Y.shape[1])[counted]
        self.weight_decay_ = self._strength(problem, origin, model, bound, stacked, rng) if psi else np.inf
        self._weigh(model, rows, (problem, bound, origin))
        self.n_parameters_ = n_parameters(psi) + int(self._counts_scale)
        self.n_iter_, self.status_, self.validation_curve_ = 1, "converged", []
        if not np.isfinite(self.weight_decay_):
            self.n_parameters_ = int(self._counts_scale)
            self.loss_curve_ = [mean_squared_residual(bound.expand(psi), problem, model.activation)]
            model.weights_ = arrays_of(bound.expand(psi))
            return
        self._warn_of_weak_prior(len(problem))
        trainer = self._trainer(self.weight_decay_)
        split = split_problem(problem, early_stopping_rows(model, codes, len(table), rng, trainer), counted)
        with fit_progress(self, X=original[0], y=original[1], max_epochs=trainer.max_iter) as progress:
            result = trainer.run(
                split[0],
                psi,
                model.activation,
                rng,
                prior=origin,
                validation=split[1],
                adapter=bound,
                callback=lambda loss, p: progress.report(loss, attributes=lambda: self._so_far(model, bound, p)),
            )
        self._keep(model, result, bound, [], result.validation_curve)

    _counts_scale: ClassVar[bool] = False

    def _so_far(self, model: HybridModel, bound: Any, psi: Any) -> dict[str, Any]:
        """Return the state that predict needs of an adaptation under way."""
        now = self._target(model)
        now.weights_ = arrays_of(bound.expand(psi))
        return {"model_": now}

    def _keep(self, model: HybridModel, result: Any, bound: Any, before: list[float], held_out: list[float]) -> None:
        self.psi_ = arrays_of(result.parameters)
        model.weights_ = arrays_of(bound.expand(result.parameters))
        self.loss_curve_ = [*before, *result.loss_curve]
        self.validation_curve_ = held_out
        self.n_iter_ = max(len(self.loss_curve_), 1)
        self._tell_status(result.status)

    def _strength(self, problem: Any, psi: Any, model: HybridModel, bound: Any, codes: Any, rng: Any) -> float:
        """Return the strength of the pull toward the source, or Adam's own decay."""
        from pamid.training.prior import choose_weight_decay

        trainer = self._trainer(0.0)
        if self.weight_decay != "auto":
            decay: Any = self.weight_decay
            return float(self._trainer_as_given().weight_decay if decay is None else decay)
        if not trainer.second_order:
            return float(self._trainer_as_given().weight_decay)
        if codes is None or len(np.unique(codes)) < FEW_TRAJECTORIES:
            return DEFAULT_PULL
        return choose_weight_decay(problem, psi, model.activation, bound, codes, rng)

    def _trainer_as_given(self) -> Any:
        from pamid.training import LevenbergMarquardt, trainer_named

        if isinstance(self.trainer, str) and self.trainer == "levenberg_marquardt":
            return LevenbergMarquardt(max_iter=40, batch_size=1024, tolerance=3e-4, damping=1e-5)
        trainer = clone(trainer_named(self.trainer))
        if self.trainer == "adam":
            trainer.set_params(batch_size=PUBLISHED_BATCH)
        elif isinstance(self.trainer, str):
            trainer.set_params(**trainer.adapting)
        return trainer

    def _trainer(self, weight_decay: float) -> Any:
        trainer = self._trainer_as_given().set_params(weight_decay=weight_decay)
        return overridden(trainer, self, "max_iter", "batch_size")

    def _warn_of_weak_prior(self, n_samples: int) -> None:
        """Warn where more parameters than samples are trained under next to no prior."""
        if self.weight_decay_ < 1e-9 and n_samples < self.n_parameters_ and self._trainer(0.0).max_iter > 1:
            warnings.warn(
                f"{n_samples} samples have to determine {self.n_parameters_} parameters, and weight_decay="
                f"{self.weight_decay_:g} hardly ties them to the source. Expected a stronger prior. Set "
                "weight_decay='auto', or adapt fewer parameters.",
                ExcitationWarning,
                stacklevel=6,
            )

    def _check_law(self, source: HybridModel, y: Any) -> None:
        """Raise if the target's own name says that it is another quantity than the source predicts."""
        name = getattr(y, "name", None)
        targets = [law.target for law in source.laws()]
        if name in ("F", "mdot") and name not in targets:
            raise IncompatibleError(
                f"The target is {name}, and the source predicts {' and '.join(targets)}.",
                "a source and a target of one law",
                f"Pass {targets[0]} of the target muscle, or a source that was fitted on {name}.",
            )
        if self.weight_decay is not None and self.weight_decay != "auto":
            value: Any = self.weight_decay
            if not (isinstance(value, int | float) and np.isfinite(value) and value >= 0):
                raise ParameterError(f"weight_decay={value!r}.", "'auto', or a number from 0 on", "Correct it.")

    # --- using --------------------------------------------------------------------------------------------------
    def laws(self) -> tuple[Law, ...]:
        """Return the laws that the adapted model obeys."""
        return (self.model_ if hasattr(self, "model_") else hybrid_of(self.source, type(self).__name__)).laws()

    def volume(self, X: Any) -> VolumeJet:
        """Return the adapted volume and its derivatives at each sample; warns where they make no physical sense."""
        check_is_fitted(self, "model_")
        return self.model_.volume(X)

    def transform(self, X: Any) -> Any:
        """Append the adapted volume and its derivatives to the signals: V (m³), ∂V/∂ε (m³) and ∂V/∂P (m³/Pa)."""
        table = self._read_fitted(X, "model_")
        columns = np.column_stack(jet_of(self.model_, table))
        asked = getattr(self, "_sklearn_output_config", {}).get("transform")
        if isinstance(X, pd.DataFrame) and asked != "default":
            if doubled := [c for c in VOLUME_COLUMNS if c in X.columns]:
                raise DuplicateColumnError(
                    f"X already has the column {', '.join(doubled)}.", "no column of that name", "Drop or rename it."
                )
            return pd.concat([X, pd.DataFrame(columns, columns=list(VOLUME_COLUMNS), index=X.index)], axis=1)
        return np.concatenate([table, columns], axis=1)

    def fit_transform(self, X: Any, y: Any, sample_weight: Any = None, groups: Any = None) -> Any:
        """Adapt, and append the adapted volume and its derivatives to the signals."""
        return self.fit(X, y, sample_weight, groups).transform(X)

    @classmethod
    def _tiny(cls, **settings: Any) -> Self:
        """Return an adapter of a small source, for the checks that all estimators pass."""
        return cls(tiny_source(), signals=dict.fromkeys(STATE_SIGNALS, 0), **settings)

    @classmethod
    def _checked_instances(cls) -> list[Any]:
        return [cls._tiny(max_iter=5)]

    def get_feature_names_out(self, input_features: Any = None) -> np.ndarray:
        """Name the columns that `transform` returns: those of X, then ``V``, ``V_eps``, ``V_P``."""
        check_is_fitted(self, "model_")
        return np.array([*_check_feature_names_in(self, input_features), *VOLUME_COLUMNS], dtype=object)


ONE_WAY = 0.05
"""Least share of the path in each direction for a signal to count as moving both ways."""


def _warn_of_one_direction(state: State, weight: np.ndarray) -> None:
    """Warn of a log that only fills, only vents, only contracts or only extends."""
    for name, what in (("deps", "contraction"), ("dP", "pressure")):
        rate = getattr(state, name)[weight > 0]
        up, down = np.maximum(rate, 0.0).sum(), np.maximum(-rate, 0.0).sum()
        if len(rate) > 2 and up + down > 0 and min(up, down) < ONE_WAY * (up + down):
            warnings.warn(
                f"The {what} of the target's log goes one way only: {name} is "
                f"{'positive' if up > down else 'negative'} along {max(up, down) / (up + down):.0%} of its path. "
                "Expected both directions. What differs between them, such as friction, stays as in the source; record "
                "a run that returns.",
                ExcitationWarning,
                stacklevel=5,
            )
