"""A law over a volume that is linear in its coefficients."""

from __future__ import annotations

from typing import Any

import numpy as np

from pamid.errors import ParameterError
from pamid.signals.state import State
from pamid.volume import VolumeJet

from ._classical import ClassicalRegressor
from ._linear import LinearTerms


class PolynomialRegressor(LinearTerms, ClassicalRegressor):
    """Shared by `PolynomialForce` and `PolynomialFlow`."""

    def _basis(self, state: State) -> list[VolumeJet]:
        """Return the volume, with its derivatives, that each coefficient multiplies."""
        raise NotImplementedError

    def _shares(self, state: State) -> list[Any]:
        """Return the regressors of the coefficients."""
        (law,) = self.laws()
        return [law.predict(*jet, state) for jet in self._basis(state)]

    def _jet(self, state: State) -> VolumeJet:
        basis = self._basis(state)
        jet = VolumeJet(*(sum(c * b[i] for c, b in zip(self.coef_, basis, strict=True)) for i in range(3)))
        return jet._replace(V=jet.V + self._level())

    def _level(self) -> float:
        """Return a volume, m³, that the fit cannot see and the user states."""
        return 0.0


def require_degree(name: str, value: Any, least: int) -> int:
    """Return a polynomial degree as an int, or raise."""
    if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or not least <= value <= 12:
        remedy = f"Pass form={value!r}." if isinstance(value, str) else "Correct the degree."
        raise ParameterError(f"{name} is {value!r}.", f"an integer from {least} to 12", remedy)
    return int(value)
