"""Laws that read one learnt volume: what hybrid models and their adaptations share."""

from __future__ import annotations

import warnings
from abc import abstractmethod
from typing import Any, ClassVar

import numpy as np

from pamid.errors import FitError, InterruptedFitWarning, ShapeError
from pamid.laws.base import Law

from ._base import SignalRegressor
from ._hybrid_use import mean_r2
from ._progress import ProgressMixin
from ._streaming import Streaming


class LawModel(Streaming, ProgressMixin, SignalRegressor):
    """Predicts a column for each of its laws."""

    _fitted: ClassVar[str] = "weights_"
    """Attribute that a fit sets."""

    @abstractmethod
    def laws(self) -> tuple[Law, ...]:
        """Return the laws that read the volume, one a column of the target.

        Returns
        -------
        tuple of Law
            A law of force (N), of flow (kg/s), or both.
        """

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

        Returns
        -------
        float
            R², dimensionless; one is perfect.
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
