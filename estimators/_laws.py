"""The laws that read a volume, as parts of an estimator, and what models of several laws share."""

import warnings
from abc import abstractmethod
from dataclasses import KW_ONLY
from typing import Any, ClassVar

import numpy as np

from pamid.constants import ATMOSPHERIC_PRESSURE, GAS_CONSTANT, HEAT_CAPACITY_RATIO, TEMPERATURE
from pamid.errors import FitError, InterruptedFitWarning, ShapeError
from pamid.laws.base import Law
from pamid.laws.quasi_static import QuasiStaticForce
from pamid.laws.thermodynamic import ThermodynamicFlow

from ._base import SignalRegressor
from ._hybrid_use import mean_r2
from ._parameters import parameters
from ._progress import ProgressMixin
from ._streaming import Streaming


def force_of(estimator: Any) -> QuasiStaticForce:
    """Return the force (N) by virtual work, for the numbers of an estimator."""
    return QuasiStaticForce(estimator.rest_length, estimator.atmospheric_pressure)


def flow_of(estimator: Any) -> ThermodynamicFlow:
    """Return the mass flow (kg/s) by the first law, for the numbers of an estimator."""
    return ThermodynamicFlow(estimator.heat_capacity_ratio, estimator.gas_constant, estimator.temperature)


@parameters
class ForceLaw:
    """Reads the volume by virtual work; goes left of the volume model."""

    _: KW_ONLY
    atmospheric_pressure: float = ATMOSPHERIC_PRESSURE

    equations: ClassVar[tuple[str, ...]] = ("force",)

    def laws(self) -> tuple[Law, ...]:
        """Return the quasi-static law of the force (N), one in a tuple."""
        return (force_of(self),)


@parameters
class FlowLaw:
    """Reads the volume by the first law of thermodynamics; goes left of the volume model.

    Parameters
    ----------
    heat_capacity_ratio : float
        γ, dimensionless; 1 is an isothermal muscle.
    gas_constant : float
        R, J/(kg K).
    temperature : float
        T, K.
    """

    _: KW_ONLY
    heat_capacity_ratio: float = HEAT_CAPACITY_RATIO
    gas_constant: float = GAS_CONSTANT
    temperature: float = TEMPERATURE

    equations: ClassVar[tuple[str, ...]] = ("flow",)

    def laws(self) -> tuple[Law, ...]:
        """Return the law of the flow (kg/s), one in a tuple."""
        return (flow_of(self),)


class LawModel(Streaming, ProgressMixin, SignalRegressor):
    """Predicts a column for each of its laws.

    Attributes
    ----------
    n_iter_ : int
        Iterations of the trainer.
    loss_curve_, validation_curve_ : list of float
        Mean squared residual after each iteration, in units of the target's variance.
    status_ : str
        Why the training ended.
    """

    _fitted: ClassVar[str] = "weights_"
    """Attribute that a fit sets."""

    @abstractmethod
    def laws(self) -> tuple[Law, ...]:
        """Return the laws that read the volume, one a column of the target."""

    @abstractmethod
    def _outputs(self, table: np.ndarray) -> np.ndarray:
        """Return each law's prediction for a validated table, shape (n_samples, n_laws)."""

    def predict(self, X: Any) -> np.ndarray:
        """Predict what the laws say of the identified volume.

        Returns
        -------
        ndarray, shape (n_samples,) or (n_samples, 2)
            Force (N), mass flow (kg/s), or both.
        """
        self._check_fitted(self._fitted)
        table, _ = self._read(X, reset=False)
        out = self._outputs(table)
        return out[:, 0] if out.shape[1] == 1 else out

    def score(self, X: Any, y: Any, sample_weight: Any = None) -> float:
        """Return R², averaged over force and flow; rows where one was not measured are left out of its share.

        Parameters
        ----------
        y : array, shape (n_samples,) or (n_samples, 2)
            Measured force (N) or mass flow (kg/s), or both.
        """
        return mean_r2(y, self.predict(X), sample_weight)

    def _stream_table(self, X: Any, y: Any) -> tuple[np.ndarray, np.ndarray]:
        table, target = self._read_targets(X, y, reset=False)
        if target.shape[1] != len(self.laws()):
            raise ShapeError(f"y has {target.shape[1]} columns.", f"{len(self.laws())}, as in the fit", "Correct y.")
        return table, target

    def _tell_status(self, status: Any) -> None:
        """Note why a training ended; warn of an interruption, raise where it diverged."""
        from pamid.training import Status

        self.status_ = status.name.lower()
        if status is Status.INTERRUPTED:
            warnings.warn(status.value, InterruptedFitWarning, stacklevel=6)
        if status is Status.DIVERGED:
            raise FitError(status.value, "a finite loss", "Check units and outliers; lower the learning rate.")
