"""What the classical estimators share: named parameters, signals in, a law over a fitted volume model, a volume out."""

import warnings
from abc import abstractmethod
from collections.abc import Mapping
from typing import Any

import numpy as np
from sklearn.utils.validation import check_is_fitted

from pamid.errors import ExcitationWarning
from pamid.laws.base import Law
from pamid.signals.plausibility import check_units
from pamid.signals.state import State
from pamid.volume import VolumeJet, check_volume

from ._base import SignalRegressor, state_of
from ._trajectories import trajectory_codes


class BoundedFit:
    """Parameters by name, each fitted or held, with units and errors.

    Parameters
    ----------
    max_iter : int
        Maximum number of evaluations of the model.

    Attributes
    ----------
    parameters_ : dict of str to float
        Every parameter, fitted or held, SI units.
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
    """

    fitted_names_: list[str]

    @property
    def n_parameters_(self) -> int:
        """Number of fitted parameters."""
        check_is_fitted(self, "fitted_names_")
        return len(self.fitted_names_)


class ClassicalRegressor(SignalRegressor):
    """A law read with a classical volume model; subclasses say how the model is fitted and built."""

    _level_known = True

    @abstractmethod
    def laws(self) -> tuple[Law, ...]:
        """Return the law that reads the volume."""

    @abstractmethod
    def _jet(self, state: State) -> VolumeJet:
        """Return the fitted volume and its derivatives."""

    # --- the way in -------------------------------------------------------------------------------------------
    def _training(
        self, X: Any, y: Any, sample_weight: Any, groups: Any, *, reset: bool = True, least: int = 2
    ) -> tuple[State, np.ndarray, np.ndarray, np.ndarray | None]:
        """Validate what a fit is given: signals, target, weights, clusters. Warn of wrong units."""
        clusters = None if groups is None else trajectory_codes(X, groups)
        X, y, weight = self._read_weighted(X, y, sample_weight, reset=reset, ensure_min_samples=least)
        state = state_of(self, X)
        (law,) = self.laws()
        signals = {name: self._signal(X, name) for name in self.reads}
        check_units(signals | {law.target: y})
        return state, y, weight, clusters

    # --- the way out ------------------------------------------------------------------------------------------
    def predict(self, X: Any) -> np.ndarray:
        """Predict what the law says of the fitted volume: force in N or mass flow in kg/s."""
        check_is_fitted(self)
        X, _ = self._read(X, reset=False)
        return self._predict_state(state_of(self, X))

    def _predict_state(self, state: State) -> np.ndarray:
        return self.laws()[0].predict(*self._jet(state), state)

    def formulas(self, signals: Mapping[str, Any]) -> dict[str, tuple[str, Any]]:
        """Return the predictions as formulas of the signals, which may be symbols: what an export writes."""
        (law,) = self.laws()
        return {law.equation: (law.unit, self._formula(State(*(signals.get(s, 0.0) for s in State._fields))))}

    def _formula(self, state: State) -> Any:
        return self._predict_state(state)

    def volume(self, X: Any) -> VolumeJet:
        """Return the identified volume and its derivatives, and warn where they make no physical sense.

        Warns
        -----
        VolumeWarning
            If the volume is not positive or falls with contraction.
        """
        check_is_fitted(self)
        X, _ = self._read(X, reset=False)
        state = state_of(self, X)
        jet = self._jet(state)
        check_volume(jet, state, level_known=self._level_known)
        return jet


def warn_of_still_signals(state: State, names: tuple[str, ...], who: str) -> None:
    """Warn, before a fit, of signals that do not vary: what depends on them is not identified."""
    for name in names:
        values = getattr(state, name)
        if len(values) > 2 and np.ptp(values) <= 1e-6 * max(float(np.abs(values).max()), 1e-12):
            warnings.warn(
                f"The signal {name} hardly varies (range {np.ptp(values):.3g} around {values.mean():.6g}). "
                f"Expected an experiment that moves it. {who} fits, but parameters that act through {name} alone are "
                "not identified; look at the standard errors.",
                ExcitationWarning,
                stacklevel=4,
            )
