"""A force model inside another estimator: the one given or a default, and the table that it reads."""

from abc import abstractmethod
from typing import Any

import numpy as np
import pandas as pd
from sklearn.base import clone

from pamid.requirements import reads_of

from ._checks import fit_arguments
from ._streaming import forget


class ForceInside:
    """Base of estimators that fit a force model of single rows inside.

    Attributes
    ----------
    model_ : estimator
        The fitted force model.
    """

    model: Any

    @abstractmethod
    def _default_model(self) -> Any:
        """Return the model where none is given."""

    def _own_model(self) -> Any:
        return self._default_model() if self.model is None else self.model

    def _read_by_model(self) -> tuple[str, ...]:
        return reads_of(self._own_model(), ("eps", "P"))

    def _fit_inside(self, table: Any, force: np.ndarray, weight: Any = None, groups: Any = None) -> None:
        """Fit a clone of the model, with weights and runs where it takes them."""
        self.model_ = clone(self._own_model())
        self.model_.fit(table, force, **fit_arguments(self.model_, weight, groups))
        forget(self.model_)


def state_table(reads: tuple[str, ...], eps: np.ndarray, deps: np.ndarray, P: np.ndarray, dP: np.ndarray) -> Any:
    """Return those signals of a muscle's state that a model reads, as a table."""
    columns = {"eps": eps, "deps": deps, "P": P, "dP": dP}
    return pd.DataFrame({name: columns[name] for name in reads})
