"""Hybrid model of a muscle's force."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from sklearn.utils.validation import column_or_1d

from pamid.constants import ATMOSPHERIC_PRESSURE
from pamid.laws.quasi_static import QuasiStaticForce

from ._base import Signals
from ._hybrid_use import predicted
from ._pihm import HybridModel


class StaticPIHM(HybridModel):
    r"""Physics-informed hybrid model of the force of a muscle.

    A network learns the gas volume V(ε, ε̇, P, Ṗ); virtual work turns its slope into force,

    .. math:: F = \frac{P - P_\mathrm{atm}}{L_0}\,\frac{\partial V}{\partial\varepsilon},

    and the network is trained from this law alone: the volume itself is never measured.

    Parameters
    ----------
    rest_length : float, default=0.2
        Rest length L₀ of the muscle, m.
    rest_diameter : float, default=0.02
        Rest diameter D₀, m. Force does not determine the volume at rest; this does.
    atmospheric_pressure : float, default=101325
        Ambient pressure, Pa, absolute.
    volume_model : {"anchored", "neural"}, default="anchored"
        ``"neural"`` is the published network. ``"anchored"`` adds the network to a geometric volume fitted first
        (`pamid.volume.ContactVolume`) and lets it fade outside the data, where the model then extrapolates far better.
    hidden_layer_sizes : tuple of int, default=(128, 128)
        Widths of the hidden layers.
    activation : {"softplus", "tanh", "silu"}, default="softplus"
        Smooth activation of the hidden layers.
    trainer : {"levenberg_marquardt", "adam"} or Trainer, default="levenberg_marquardt"
        ``"adam"`` is Algorithm 1 as printed, with its hyperparameters. A `pamid.training.Trainer` can be given to
        set or search all of its parameters.
    max_iter, batch_size, weight_decay : optional
        Override those of the trainer.
    validation_fraction : float or "auto", default=0
        Share of whole runs held out for early stopping; the model that is best on them is kept. Needs
        ``groups`` or a ``trajectory`` column; ``"auto"`` is 0.2 where one of them names five runs or more,
        but 0 with ``trainer="adam"``, which as printed keeps its last epoch.
    effects : sequence of str or Effect, or dict of str to dict, optional
        Named effects of `pamid.effects` that act as well, such as ``["tube", "pressure_hysteresis"]``: sensor lags,
        memory, friction, leaks; a dict gives their start values. Geometry and effects are identified alternately; the
        network learns the remainder, with the states of the effects as inputs. X is then a DataFrame of whole runs in
        order of time, with ``time`` (s) and ``trajectory``; rows that only advance these states get a sample weight of
        0.
    signals : dict, optional
        Column of X, by name or position, for each of the signals ``eps`` (−), ``deps`` (1/s), ``P`` (Pa, absolute)
        and ``dP`` (Pa/s). By default a DataFrame's columns of these names, or an array's four columns in this order.
    dtype : {"float64", "float32"}, default="float64"
        Floating type of the training.
    device : str, default="cpu"
        Where to train, for instance ``"cuda"``.
    random_state : int, RandomState or None, default=None
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
    n_iter_ : int
        Iterations of the trainer.
    loss_curve_, validation_curve_ : list of float
        Mean squared residual after each iteration, in units of the target's variance.
    status_ : str
        Why the training ended.

    See Also
    --------
    ThermodynamicPIHM : The same for mass flow.
    JointPIHM : One volume for both.

    References
    ----------
    G. Wang, R. Chalard, J. Cifuentes, M. Pham, "Fast adaptation of physics-informed hybrid models for pneumatic
    artificial muscles", 2025: Equation 3, Algorithm 1, Table 1.

    Examples
    --------
    >>> import numpy as np, pandas as pd
    >>> from pamid.estimators import StaticPIHM
    >>> t = np.linspace(0, 6, 200)
    >>> X = pd.DataFrame({"eps": 0.1 + 0.05 * np.sin(t), "deps": 0.05 * np.cos(t),
    ...                   "P": 3e5 + 1e5 * np.cos(3 * t), "dP": -3e5 * np.sin(3 * t)})
    >>> F = (X["P"] - 101325) * 5e-4 * (1 - 3 * X["eps"])  # N
    >>> model = StaticPIHM(hidden_layer_sizes=(8,), max_iter=20, random_state=0).fit(X, F)
    >>> bool(model.score(X, F) > 0.99)
    True
    """

    equations = ("force",)

    @classmethod
    def settings(cls, equation: str) -> dict[str, dict[str, Any]]:  # noqa: D102
        return {"": {}, "published network": {"volume_model": "neural"}}

    def __init__(
        self,
        rest_length: float = 0.2,
        rest_diameter: float = 0.02,
        *,
        atmospheric_pressure: float = ATMOSPHERIC_PRESSURE,
        volume_model: str = "anchored",
        hidden_layer_sizes: Sequence[int] = (128, 128),
        activation: str = "softplus",
        trainer: Any = "levenberg_marquardt",
        max_iter: int | None = None,
        batch_size: int | None = None,
        weight_decay: float | None = None,
        validation_fraction: float | str = 0.0,
        effects: Sequence[Any] | Mapping[str, Mapping[str, float]] | None = None,
        signals: Signals | None = None,
        dtype: str = "float64",
        device: str = "cpu",
        random_state: Any = None,
    ) -> None:
        self.rest_length = rest_length
        self.rest_diameter = rest_diameter
        self.atmospheric_pressure = atmospheric_pressure
        self.volume_model = volume_model
        self.hidden_layer_sizes = hidden_layer_sizes
        self.activation = activation
        self.trainer = trainer
        self.max_iter = max_iter
        self.batch_size = batch_size
        self.weight_decay = weight_decay
        self.validation_fraction = validation_fraction
        self.effects = effects
        self.signals = signals
        self.dtype = dtype
        self.device = device
        self.random_state = random_state

    def laws(self) -> tuple[QuasiStaticForce]:
        """Return the quasi-static law of the force.

        Returns
        -------
        tuple of Law
            One law, of force (N).
        """
        return (QuasiStaticForce(self.rest_length, self.atmospheric_pressure),)

    def fit(self, X: Any, y: Any, sample_weight: Any = None, groups: Any = None) -> StaticPIHM:
        """Train the volume network on measured force.

        Parameters
        ----------
        X : DataFrame or array, shape (n_samples, n_columns)
            Signals of the muscle.
        y : array, shape (n_samples,)
            Measured force, N.
        sample_weight : array, shape (n_samples,), optional
            Weights of the samples.
        groups : array, shape (n_samples,), optional
            Run of each row; needed if `validation_fraction` is not zero and X has no ``trajectory`` column.

        Returns
        -------
        StaticPIHM
            The fitted model itself.
        """
        table, target = self._read(X, y, reset=True)
        target = column_or_1d(target, warn=True)
        return self._fit(table, target[:, None], sample_weight, groups, (X, y))

    def predict(self, X: Any) -> np.ndarray:
        """Predict the force.

        Parameters
        ----------
        X : DataFrame or array, shape (n_samples, n_columns)
            Signals of the muscle.

        Returns
        -------
        ndarray, shape (n_samples,)
            Force, N.
        """
        self._check_fitted("weights_")
        table, _ = self._read(X, reset=False)
        return predicted(self, table)[:, 0]

    @classmethod
    def _checked_instances(cls) -> list[StaticPIHM]:
        one = dict.fromkeys(("eps", "deps", "P", "dP"), 0)
        common: dict[str, Any] = {"hidden_layer_sizes": (6,), "signals": one}
        return [
            cls(volume_model="neural", max_iter=8, **common),
            cls(volume_model="neural", trainer="adam", max_iter=20, batch_size=4096, **common),
        ]
