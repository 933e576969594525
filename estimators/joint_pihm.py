"""One volume for force and flow together."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from pamid.constants import ATMOSPHERIC_PRESSURE, GAS_CONSTANT, HEAT_CAPACITY_RATIO, TEMPERATURE
from pamid.laws.base import Law
from pamid.laws.quasi_static import QuasiStaticForce
from pamid.laws.thermodynamic import ThermodynamicFlow

from ._base import Signals
from ._hybrid_use import mean_r2, predicted
from ._pihm import HybridModel


class JointPIHM(HybridModel):
    r"""Hybrid model of force and mass flow that share one gas volume.

    Both laws read the same network V(ε, ε̇, P, Ṗ),

    .. math:: F = \frac{P - P_\mathrm{atm}}{L_0}\,\frac{\partial V}{\partial\varepsilon}, \qquad
        \dot m = \frac{\dot P V}{\gamma R T} + \frac{P \dot V}{R T},

    each in units of its own standard deviation. Where no volume satisfies both, one of the laws lacks something:
    compare `StaticPIHM` and `ThermodynamicPIHM` with this model to see by how much.

    Parameters
    ----------
    rest_length : float, default=0.2
        Rest length L₀ of the muscle, m.
    rest_diameter : float, default=0.02
        Rest diameter D₀, m.
    atmospheric_pressure : float, default=101325
        Ambient pressure, Pa, absolute.
    heat_capacity_ratio : float, default=1.4
        γ, dimensionless.
    gas_constant : float, default=287
        R, J/(kg K).
    temperature : float, default=293
        T, K.
    volume_model : {"anchored", "neural"}, default="anchored"
        As in `StaticPIHM`.
    hidden_layer_sizes : tuple of int, default=(128, 128)
        Widths of the hidden layers.
    activation : {"softplus", "tanh", "silu"}, default="softplus"
        Smooth activation of the hidden layers.
    trainer : {"levenberg_marquardt", "adam"} or Trainer, default="levenberg_marquardt"
        How to train.
    max_iter, batch_size, weight_decay : optional
        Override those of the trainer.
    validation_fraction : float or "auto", default="auto"
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
        Column of X for each of the signals ``eps`` (−), ``deps`` (1/s), ``P`` (Pa, absolute) and ``dP`` (Pa/s).
    dtype : {"float64", "float32"}, default="float64"
        Floating type of the training.
    device : str, default="cpu"
        Where to train.
    random_state : int, RandomState or None, default=None
        Seed.

    Attributes
    ----------
    weights_ : list of ndarray
        Weights and biases of the network in turn.
    volume_ : VolumeModel
        The identified volume.
    n_targets_ : int
        2 after a fit on force and flow, 1 after a fit on force alone.
    effects_ : list of Effect
        The identified effects, in physical units.
    n_iter_, loss_curve_, validation_curve_, status_
        As in `StaticPIHM`.

    Notes
    -----
    The target has two columns, force (N) and flow (kg/s); NaN marks what was not measured in a row. A target of one
    column is force alone.

    Examples
    --------
    >>> import numpy as np, pandas as pd
    >>> from pamid.estimators import JointPIHM
    >>> t = np.linspace(0, 6, 200)
    >>> X = pd.DataFrame({"eps": 0.1 + 0.05 * np.sin(t), "deps": 0.05 * np.cos(t),
    ...                   "P": 3e5 + 1e5 * np.cos(3 * t), "dP": -3e5 * np.sin(3 * t)})
    >>> V, V_eps = 7e-5 * (1 + 2 * X["eps"]), 1.4e-4  # m³
    >>> F = (X["P"] - 101325) / 0.2 * V_eps  # N
    >>> mdot = X["dP"] * V / (1.4 * 287 * 293) + X["P"] * V_eps * X["deps"] / (287 * 293)  # kg/s
    >>> model = JointPIHM(hidden_layer_sizes=(8,), max_iter=20, random_state=0).fit(X, np.column_stack([F, mdot]))
    >>> model.predict(X).shape
    (200, 2)
    """

    equations = ("force", "flow")
    joint = True

    def __init__(
        self,
        rest_length: float = 0.2,
        rest_diameter: float = 0.02,
        *,
        atmospheric_pressure: float = ATMOSPHERIC_PRESSURE,
        heat_capacity_ratio: float = HEAT_CAPACITY_RATIO,
        gas_constant: float = GAS_CONSTANT,
        temperature: float = TEMPERATURE,
        volume_model: str = "anchored",
        hidden_layer_sizes: Sequence[int] = (128, 128),
        activation: str = "softplus",
        trainer: Any = "levenberg_marquardt",
        max_iter: int | None = None,
        batch_size: int | None = None,
        weight_decay: float | None = None,
        validation_fraction: float | str = "auto",
        effects: Sequence[Any] | Mapping[str, Mapping[str, float]] | None = None,
        signals: Signals | None = None,
        dtype: str = "float64",
        device: str = "cpu",
        random_state: Any = None,
    ) -> None:
        self.rest_length = rest_length
        self.rest_diameter = rest_diameter
        self.atmospheric_pressure = atmospheric_pressure
        self.heat_capacity_ratio = heat_capacity_ratio
        self.gas_constant = gas_constant
        self.temperature = temperature
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

    def laws(self) -> tuple[Law, ...]:
        """Return the laws of force and flow, of which a fit on one column keeps the force's.

        Returns
        -------
        tuple of Law
            Laws of force (N) and flow (kg/s).
        """
        force = QuasiStaticForce(self.rest_length, self.atmospheric_pressure)
        flow = ThermodynamicFlow(self.heat_capacity_ratio, self.gas_constant, self.temperature)
        return (force, flow)[: getattr(self, "n_targets_", 2)]

    def fit(self, X: Any, y: Any, sample_weight: Any = None, groups: Any = None) -> JointPIHM:
        """Train the volume network on measured force and flow.

        Parameters
        ----------
        X : DataFrame or array, shape (n_samples, n_columns)
            Signals of the muscle.
        y : array, shape (n_samples, 2)
            Measured force (N) and mass flow (kg/s); NaN where one was not measured.
        sample_weight : array, shape (n_samples,), optional
            Weights of the samples.
        groups : array, shape (n_samples,), optional
            Run of each row.

        Returns
        -------
        JointPIHM
            The fitted model itself.
        """
        table, target = self._read_targets(X, y, reset=True)
        self.n_targets_ = target.shape[1]
        return self._fit(table, target, sample_weight, groups, (X, y))

    def predict(self, X: Any) -> np.ndarray:
        """Predict force and mass flow.

        Parameters
        ----------
        X : DataFrame or array, shape (n_samples, n_columns)
            Signals of the muscle.

        Returns
        -------
        ndarray, shape (n_samples, 2), or (n_samples,) after a fit on force alone
            Force, N, and mass flow, kg/s.
        """
        self._check_fitted("weights_")
        table, _ = self._read(X, reset=False)
        out = predicted(self, table)
        return out if self.n_targets_ == 2 else out[:, 0]

    def score(self, X: Any, y: Any, sample_weight: Any = None) -> float:
        """Return R², averaged over force and flow; rows where one was not measured are left out of its share.

        Parameters
        ----------
        X : DataFrame or array, shape (n_samples, n_columns)
            Signals of the muscle.
        y : array, shape (n_samples, 2) or (n_samples,)
            Measured force (N) and mass flow (kg/s).
        sample_weight : array, shape (n_samples,), optional
            Weights of the samples.

        Returns
        -------
        float
            R², dimensionless; one is perfect.
        """
        return mean_r2(y, self.predict(X), sample_weight)

    @classmethod
    def _checked_instances(cls) -> list[JointPIHM]:
        one = dict.fromkeys(("eps", "deps", "P", "dP"), 0)
        return [cls(volume_model="neural", hidden_layer_sizes=(6,), signals=one, max_iter=8)]
