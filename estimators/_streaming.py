"""``partial_fit`` of estimators that are not linear in their parameters: a bounded memory, and the fit to it."""

import inspect
import warnings
from dataclasses import replace
from typing import Any, ClassVar, Self

import numpy as np
import pandas as pd
from sklearn.utils.validation import column_or_1d

from pamid.errors import ExcitationWarning
from pamid.fitting.stream_memory import Rows, bounded, merged

from ._checks import row_weights
from ._sequences import SequenceMixin
from ._trajectories import TRAJECTORY, trajectory_codes

MEMORY_ROWS = 5_000
"""Rows that a model of single rows remembers."""

HALF = 0.5
"""Mean weight of a remembered row below which most of what was learnt is no longer in the memory."""

GROWN = 2
"""Growth of the weight in a faded memory at which a model is refitted instead of continued."""

MEMORY_ROWS_IN_ORDER = 20_000
"""Rows that a model of runs remembers: neighbours in time add little information."""


class StreamMemory:
    """A memory of the stream, for an estimator whose ``fit`` calls ``self._remember(...)``.

    After each batch the model is the fit to the memory: how well a network does depends on how long it was trained, so
    that going on from where it stands is no fit. Only one that forgets (``_fade``) goes on (``_continue``).
    """

    _memory: dict[str, Any]
    _memory_rows: ClassVar[int | None] = None
    """Rows remembered, where neither of the bounds above is meant."""

    @property
    def _own(self) -> Any:
        """The estimator that this is mixed into."""
        return self

    # --- the memory ---------------------------------------------------------------------------------------------
    def _remember(self, X: Any, y: Any, sample_weight: Any = None, groups: Any = None) -> None:
        """Begin a memory with the rows of a fit."""
        rows, grouped = self._stream_rows(X, y, sample_weight, groups)
        rows = bounded(rows, self._most(), whole=self._whole(grouped), random=np.random.default_rng(0))
        self._store(rows, grouped)

    def _store(self, rows: Rows, grouped: bool, n_batches: int = 1, fitted: int = 0) -> None:
        self._memory = rows.plain() | {"grouped": bool(grouped), "n_batches": n_batches, "fitted": fitted or len(rows)}

    def _recalled(self) -> Rows:
        return Rows(*(self._memory[name] for name in ("X", "y", "weight", "unit")))

    def _partial_fit_rows(self, X: Any, y: Any, sample_weight: Any, groups: Any) -> Self:
        if not hasattr(self, "_memory"):
            given = {"sample_weight": sample_weight, "groups": groups}
            self._own.fit(X, y, **{k: v for k, v in given.items() if v is not None})
            return self
        batch, grouped = self._stream_rows(X, y, sample_weight, groups)
        if not (batch.weight > 0).any():
            return self
        held, count = self._recalled(), int(self._memory["n_batches"])
        batch = replace(batch, unit=batch.unit + int(held.unit.max()) + 1)
        grouped = grouped or bool(self._memory["grouped"])
        whole, fitted = self._whole(grouped), int(self._memory["fitted"])
        faded = replace(held, weight=self._fade(float(batch.weight.sum())) * held.weight)
        rows = merged(faded.followed_by(batch), whole=whole)
        nothing_new = len(rows) == len(held) and not self._weighs()
        rows = bounded(rows, self._most(), whole=whole, random=np.random.default_rng(count))
        counting = float(rows.weight.sum())
        if nothing_new:
            pass
        elif counting < min(HALF * len(rows), GROWN * fitted):
            self._continue(rows)  # faded rows are too few for a fit from scratch; the estimator still contains them
        else:
            self._refit(rows, grouped)
            fitted = len(rows)
        self._store(rows, grouped, count + 1, fitted)
        return self

    def _refit(self, rows: Rows, grouped: bool) -> None:
        """Fit to what is remembered."""
        X, y, given = self._arguments(rows, grouped)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ExcitationWarning)  # already reported for the batch it applies to
            self._own.fit(X, y, **given)

    def _continue(self, rows: Rows) -> None:
        """Go on from where the model stands, where most of what it learnt has faded from the memory."""
        raise NotImplementedError

    def _arguments(self, rows: Rows, grouped: bool) -> tuple[Any, Any, dict[str, Any]]:
        """Return remembered rows as ``fit`` takes them."""
        given: dict[str, Any] = {}
        if self._weighs() and not (rows.weight == 1.0).all():
            given["sample_weight"] = rows.weight
        names = getattr(self, "feature_names_in_", None)
        X: Any = rows.X
        if names is not None:
            X = pd.DataFrame(X, columns=names)
            if TRAJECTORY in names:
                X[TRAJECTORY] = rows.unit
        if grouped and not (names is not None and TRAJECTORY in names):
            given["groups"] = rows.unit
        return X, (rows.y if self._memory_columns(rows) else rows.y[:, 0]), given

    # --- what an estimator may say of itself --------------------------------------------------------------------
    def _stream_rows(self, X: Any, y: Any, sample_weight: Any, groups: Any) -> tuple[Rows, bool]:
        """Validate a batch; say also whether its rows are distinguished by runs."""
        table, target = self._stream_table(X, y)
        weight = row_weights(sample_weight, table)
        codes = self._stream_codes(X, table, groups)
        unit = np.zeros(len(table), dtype=int) if codes is None else np.unique(codes, return_inverse=True)[1]
        return Rows(table.copy(), target.copy(), weight.copy(), unit), codes is not None

    def _stream_table(self, X: Any, y: Any) -> tuple[np.ndarray, np.ndarray]:
        table, y = self._own._read(X, y, reset=False)
        return table, column_or_1d(y).astype(float)[:, None]

    def _stream_codes(self, X: Any, table: np.ndarray, groups: Any) -> np.ndarray | None:
        if isinstance(self, SequenceMixin):
            return np.asarray(self._codes(X, table, groups))
        return trajectory_codes(X, groups)

    def _memory_columns(self, rows: Rows) -> bool:
        """Whether the target keeps its columns."""
        return rows.y.shape[1] > 1

    def _most(self) -> int:
        return self._memory_rows or (MEMORY_ROWS_IN_ORDER if self._in_order() else MEMORY_ROWS)

    def _in_order(self) -> bool:
        """Whether the estimator needs the order of time."""
        return "one_trajectory" in self._own.get_params(deep=False)

    def _whole(self, grouped: bool) -> bool:
        """Whether the memory keeps or drops whole runs instead of rows."""
        return self._in_order() or (grouped and not self._weighs())

    def _fade(self, weight: float) -> float:
        """By how much what is remembered counts less once rows of this weight have come."""
        return 1.0

    def _weighs(self) -> bool:
        return "sample_weight" in inspect.signature(self._own.fit).parameters


