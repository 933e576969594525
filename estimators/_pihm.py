"""The hybrid models in common: a volume network, one or two laws that read it, and a trainer."""

from typing import Any, ClassVar, Self

import numpy as np
from sklearn.base import clone
from sklearn.utils import check_random_state
from sklearn.utils.validation import check_is_fitted, column_or_1d

from pamid.effects import Effect
from pamid.errors import IncompatibleError
from pamid.volume.anchored import AnchoredVolume
from pamid.volume.base import VolumeJet, VolumeModel
from pamid.volume.checks import check_volume
from pamid.volume.neural import InputScale

from ._base import state_of
from ._effects import fit_model_effects, fitted_effects, seen_by
from ._hybrid import HybridParameters
from ._hybrid_fit import (
    FitSamples,
    arrays_of,
    check_parameters,
    checked_weight,
    counted_rows,
    early_stopping_rows,
    network_in_units,
    overridden,
    span_of,
    split_problem,
    spread_of,
    training_problem,
    volume_scale,
    warn_before,
)
from ._hybrid_use import jet_of, network_of, predicted
from ._laws import LawModel
from ._progress import fit_progress
from ._trajectories import trajectory_codes


class HybridModel(LawModel, HybridParameters):
    """Base of the hybrid estimators; a subclass names its laws.

    References
    ----------
    G. Wang, R. Chalard, J. Cifuentes, M. Pham, "Fast adaptation of physics-informed hybrid models for pneumatic
    artificial muscles", 2025: Equations 3 (force) and 5 (flow), Algorithm 1, Table 1.
    """

    _settings: ClassVar = {"": {}, "published network": {"volume_model": "neural"}}
    _small: ClassVar[dict[str, Any]] = {"volume_model": "neural", "hidden_layer_sizes": (6,)}
    _checked: ClassVar[tuple[dict[str, Any], ...]] = (
        _small | {"max_iter": 8},
        _small | {"trainer": "adam", "max_iter": 20, "batch_size": 4096},
    )

    # --- fitting ------------------------------------------------------------------------------------------------
    def fit(self, X: Any, y: Any, sample_weight: Any = None, groups: Any = None) -> Self:
        """Train the volume network on what was measured.

        Parameters
        ----------
        y : array, shape (n_samples,), or (n_samples, 2) for force and flow
            Measured force (N), mass flow into the muscle (kg/s), or both; NaN where one of both was not measured.
        groups : array, shape (n_samples,), optional
            Run of each row; needed if `validation_fraction` is not zero and X has no ``trajectory`` column.
        """
        table, target = self._measured(X, y)
        return self._fit(table, target, sample_weight, groups, (X, y))

    def _measured(self, X: Any, y: Any) -> tuple[np.ndarray, np.ndarray]:
        """Validate X and y, the latter as one column for each law."""
        table, target = self._read(X, y, reset=True)
        return table, column_or_1d(target, warn=True)[:, None]

    def _fit(self, X: Any, Y: np.ndarray, sample_weight: Any, groups: Any, original: tuple[Any, Any]) -> Self:
        """Fit on a validated table X and targets Y of shape (n_samples, n_laws)."""
        import torch

        from pamid.training.anchor import fit_anchor
        from pamid.training.network import initial_parameters

        check_parameters(self)
        rng = check_random_state(self.random_state)
        laws = self.laws()
        weight = checked_weight(sample_weight, X)
        warn_before(self, state_of(self, X), Y)
        codes = trajectory_codes(original[0], groups)
        if not self.effects:  # which remember every row
            X, Y, weight, codes = FitSamples(X, Y, weight, codes).without_repeats()
        fit_model_effects(self, X, Y, weight, rng)
        state, inputs, added = seen_by(self, X)
        Y = Y if added is None else Y - added
        held_out = early_stopping_rows(self, codes, len(X), rng, self._trainer())
        train = weight * ~held_out
        anchored = self.volume_model == "anchored"
        self.input_scale_ = InputScale.of(inputs, train, correction=anchored)
        self.input_range_ = span_of(np.column_stack(state_of(self, X))[train > 0])
        self.target_scale_ = np.array([spread_of(Y[:, k], train) for k in range(len(laws))])
        self.anchor_: VolumeModel | None = None
        if anchored:
            # A handful of parameters needs every run; held-out runs judge only the correction.
            self.anchor_ = fit_anchor(
                [(law, state, Y[:, k], weight) for k, law in enumerate(laws)],
                rest_length=self.rest_length,
                rest_diameter=self.rest_diameter,
                atmospheric_pressure=self.atmospheric_pressure,
                random_state=rng,
            )
        self.volume_scale_ = volume_scale(self, state, inputs, train)
        network_in_units(self, self._trainer())
        problem = training_problem(self, state, Y, weight, inputs)
        widths = (inputs.shape[1], *self.hidden_layer_sizes, 1)
        start = initial_parameters(widths, rng, getattr(torch, self.dtype), self.device)
        if anchored:
            # The correction starts from nothing, so that a fit is never worse than its anchor.
            start[-2].zero_()
            start[-1].zero_()
        self._train(split_problem(problem, held_out, counted_rows(Y, weight)), start, rng, original)
        if not self.effects:  # which a stream of single rows does not determine
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
                callback=lambda loss, p: progress.report(loss, attributes=lambda: {"weights_": arrays_of(p)}),
            )
        self._keep(result)

    def _keep(self, result: Any) -> None:
        self.weights_ = arrays_of(result.parameters)
        self.n_iter_ = max(result.n_iter, 1)
        self.loss_curve_ = result.loss_curve
        self.validation_curve_ = result.validation_curve
        self._tell_status(result.status)

    def _partial_fit_rows(self, X: Any, y: Any, sample_weight: Any, groups: Any) -> Self:
        if self.effects:
            raise IncompatibleError(
                "The model has effects with memory, but partial_fit remembers single rows.",
                "whole runs, in one fit",
                "Fit again on all runs.",
            )
        return super()._partial_fit_rows(X, y, sample_weight, groups)

    def _trainer(self) -> Any:
        from pamid.training import trainer_named

        return overridden(clone(trainer_named(self.trainer)), self, "max_iter", "batch_size", "weight_decay")

    # --- using --------------------------------------------------------------------------------------------------
    def _outputs(self, table: np.ndarray) -> np.ndarray:
        return predicted(self, table)

    @property
    def volume_(self) -> VolumeModel:
        """The identified volume: anything with ``jet(state)``."""
        self._check_fitted("weights_")
        network = network_of(self)
        return network if self.anchor_ is None else AnchoredVolume(self.anchor_, network)

    @property
    def effects_(self) -> list[Effect]:
        """The identified effects, in physical units."""
        return fitted_effects(self)

    def volume(self, X: Any) -> VolumeJet:
        """Return the identified volume and its derivatives at each sample.

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
        jet = jet_of(self, X)
        known = self.anchor_ is not None or any(law.equation == "flow" for law in self.laws())
        check_volume(
            jet,
            state_of(self, X),
            rest_volume=np.pi * self.rest_diameter**2 / 4.0 * self.rest_length,
            level_known=known,
        )
        return jet

    @property
    def n_parameters_(self) -> int:
        """Number of trained parameters of the network."""
        check_is_fitted(self, "weights_")
        return int(sum(w.size for w in self.weights_))
