"""Force of a muscle as a polynomial."""

from dataclasses import KW_ONLY
from typing import Any, ClassVar

from pamid.errors import IncompatibleError, UnknownOptionError
from pamid.signals.state import State
from pamid.volume import VolumeJet

from ._laws import ForceLaw
from ._linear import PolynomialRegressor, require_degree
from ._parameters import parameters


@parameters
class PolynomialForce(ForceLaw, PolynomialRegressor):
    r"""Tension of a muscle as a polynomial, fitted by linear least squares.

    With ``form="area"`` the effective area −dV/dL is a polynomial of the contraction (Hildebrandt), so the force
    vanishes without gauge pressure and a volume belongs to it:

    .. math:: F = p \sum_{k=0}^{d} a_k \varepsilon^k, \qquad p = P - P_\mathrm{atm}

    With ``form="surface"`` the force itself is a polynomial of contraction and gauge pressure, which also takes up
    the elasticity of the bladder but has no volume:

    .. math:: F = \sum_{i + j \le d} c_{ij}\, \varepsilon^i p^j

    Parameters
    ----------
    degree : int, default=3
        Degree d.
    form : {"area", "surface"}, default="area"
        Which polynomial.
    rest_length : float, default=0.2
        L₀, m; scales the volume, not the force.
    rest_volume : float, default=0
        Volume at rest, m³, which force does not determine: `volume` counts from there.

    See Also
    --------
    GeometricForce : Fewer parameters, each with a meaning.
    PolynomialFlow : A polynomial volume in the flow.

    References
    ----------
    A. Hildebrandt, O. Sawodny, R. Neumann, A. Hartmann, "Cascaded tracking control concept for pneumatic muscle
    actuators", European Control Conference, 2003.

    Examples
    --------
    >>> import numpy as np
    >>> from pamid.estimators import PolynomialForce
    >>> from pamid.volume.hildebrandt import hildebrandt
    >>> eps, P = np.meshgrid(np.linspace(0.0, 0.2, 8), np.linspace(2e5, 6e5, 8))
    >>> F = hildebrandt(P.ravel(), eps.ravel(), areas=(2e-3, -6e-3, 1e-3))
    >>> fit = PolynomialForce(degree=2).fit(np.c_[eps.ravel(), P.ravel()], F)
    >>> {name: round(value, 9) for name, value in fit.parameters_.items()}
    {'a0': 0.002, 'a1': -0.006, 'a2': 0.001}
    """

    degree: int = 3
    form: str = "area"
    _: KW_ONLY
    rest_length: float = 0.2
    rest_volume: float = 0.0

    reads = ("eps", "P")
    _level_known = False
    _settings: ClassVar = {"area": {}, "surface": {"form": "surface"}}
    _checked = ({"degree": 2}, {"degree": 2, "form": "surface"})

    def _powers(self) -> list[tuple[int, int]]:
        """Return the powers of ε and p of each term of the surface, constant first."""
        d = require_degree("degree", self.degree, 0)
        return [(n - j, j) for n in range(d + 1) for j in range(n + 1)]

    def _is_area(self) -> bool:
        if self.form not in ("area", "surface"):
            raise UnknownOptionError(f"form is {self.form!r}.", "'area' or 'surface'", "Correct the name.")
        return self.form == "area"

    def _terms(self) -> dict[str, str]:
        if self._is_area():
            return {f"a{k}": "m²" for k in range(require_degree("degree", self.degree, 0) + 1)}
        units = {0: "N", 1: "N/Pa"}
        return {f"c{i}{j}" if i < 10 > j else f"c{i}_{j}": units.get(j, f"N/Pa^{j}") for i, j in self._powers()}

    def _basis(self, state: State) -> list[VolumeJet]:
        zero = 0.0 * state.eps
        return [
            VolumeJet(self.rest_length * state.eps ** (k + 1) / (k + 1), self.rest_length * state.eps**k, zero)
            for k in range(require_degree("degree", self.degree, 0) + 1)
        ]

    def _shares(self, state: State) -> list[Any]:
        if self._is_area():
            return super()._shares(state)
        p_gauge = state.P - self.atmospheric_pressure
        return [state.eps**i * p_gauge**j for i, j in self._powers()]

    def _level(self) -> float:
        return self.rest_volume

    def volume(self, X: Any) -> VolumeJet:
        """Return the identified volume and its derivatives, and warn where they make no physical sense.

        Returns
        -------
        VolumeJet
            V (m³, counted from `rest_volume`), ∂V/∂ε (m³) and ∂V/∂P = 0, each of shape (n_samples,).

        Raises
        ------
        IncompatibleError
            If ``form="surface"``, which has no volume.
        """
        if not self._is_area():
            raise IncompatibleError(
                "PolynomialForce(form='surface') is a polynomial of the force itself.",
                "a model that states a volume",
                "Use form='area', GeometricForce or StaticPIHM.",
            )
        return super().volume(X)