class Streaming(StreamMemory):
    """Gives ``partial_fit`` to an estimator; goes left of its other bases."""

    def partial_fit(self, X: Any, y: Any, sample_weight: Any = None, groups: Any = None) -> Self:
        """Take in a batch of a stream: the fit of all rows so far, as long as the memory holds them.

        Up to 5,000 different rows (20,000 rows of whole runs where the order of time is read), the model after any
        number of batches is that of one ``fit`` on all of them. Beyond, it is the fit to a random sample of the stream,
        with the weight of all; memory does not grow. A call costs no more than a fit to the memory. A change of the
        muscle is not detected here: `pamid.online.ChangeMonitor` does that, and `fit` starts again.

        Parameters
        ----------
        groups : array_like, shape (n_samples,), optional
            Run of each row, as in ``fit``; no run continues from one call to the next.
        """
        return self._partial_fit_rows(X, y, sample_weight, groups)


class SequenceStreaming(StreamMemory):
    """The same for an estimator whose ``fit`` takes no weights."""

    def partial_fit(self, X: Any, y: Any, groups: Any = None) -> Self:
        """Take in further runs: the fit of all so far, as long as the memory holds them.

        Up to 20,000 rows, the model after any number of batches is that of one ``fit`` on all their
        runs; a repeated run adds nothing. Beyond, it is the fit to a random sample of whole runs;
        memory does not grow. A call costs no more than a fit to the memory. A change of the system is not detected
        here: `pamid.online.ChangeMonitor` does that, and `fit` starts again.

        Parameters
        ----------
        groups : array_like, shape (n_samples,), optional
            Run of each row, as in ``fit``; no run continues from one call to the next.
        """
        return self._partial_fit_rows(X, y, None, groups)


def forget(model: Any) -> Any:
    """Drop the memory of a model inside another one, which has its own."""
    if isinstance(model, StreamMemory) and "_memory" in vars(model):
        del model._memory
    return model
