"""Mass flow into a muscle from its geometry."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, ClassVar, Self

from pamid.constants import GAS_CONSTANT, HEAT_CAPACITY_RATIO, TEMPERATURE
from pamid.laws.thermodynamic import ThermodynamicFlow
from pamid.signals.state import STATE_SIGNALS

from ._base import Signals
from ._geometric import GeometricRegressor


class GeometricFlow(GeometricRegressor):
    r"""Mass flow into a muscle by the first law on a geometric volume model, its parameters identified.

    .. math:: \dot m = \frac{\dot P\, V(\theta)}{\gamma R T} + \frac{P}{R T}\left(
        \frac{\partial V}{\partial\varepsilon}\dot\varepsilon + \frac{\partial V}{\partial P}\dot P\right)

    θ is fitted by bounded least squares (exact Jacobian, steps scaled by it). Signals: ``eps``, ``deps``, ``P``,
    ``dP``.

    Parameters
    ----------
    model : {"chou_hannaford", "tondu_lopez", "bou_saba", "cylinder"}, default="chou_hannaford"
        Name of the volume model; every model with scalar parameters in `pamid.volume.all_volumes` will do.
    rest_length : float, default=0.2
        L₀, m. The volume scales with D₀² L₀, so only one of the two can be identified; it is held by default.
    rest_diameter : float, default=0.02
        D₀, m: start of the fit, or the value held.
    braid_angle : float, default=0.4363
        θ₀ to the axis at rest, rad: start of the fit, or the value held.
    start : mapping of str to float, optional
        Starting or held values of the model's other parameters, such as ``{"end_cap": 1.1}``.
    free : "auto", "all" or list of str, default="auto"
        Parameters to fit. "auto" takes those that the model declares as free.
    bounds : mapping of str to (float, float), optional
        Bounds that replace the model's own, in SI units.
    heat_capacity_ratio : float, default=1.4
        γ, dimensionless; 1 is an isothermal muscle.
    gas_constant : float, default=287
        R, J/(kg K).
    temperature : float, default=293
        T, K.
    max_iter : int, default=200
        Maximum number of evaluations of the model.
    signals : mapping of str to (str or int), optional
        Which column holds which signal.

    Attributes
    ----------
    parameters_ : dict of str to float
        Every parameter of the model, fitted or held, SI units.
    standard_errors_ : dict of str to float
        Their standard errors: 0 for a held parameter, infinite for one that the data do not determine or that lies
        on a bound. With `groups`, cluster-robust.
    units_ : dict of str to str
        Their units.
    fitted_names_ : list of str
        The parameters that were fitted, in the order of `covariance_`.
    covariance_ : ndarray, shape (n_fitted, n_fitted)
        Covariance of the fitted parameters.
    at_bound_ : list of str
        Fitted parameters that lie on a bound.
    n_iter_ : int
        Evaluations used.
    signal_columns_ : dict of str to int
        Column of each signal.
    n_features_in_ : int
        Columns of X.
    feature_names_in_ : ndarray of str
        Their names, if X had names.

    See Also
    --------
    PolynomialFlow : A polynomial in place of the geometry.
    GeometricForce : The same volume models in the force.

    References
    ----------
    E. Richer, Y. Hurmuzlu, "A high performance pneumatic force actuator system: Part I, nonlinear mathematical
    model", Journal of Dynamic Systems, Measurement, and Control 122(3), 2000. https://doi.org/10.1115/1.1286336

    Examples
    --------
    >>> import numpy as np
    >>> from pamid.estimators import GeometricFlow
    >>> from pamid.volume.braided import BraidedVolume
    >>> from pamid.volume.functions import flow
    >>> rng = np.random.default_rng(0)
    >>> eps, deps = rng.uniform(0, 0.2, 99), rng.normal(0, 0.5, 99)
    >>> P, dP = rng.uniform(2e5, 6e5, 99), rng.normal(0, 1e6, 99)
    >>> mdot = flow(BraidedVolume(0.2, 0.021, 0.45), P, dP, eps, deps)
    >>> fit = GeometricFlow(rest_length=0.2).fit(np.c_[eps, deps, P, dP], mdot)
    >>> {name: round(value, 6) for name, value in fit.parameters_.items()}
    {'rest_length': 0.2, 'rest_diameter': 0.021, 'braid_angle': 0.45}
    """

    reads = STATE_SIGNALS
    equations = ("flow",)
    _moving: ClassVar[tuple[str, ...]] = STATE_SIGNALS

    def __init__(
        self,
        model: str = "chou_hannaford",
        *,
        rest_length: float = 0.2,
        rest_diameter: float = 0.02,
        braid_angle: float = 0.4363,
        start: Mapping[str, float] | None = None,
        free: str | Iterable[str] = "auto",
        bounds: Mapping[str, tuple[float, float]] | None = None,
        heat_capacity_ratio: float = HEAT_CAPACITY_RATIO,
        gas_constant: float = GAS_CONSTANT,
        temperature: float = TEMPERATURE,
        max_iter: int = 200,
        signals: Signals | None = None,
    ) -> None:
        self.model = model
        self.rest_length = rest_length
        self.rest_diameter = rest_diameter
        self.braid_angle = braid_angle
        self.start = start
        self.free = free
        self.bounds = bounds
        self.heat_capacity_ratio = heat_capacity_ratio
        self.gas_constant = gas_constant
        self.temperature = temperature
        self.max_iter = max_iter
        self.signals = signals

    def fit(self, X: Any, y: Any, sample_weight: Any = None, groups: Any = None) -> Self:
        """Identify the free parameters.

        Parameters
        ----------
        X : DataFrame or array, shape (n_samples, n_columns)
            Columns ``eps`` (dimensionless), ``deps`` (1/s), ``P`` (Pa, absolute), ``dP`` (Pa/s).
        y : array_like, shape (n_samples,)
            Mass flow into the muscle, kg/s.
        sample_weight : array_like, shape (n_samples,), optional
            Weights; a weight of 2 is the same row twice.
        groups : array_like, shape (n_samples,), optional
            Run of each row. It does not change the fit, only its standard errors: residuals of one
            run are then taken as dependent.

        Returns
        -------
        self
            The fitted estimator.
        """
        self._fit_parameters(*self._training(X, y, sample_weight, groups))
        self._remember(X, y, sample_weight, groups)
        return self

    def _law(self) -> ThermodynamicFlow:
        return ThermodynamicFlow(self.heat_capacity_ratio, self.gas_constant, self.temperature)

    @staticmethod
    def _checked_instances() -> list[GeometricFlow]:
        one = dict.fromkeys(STATE_SIGNALS, 0)
        return [GeometricFlow(signals=one), GeometricFlow("tondu_lopez", signals=one, max_iter=50)]
