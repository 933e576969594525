"""Force of a muscle from its geometry."""

from collections.abc import Mapping
from dataclasses import KW_ONLY
from typing import Any

import numpy as np

from pamid.signals.state import State
from pamid.volume import ClassicalVolume, FitParameter
from pamid.volume.tondu_lopez import FRICTION_PARAMETERS, braid_friction

from ._geometric import GeometricRegressor
from ._laws import ForceLaw
from ._parameters import parameters

_FRICTION_START = {"static_friction_area": 1e-5, "kinetic_friction_area": 1e-5, "stribeck_rate": 0.1}


@parameters
class GeometricForce(ForceLaw, GeometricRegressor):
    r"""Tension of a muscle by virtual work on a geometric volume model, its parameters identified.

    .. math:: F = \frac{P - P_\mathrm{atm}}{L_0}\,\frac{\partial V}{\partial\varepsilon}(\varepsilon, P; \theta)
        \left[\;-\,F_f(\dot\varepsilon, p)\;\right]

    θ is fitted by bounded least squares (exact Jacobian, steps scaled by it). Signals: ``eps`` and ``P``; with
    friction ``deps``, too.

    Parameters
    ----------
    rest_length : float, default=0.2
        L₀, m. It cancels in a geometric force and only scales the volume.
    friction : bool, default=False
        Whether to add the braid friction of Tondu and Lopez, `pamid.volume.tondu_lopez.braid_friction`.

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

    _: KW_ONLY
    friction: bool = False

    _silent = ("rest_length",)
    _checked = (
        {},
        {"model": "tondu_lopez", "max_iter": 50},
        {"model": "bou_saba", "friction": True, "max_iter": 50},
    )

    @classmethod
    def settings(cls, equation: str) -> dict[str, dict[str, Any]]:  # noqa: D102
        return super().settings(equation) | {"tondu_lopez, friction": {"model": "tondu_lopez", "friction": True}}

    @property
    def reads(self) -> tuple[str, ...]:  # type: ignore[override]  # noqa: D102
        return ("eps", "deps", "P") if self.friction else ("eps", "P")

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
