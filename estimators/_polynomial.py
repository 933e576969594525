"""A law over a volume that is linear in its coefficients."""

from __future__ import annotations

from typing import Any

import numpy as np
from sklearn.utils.validation import check_is_fitted

from pamid.errors import ParameterError
from pamid.signals.state import State
from pamid.volume import VolumeJet, check_volume

from ._base import state_of
from ._classical import ClassicalRegressor, warn_of_still_signals
from ._linear import LinearTerms


class PolynomialRegressor(LinearTerms, ClassicalRegressor):
    """Shared by `PolynomialForce` and `PolynomialFlow`."""

    def _basis(self, state: State) -> list[VolumeJet]:
        """Return the volume, with its derivatives, that each coefficient multiplies."""
        raise NotImplementedError

    def _shares(self, state: State) -> list[Any]:
        """Return what each coefficient multiplies in the prediction."""
        law = self._law()
        return [law.predict(*jet, state) for jet in self._basis(state)]

    def _warn_of_still(self, state: State) -> None:
        warn_of_still_signals(state, self.reads, type(self).__name__)

    def volume(self, X: Any) -> VolumeJet:
        """Return the identified volume and its derivatives, and warn where they make no physical sense.

        Parameters
        ----------
        X : DataFrame or array, shape (n_samples, n_columns)
            The signals that the fit read, SI units, absolute pressure.

        Returns
        -------
        VolumeJet
            V (m³), ∂V/∂ε (m³) and ∂V/∂P (m³/Pa), each of shape (n_samples,).

        Warns
        -----
        VolumeWarning
            If the volume is not positive or falls with contraction.
        """
        check_is_fitted(self)
        X, _ = self._read(X, reset=False)
        state = state_of(self, X)
        basis = self._basis(state)
        jet = VolumeJet(*(sum(c * b[i] for c, b in zip(self.coef_, basis, strict=True)) for i in range(3)))
        jet = jet._replace(V=jet.V + self._level())
        check_volume(jet, state, level_known=self._level_known)
        return jet

    def _level(self) -> float:
        """Return a volume, m³, that the fit cannot see and the user states."""
        return 0.0


def require_degree(name: str, value: Any, least: int) -> int:
    """Return a polynomial degree as an int, or raise."""
    if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or not least <= value <= 12:
        remedy = f"Pass form={value!r}." if isinstance(value, str) else "Correct the degree."
        raise ParameterError(f"{name} is {value!r}.", f"an integer from {least} to 12", remedy)
    return int(value)
