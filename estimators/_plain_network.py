"""What networks without physics have in common: signals to read, early stopping, scales, and settings to compare."""

from collections.abc import Sequence
from dataclasses import KW_ONLY
from typing import Any

import numpy as np

from pamid.fitting.epochs import standardisation

from ._base import SignalRegressor
from ._parameters import parameters
from ._progress import ProgressMixin


@parameters
class PlainNetwork(ProgressMixin, SignalRegressor):
    """Network from signals to a target.

    Parameters
    ----------
    early_stopping : bool, default=False
        Whether to hold out whole runs, keep the weights that do best on them, and stop when they cease to
        improve. Otherwise the training loss decides.
    validation_fraction : float, default=0.2
        Share of the runs that is held out, dimensionless.
    patience : int, default=30
        Epochs without improvement after which the fit ends.
    tol : float, default=1e-5
        Relative improvement of the loss that counts, dimensionless.

    Attributes
    ----------
    input_mean_, input_scale_ : ndarray, shape (n_inputs,)
        Mean and standard deviation of the inputs, in their units.
    target_mean_, target_scale_ : float
        Mean and standard deviation of the target, in its unit.
    validation_curve_ : list of float
        The same error on the held-out runs; empty without early stopping.
    n_iter_ : int
        Epochs of the fit.
    """

    _: KW_ONLY
    early_stopping: bool = False
    validation_fraction: float = 0.2
    random_state: Any = None
    device: str = "cpu"

    inputs: Sequence[str]
    equations = ("force", "flow", "dynamic")

    @classmethod
    def settings(cls, equation: str) -> dict[str, dict[str, Any]]:
        if equation == "dynamic":  # the comparison gives the inputs of the output
            return {"": {}}
        return {"": {"inputs": ("eps", "deps", "P", "dP")}}  # as the hybrid models

    @property
    def reads(self) -> tuple[str, ...]:  # type: ignore[override]
        return tuple(self.inputs)

    def _set_scales(self, columns: np.ndarray, target: np.ndarray, weights: np.ndarray | None = None) -> None:
        weights = np.ones(len(columns)) if weights is None else weights
        self.input_mean_, self.input_scale_ = standardisation(columns, weights)
        mean, scale = standardisation(target[:, None], weights)
        self.target_mean_, self.target_scale_ = float(mean[0]), float(scale[0])
