"""What estimators with a memory share: which rows form a run, and the last direction of a motion within each."""

from collections.abc import Callable
from dataclasses import KW_ONLY, field
from typing import Any

import numpy as np

from pamid.errors import MissingColumnError

from ._parameters import parameters
from ._trajectories import has_trajectory_column, run_codes, trajectory_slices


class SequenceScore:
    """The score of estimators that predict along runs."""

    predict: Callable[..., np.ndarray]

    def score(self, X: Any, y: Any, sample_weight: Any = None, groups: Any = None) -> float:
        """Coefficient of determination of the prediction, in free run where the estimator predicts so."""
        from sklearn.metrics import r2_score

        return float(r2_score(y, self.predict(X, groups=groups), sample_weight=sample_weight))


@parameters
class SequenceMixin(SequenceScore):
    """Numbers the runs of a table, and scores.

    Parameters
    ----------
    trajectory_column : int, optional
        Position of the column that names the runs, for arrays that have no names: a change of its value begins a
        new run.
    """

    _: KW_ONLY
    one_trajectory: bool = False
    trajectory_column: int | None = None
    _codes_of_fit: np.ndarray | None = field(default=None, init=False)
    """Runs of the rows of the current fit."""

    def _codes(self, X: Any, table: np.ndarray, groups: Any) -> np.ndarray:
        """Trajectory number of each row, for rows in time order."""
        if groups is None and not has_trajectory_column(X):
            if self.trajectory_column is not None:
                if not 0 <= self.trajectory_column < table.shape[1]:
                    raise MissingColumnError(
                        f"trajectory_column is {self.trajectory_column}, but X has {table.shape[1]} columns.",
                        f"a position from 0 to {table.shape[1] - 1}",
                        "Correct trajectory_column.",
                    )
                column = table[:, self.trajectory_column]
                return np.cumsum(np.diff(column, prepend=column[:1]) != 0)
            known = self._codes_of_fit
            if known is not None and len(known) == len(table):
                return np.asarray(known)
        return run_codes(self, X, groups)


def last_direction(values: np.ndarray, codes: np.ndarray, travel: float) -> np.ndarray:
    """Return the last direction ±1 of a signal, 0 at each start; a turn is complete after `travel`, as in a play."""
    out = np.zeros(len(values))
    for rows in trajectory_slices(codes):
        way = 0.0
        steps = np.diff(values[rows], prepend=values[rows.start]) * (2.0 / travel)
        for k, step in enumerate(steps.tolist(), rows.start):
            way = min(1.0, max(-1.0, way + step))
            out[k] = way
    return out
