"""What a hybrid model is made of: its parameters, its laws, what a fit leaves."""

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY, field
from typing import Any

import numpy as np

from pamid.constants import ATMOSPHERIC_PRESSURE
from pamid.laws.base import Law
from pamid.signals.state import STATE_SIGNALS
from pamid.volume.base import VolumeModel
from pamid.volume.neural import InputScale

from ._base import SignalEstimator
from ._parameters import parameters


@parameters
class HybridParameters(SignalEstimator):
    """Parameters and fitted state of the hybrid models, as the functions on them read it.

    Parameters
    ----------
    volume_model : {"anchored", "neural"}
        ``"neural"`` is the published network. ``"anchored"`` adds the network to a geometric volume fitted first
        (`pamid.volume.contact.ContactVolume`) and lets it fade outside the data, where the model then extrapolates far
        better.
    hidden_layer_sizes : tuple of int
        Widths of the hidden layers.
    activation : {"softplus", "tanh", "silu"}
        Smooth activation of the hidden layers.
    trainer : {"levenberg_marquardt", "adam"} or Trainer
        ``"adam"`` is Algorithm 1 as printed, with its hyperparameters. A `pamid.training.Trainer` can be given to
        set or search all of its parameters.
    max_iter, batch_size, weight_decay : optional
        Override those of the trainer.
    validation_fraction : float or "auto"
        Share of whole runs held out for early stopping; the model that is best on them is kept, which is what
        keeps a correction from following the errors of estimated rates. Needs ``groups`` or a ``trajectory`` column;
        ``"auto"`` is 0.2 where one of them names five runs or more, and 0 elsewhere and with
        ``trainer="adam"``, which as printed keeps its last epoch.
    effects : sequence of str or Effect, or dict of str to dict, optional
        Named effects of `pamid.effects` that act as well, such as ``["tube", "pressure_hysteresis"]``: sensor lags,
        memory, friction, leaks; a dict gives their start values. Geometry and effects are identified alternately; the
        network learns the remainder, with the states of the effects as inputs. X is then a DataFrame of whole runs in
        order of time, with ``time`` (s) and ``trajectory``; rows that only advance these states get a sample weight of
        0.
    signals : dict, optional
        Column of X, by name or position, for each of the signals ``eps`` (−), ``deps`` (1/s), ``P`` (Pa, absolute)
        and ``dP`` (Pa/s). By default a DataFrame's columns of these names, or an array's four columns in this order.
    dtype : {"float64", "float32"}
        Floating type of the training.
    random_state : int, RandomState or None
        Seed of the initial weights and of the draws of samples.

    Attributes
    ----------
    weights_ : list of ndarray
        Weights and biases of the network in turn.
    anchor_ : ContactVolume or None
        The fitted geometric anchor.
    volume_ : VolumeModel
        The identified volume.
    effects_ : list of Effect
        The identified effects, in physical units.
    """

    rest_length: float = 0.2
    rest_diameter: float = 0.02
    _: KW_ONLY
    volume_model: str = "anchored"
    hidden_layer_sizes: Sequence[int] = (128, 128)
    activation: str = "softplus"
    trainer: Any = "levenberg_marquardt"
    max_iter: int | None = None
    batch_size: int | None = None
    weight_decay: float | None = None
    validation_fraction: float | str = "auto"
    effects: Sequence[Any] | Mapping[str, Mapping[str, float]] | None = None
    dtype: str = "float64"
    device: str = "cpu"
    random_state: Any = None

    atmospheric_pressure: float = field(default=ATMOSPHERIC_PRESSURE, init=False)
    effect_values_: dict[str, dict[str, float]] = field(init=False)
    weights_: list[np.ndarray] = field(init=False)
    input_scale_: InputScale = field(init=False)
    volume_scale_: float = field(init=False)
    anchor_: VolumeModel | None = field(init=False)

    @property
    def reads(self) -> tuple[str, ...]:  # type: ignore[override]
        return (*STATE_SIGNALS, "time") if self.effects else STATE_SIGNALS

    @abstractmethod
    def laws(self) -> tuple[Law, ...]:
        """Return the laws that read the volume, one a column of the target."""
