"""Force of a muscle from its geometry."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, Self

import numpy as np

from pamid.constants import ATMOSPHERIC_PRESSURE
from pamid.laws.quasi_static import QuasiStaticForce
from pamid.signals.state import State
from pamid.volume import ClassicalVolume, FitParameter
from pamid.volume.tondu_lopez import FRICTION_PARAMETERS, braid_friction

from ._base import Signals
from ._geometric import GeometricRegressor

_FRICTION_START = {"static_friction_area": 1e-5, "kinetic_friction_area": 1e-5, "stribeck_rate": 0.1}


class GeometricForce(GeometricRegressor):
    r"""Tension of a muscle by virtual work on a geometric volume model, its parameters identified.

    .. math:: F = \frac{P - P_\mathrm{atm}}{L_0}\,\frac{\partial V}{\partial\varepsilon}(\varepsilon, P; \theta)
        \left[\;-\,F_f(\dot\varepsilon, p)\;\right]

    θ is fitted by bounded least squares (exact Jacobian, steps scaled by it). Signals: ``eps`` and ``P``; with
    friction ``deps``, too.

    Parameters
    ----------
    model : {"chou_hannaford", "tondu_lopez", "bou_saba", "cylinder"}, default="chou_hannaford"
        Name of the volume model; every model with scalar parameters in `pamid.volume.all_volumes` will do.
    rest_length : float, default=0.2
        L₀, m. It cancels in a geometric force and only scales the volume.
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
    friction : bool, default=False
        Whether to add the braid friction of Tondu and Lopez, `pamid.volume.tondu_lopez.braid_friction`.
    atmospheric_pressure : float, default=101325
        Pa, absolute.
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
    PolynomialForce : A polynomial in place of the geometry.
    GeometricFlow : The same volume models in the flow.

    References
    ----------
    C.-P. Chou, B. Hannaford, "Measurement and modeling of McKibben pneumatic artificial muscles", IEEE Transactions
    on Robotics and Automation 12(1), 1996. https://doi.org/10.1109/70.481753

    B. Tondu, P. Lopez, "Modeling and control of McKibben artificial muscle robot actuators", IEEE Control Systems
    Magazine 20(2), 2000. https://doi.org/10.1109/37.833638

    Examples
    --------
    >>> import numpy as np
    >>> from pamid.estimators import GeometricForce
    >>> from pamid.volume.braided import chou_hannaford
    >>> eps, P = np.meshgrid(np.linspace(0.0, 0.2, 8), np.linspace(2e5, 6e5, 8))
    >>> F = chou_hannaford(P.ravel(), eps.ravel(), rest_diameter=0.021, braid_angle=0.45)
    >>> fit = GeometricForce(rest_length=0.2, rest_diameter=0.02).fit(np.c_[eps.ravel(), P.ravel()], F)
    >>> {name: round(value, 6) for name, value in fit.parameters_.items()}
    {'rest_length': 0.2, 'rest_diameter': 0.021, 'braid_angle': 0.45}
    """

    _silent = ("rest_length",)
    equations = ("force",)

    @classmethod
    def settings(cls, equation: str) -> dict[str, dict[str, Any]]:  # noqa: D102
        return super().settings(equation) | {"tondu_lopez, friction": {"model": "tondu_lopez", "friction": True}}

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
        friction: bool = False,
        atmospheric_pressure: float = ATMOSPHERIC_PRESSURE,
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
        self.friction = friction
        self.atmospheric_pressure = atmospheric_pressure
        self.max_iter = max_iter
        self.signals = signals

    @property
    def reads(self) -> tuple[str, ...]:  # type: ignore[override]  # noqa: D102
        return ("eps", "deps", "P") if self.friction else ("eps", "P")

    def fit(self, X: Any, y: Any, sample_weight: Any = None, groups: Any = None) -> Self:
        """Identify the free parameters.

        Parameters
        ----------
        X : DataFrame or array, shape (n_samples, n_columns)
            Columns ``eps`` (dimensionless), with friction ``deps`` (1/s), and ``P`` (Pa, absolute).
        y : array_like, shape (n_samples,)
            Tension, N.
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

    def _law(self) -> QuasiStaticForce:
        return QuasiStaticForce(self.rest_length, self.atmospheric_pressure)

    def _declared(self) -> dict[str, FitParameter]:
        declared = super()._declared()
        return declared | ({p.name: p for p in FRICTION_PARAMETERS} if self.friction else {})

    def _starting_values(self) -> dict[str, float]:
        values = super()._starting_values()
        if self.friction:
            values |= _FRICTION_START | {n: float(v) for n, v in (self.start or {}).items() if n in _FRICTION_START}
        return values

    def _predict_with(self, nominal: ClassicalVolume, values: Mapping[str, Any], state: State) -> np.ndarray:
        return super()._predict_with(nominal, values, state) - self._friction_force(values, state)

    def _predict_state(self, state: State) -> np.ndarray:
        return super()._predict_state(state) - self._friction_force(self.parameters_, state)

    def _friction_force(self, values: Mapping[str, Any], state: State) -> Any:
        if not self.friction:
            return 0.0
        numbers = {n: values[n] for n in _FRICTION_START}
        return braid_friction(state.deps, state.P - self.atmospheric_pressure, **numbers)

    @staticmethod
    def _checked_instances() -> list[GeometricForce]:
        one = {"eps": 0, "P": 0}
        return [
            GeometricForce(signals=one),
            GeometricForce("tondu_lopez", signals=one, max_iter=50),
            GeometricForce("bou_saba", friction=True, signals=one | {"deps": 0}, max_iter=50),
        ]
