"""What a hybrid model is made of: its parameters, its laws, what a fit leaves."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from pamid.constants import ATMOSPHERIC_PRESSURE
from pamid.laws.base import Law
from pamid.signals.state import STATE_SIGNALS
from pamid.volume.base import VolumeModel
from pamid.volume.neural import InputScale

from ._base import SignalEstimator


class HybridParameters(SignalEstimator):
    """Parameters and fitted state of the hybrid models, as the functions on them read it."""

    rest_length: float
    rest_diameter: float
    atmospheric_pressure: float = ATMOSPHERIC_PRESSURE
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
    effects: Sequence[Any] | Mapping[str, Mapping[str, float]] | None = None
    effect_values_: dict[str, dict[str, float]]
    weights_: list[np.ndarray]
    input_scale_: InputScale
    volume_scale_: float
    anchor_: VolumeModel | None
    signal_columns_: dict[str, int]

    @property
    def reads(self) -> tuple[str, ...]:  # type: ignore[override]
        return (*STATE_SIGNALS, "time") if self.effects else STATE_SIGNALS

    @abstractmethod
    def laws(self) -> tuple[Law, ...]:
        """Return the laws that read the volume, one a column of the target.

        Returns
        -------
        tuple of Law
            A law of force (N), of flow (kg/s), or both.
        """
