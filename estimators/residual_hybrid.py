"""A geometric force and a small network for what it leaves: the plain way to a hybrid model."""

from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY
from typing import Any, Self

import numpy as np
import pandas as pd

from pamid.constants import ATMOSPHERIC_PRESSURE
from pamid.errors import IncompatibleError
from pamid.fitting.epochs import standardisation
from pamid.fitting.one_layer import forward, forward_by_columns
from pamid.requirements import formulas_of, parameter_count

from ._base import SignalEstimator, SignalRegressor
from ._hybrid_fit import span_of
from ._hybrid_use import warn_outside
from ._inside import ForceInside
from ._one_layer import OneLayerNetwork
from ._parameters import parameters
from ._streaming import Streaming
from ._trajectories import trajectory_codes


@parameters
class ResidualHybrid(Streaming, OneLayerNetwork, ForceInside, SignalRegressor):
    r"""Hybrid of a force model and a network: the model is identified first, the network learns its residual.

    .. math:: F = F_\mathrm{model}(\varepsilon, P; \theta) + \frac{p}{\bar p}\, N(s)

    with the gauge pressure p in front of the network, so that a muscle without pressure pulls as the model says. The
    network has one hidden layer, trained by Levenberg–Marquardt.

    Parameters
    ----------
    model : estimator, optional
        Force model of single rows; ``GeometricForce("tondu_lopez")`` by default.
    inputs : sequence of str, default=("eps", "deps", "P", "dP")
        Signals that the network reads.
    vanishing : bool, default=True
        Whether the network's share vanishes with the gauge pressure.
    alpha : float, default=0.3
        Weight decay: factor of the squared weights in the sum of squares of the standardised residual, dimensionless.

    Attributes
    ----------
    parameters_, standard_errors_, units_ : dict
        Those of the force model, where it has them; empty otherwise.
    weights_ : dict of str to ndarray
        ``W0`` (n_inputs, hidden), ``b0``, ``W1`` (hidden, 1), ``b1``.
    input_mean_, input_scale_ : ndarray, shape (n_inputs,)
        Mean and standard deviation of the inputs, in their units.
    input_range_ : ndarray, shape (2, n_inputs)
        Least and greatest value of each input in the data of the fit.
    residual_scale_ : float
        Root mean square of what the model leaves, N.
    gauge_scale_ : float
        Root mean square of the gauge pressure, Pa.
    loss_curve_ : list of float
        Loss after each step, per row, in units of the residual's mean square.
    n_iter_ : int
        Steps of the fit.
    n_parameters_ : int
        Weights of the network and fitted parameters of the model.

    See Also
    --------
    StaticPIHM : A hybrid whose network is the volume, so that force and flow share it.

    Examples
    --------
    >>> import numpy as np, pandas as pd
    >>> from pamid.estimators import GeometricForce, ResidualHybrid
    >>> rng = np.random.default_rng(0)
    >>> X = pd.DataFrame({"eps": rng.uniform(0, 0.2, 500), "deps": rng.normal(0, 0.1, 500),
    ...                   "P": rng.uniform(1.2e5, 6e5, 500), "dP": rng.normal(0, 1e5, 500)})
    >>> F = 6e-4 * (X["P"] - 101325) * (2.5 * (1 - X["eps"]) ** 2 - 1.1 - 0.1 * np.tanh(20 * X["deps"]))
    >>> hybrid = ResidualHybrid(random_state=0).fit(X, F)
    >>> alone = GeometricForce("tondu_lopez").fit(X[["eps", "P"]], F)
    >>> bool(1 - hybrid.score(X, F) < 0.05 * (1 - alone.score(X[["eps", "P"]], F)))
    True
    """

    model: Any = None
    _: KW_ONLY
    inputs: Sequence[str] = ("eps", "deps", "P", "dP")
    hidden: int = 12
    vanishing: bool = True
    alpha: float = 0.3
    max_iter: int = 100
    atmospheric_pressure: float = ATMOSPHERIC_PRESSURE

    equations = ("force",)

    @property
    def reads(self) -> tuple[str, ...]:  # type: ignore[override]  # noqa: D102
        return tuple(dict.fromkeys((*self.inputs, *self._read_by_model(), *(("P",) if self.vanishing else ()))))

    def _default_model(self) -> Any:
        from .geometric_force import GeometricForce

        return GeometricForce("tondu_lopez", atmospheric_pressure=self.atmospheric_pressure)

    def fit(self, X: Any, y: Any, sample_weight: Any = None, groups: Any = None) -> Self:
        """Identify the model, then train the network on what it leaves.

        Parameters
        ----------
        y : array_like, shape (n_samples,)
            Tension, N.
        groups : array_like, shape (n_samples,), optional
            Run of each row, handed on to the model.

        Raises
        ------
        IncompatibleError
            If the model needs the order of time.
        """
        self._check_network()
        model = self._own_model()
        if "one_trajectory" in model.get_params():
            raise IncompatibleError(
                f"{type(model).__name__} learns sequences.", "a force model of single rows", "Choose another model."
            )
        clusters = None if groups is None else trajectory_codes(X, groups)
        table, target, weight = self._read_weighted(X, y, sample_weight, reset=True)
        self._fit_inside(self._model_table(table), target, None if sample_weight is None else weight, clusters)
        self.parameters_, self.standard_errors_, self.units_ = (
            dict(getattr(self.model_, name, {})) for name in ("parameters_", "standard_errors_", "units_")
        )
        used = weight > 0
        residual = target - self.model_.predict(self._model_table(table))
        share = weight[used]
        inputs = self._signals(table, self.inputs)[used]
        self.input_mean_, self.input_scale_ = standardisation(inputs, share)
        self.input_range_ = span_of(inputs)
        p = self._signal(table, "P")[used] - self.atmospheric_pressure if self.vanishing else np.ones(used.sum())
        self.gauge_scale_ = float(np.sqrt(np.average(p * p, weights=share))) or 1.0
        factor = p / self.gauge_scale_
        self.residual_scale_ = float(np.sqrt(np.average(residual[used] ** 2, weights=share))) or 1.0
        # A row is weighted by the square of the network's factor there, with the residual over that factor as target.
        small = np.abs(factor) < 1e-3
        safe = np.where(small, 1.0, factor)
        wanted = np.where(small, 0.0, residual[used] / self.residual_scale_ / safe)[:, None]
        x, share = (inputs - self.input_mean_) / self.input_scale_, np.where(small, 0.0, share * safe**2)
        self._train(x, wanted, share, (X, y), float(weight.sum()))
        self._remember(X, y, sample_weight, groups)
        self.n_parameters_ = sum(w.size for w in self.weights_.values()) + (parameter_count(self.model_) or 0)
        return self

    def predict(self, X: Any) -> np.ndarray:
        """Predict the tension, N.

        Warns
        -----
        ExtrapolationWarning
            If samples lie outside the range of the fit: the network is not anchored to anything there, and extrapolates
            no better than a network alone. `StaticPIHM` falls back on its geometry.
        """
        table = self._read_fitted(X, "weights_")
        inputs = self._signals(table, self.inputs)
        warn_outside(inputs, getattr(self, "input_range_", None), self.inputs, stacklevel=4)
        x = (inputs - self.input_mean_) / self.input_scale_
        share = self.residual_scale_ * forward(self.weights_, x)[:, 0]
        if self.vanishing:
            share *= (self._signal(table, "P") - self.atmospheric_pressure) / self.gauge_scale_
        return np.asarray(self.model_.predict(self._model_table(table)), dtype=float) + share

    def formulas(self, signals: Mapping[str, Any]) -> dict[str, tuple[str, Any]]:
        """Return the predictions as formulas of the signals, as an export writes them; none if `model` has none."""
        known_by = formulas_of(self.model_, signals)
        if not known_by:
            return {}
        ((unit, known),) = known_by.values()
        given = [signals[n] for n in self.inputs]
        share = self.residual_scale_ * forward_by_columns(self.weights_, given, self.input_mean_, self.input_scale_)[0]
        if self.vanishing:
            share = share * ((signals["P"] - self.atmospheric_pressure) / self.gauge_scale_)
        return {"force": (unit, known + share)}

    def _model_table(self, table: np.ndarray) -> Any:
        """Return the model's input: an array where its order is known, which takes less time than a DataFrame."""
        model = self._own_model()
        if isinstance(model, SignalEstimator) and model.signals is None:
            return np.column_stack([self._signal(table, name) for name in self._read_by_model()])
        return pd.DataFrame({name: self._signal(table, name) for name in self._read_by_model()})

    @classmethod
    def _checked_instances(cls) -> list[Any]:
        from .polynomial_force import PolynomialForce

        one = {"eps": 0, "P": 0}
        small: dict[str, Any] = {"hidden": 3, "max_iter": 4, "n_starts": 1, "signals": one, "random_state": 0}
        return [cls(PolynomialForce(1), inputs=("eps",), **small), cls(inputs=("P",), vanishing=False, **small)]
