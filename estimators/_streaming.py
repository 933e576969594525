"""``partial_fit`` of estimators that are not linear in their parameters: a bounded memory, and the fit to it."""

from __future__ import annotations

import inspect
import warnings
from typing import Any, ClassVar, Self

import numpy as np

from pamid.errors import ExcitationWarning, StreamChangeWarning
from pamid.fitting.stream_memory import CHANGED, Rows, bounded, mean_square, merged, overlap, surprise, unforeseen

from ._checks import row_weights
from ._sequences import SequenceMixin
from ._trajectories import TRAJECTORY, trajectory_codes

MEMORY_ROWS = 5_000
"""Rows that a model of single rows remembers."""

GROWN = 2
"""Growth of the memory at which a model that is trained step by step starts anew instead of going on."""

MEMORY_ROWS_IN_ORDER = 20_000
"""Rows that a model of trajectories remembers: neighbours in time tell little that is new."""


ERRORS = 100
"""Batches whose errors are remembered."""


class StreamMemory:
    """A memory of the stream, for an estimator whose ``fit`` calls ``self._remember(...)``.

    A method ``_continue(rows, share)`` may train a network on from where it stands, where the new rows have that share
    of the weight of all; it starts anew each time that the memory has doubled.
    """

    __metadata_request__partial_fit: ClassVar[dict[str, bool]] = {"groups": True}

    _memory: dict[str, Any]
    _memory_rows: ClassVar[int | None] = None
    """Rows remembered, where neither of the bounds above is meant."""
    _changes: ClassVar[bool] = True
    """Whether a change of the stream is looked for."""
    _continues: ClassVar[bool] = False
    """Whether ``_continue`` trains on from where a network stands."""

    @property
    def _own(self) -> Any:
        """The estimator that this is mixed into."""
        return self

    # --- the memory ---------------------------------------------------------------------------------------------
    def _remember(self, X: Any, y: Any, sample_weight: Any = None, groups: Any = None) -> None:
        """Begin a memory with the rows of a fit."""
        rows, grouped = self._stream_rows(X, y, sample_weight, groups)
        rows = bounded(rows, self._most(), whole=self._whole(grouped), random=np.random.default_rng(0))
        self._store(rows, grouped, np.empty((0, rows.y.shape[1])))

    def _store(
        self, rows: Rows, grouped: bool, errors: np.ndarray, n_batches: int = 1, suspect: int = 0, fitted: int = 0
    ) -> None:
        counts = {"grouped": bool(grouped), "n_batches": n_batches, "suspect": suspect, "fitted": fitted or len(rows)}
        self._memory = rows.plain() | counts | {"errors": errors[-ERRORS:]}

    def _recalled(self) -> Rows:
        return Rows(*(self._memory[name] for name in ("X", "y", "weight", "unit", "regime")))

    def _partial_fit_rows(self, X: Any, y: Any, sample_weight: Any, groups: Any) -> Self:
        if not hasattr(self, "_memory"):
            given = {"sample_weight": sample_weight, "groups": groups}
            self._own.fit(X, y, **{k: v for k, v in given.items() if v is not None})
            return self
        batch, grouped = self._stream_rows(X, y, sample_weight, groups)
        if not (batch.weight > 0).any():
            return self
        held, count = self._recalled(), int(self._memory["n_batches"])
        batch = Rows(batch.X, batch.y, batch.weight, batch.unit + int(held.unit.max()) + 1, batch.regime)
        grouped = grouped or bool(self._memory["grouped"])
        whole, fitted = self._whole(grouped), int(self._memory["fitted"])
        ratio, errors = self._ratio(held, batch, grouped)
        rows, suspect = self._joined(held, batch, ratio)
        if rows.regime.max() > held.regime.max():
            errors = errors[:0]
        rows = merged(rows, whole=whole)
        nothing_new = len(rows) == len(held) and not self._weighs()
        rows = bounded(rows, self._most(), whole=whole, random=np.random.default_rng(count))
        # Rows that have faded are none to train a network on from nothing.
        counting = min(float(len(rows)), float(rows.weight.sum()))
        if nothing_new:
            pass
        elif counting < GROWN * fitted and rows.regime.max() == held.regime.max() and self._continues:
            self._continue(rows, float(batch.weight.sum() / rows.weight.sum()))
        else:
            self._refit(rows, grouped)
            fitted = len(rows)
        self._store(rows, grouped, errors, count + 1, suspect, fitted)
        return self

    def _ratio(self, held: Rows, batch: Rows, grouped: bool) -> tuple[float, np.ndarray]:
        """Return by how much a batch is off what was remembered, and the errors of batches that were not."""
        errors, suspect = self._memory["errors"], int(self._memory["suspect"])
        if not self._changes:
            return 1.0, errors
        old = held.at((held.regime == held.regime.max()) & ((held.unit < suspect) | (suspect == 0)))
        if not self._in_order():
            return surprise(old, batch, self._signal_positions()), errors
        X, y, given = self._arguments(batch, grouped)
        given.pop("sample_weight", None)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            off = np.reshape(self._own.predict(X, **given) - y, batch.y.shape)
        error = mean_square(off)
        ratio = unforeseen(errors, error) if overlap(old, batch, self._signal_positions()) else 1.0
        return ratio, (np.vstack([errors, error]) if ratio <= CHANGED else errors)

    def _joined(self, held: Rows, batch: Rows, ratio: float) -> tuple[Rows, int]:
        """Return all rows, those before a change weighed down, and from which trajectory on a change is suspected."""
        regime, suspect = int(held.regime.max()), int(self._memory["suspect"])
        batch = Rows(batch.X, batch.y, batch.weight, batch.unit, np.full(len(batch), regime))
        if (fade := self._fade(float(batch.weight.sum()))) < 1.0:
            held = Rows(held.X, held.y, fade * held.weight, held.unit, held.regime)
        both = held.followed_by(batch)
        if ratio <= CHANGED:
            return both, 0
        if not suspect:
            return both, int(batch.unit.min())
        warnings.warn(
            f"The stream has changed: at the same signals the target now differs by {ratio**0.5:.2g} times what it "
            "differed by before. Expected one muscle. What came before the change counts less from here on; check the "
            "sensors if the muscle is the same.",
            StreamChangeWarning,
            stacklevel=4,
        )
        new = (both.unit >= suspect) & (both.regime == regime)
        weight = np.where(new, both.weight, both.weight / ratio)
        rows = Rows(both.X, both.y, weight, both.unit, both.regime + new)
        return (rows if self._weighs() else rows.at(new)), 0

    def _refit(self, rows: Rows, grouped: bool) -> None:
        """Fit to what is remembered."""
        X, y, given = self._arguments(rows, grouped)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ExcitationWarning)  # told of the batch that it is true of, when it came
            self._own.fit(X, y, **given)

    def _continue(self, rows: Rows, share: float) -> None:
        """Train on from where the network stands."""
        raise NotImplementedError

    def _arguments(self, rows: Rows, grouped: bool) -> tuple[Any, Any, dict[str, Any]]:
        """Return remembered rows as ``fit`` takes them."""
        given: dict[str, Any] = {}
        if self._weighs() and not (rows.weight == 1.0).all():
            given["sample_weight"] = rows.weight
        names = getattr(self, "feature_names_in_", None)
        X: Any = rows.X
        if names is not None:
            import pandas as pd

            X = pd.DataFrame(X, columns=names)
            if TRAJECTORY in names:
                X[TRAJECTORY] = rows.unit
        if grouped and not (names is not None and TRAJECTORY in names):
            given["groups"] = rows.unit
        return X, (rows.y if self._memory_columns(rows) else rows.y[:, 0]), given

    # --- what an estimator may say of itself --------------------------------------------------------------------
    def _stream_rows(self, X: Any, y: Any, sample_weight: Any, groups: Any) -> tuple[Rows, bool]:
        """Validate a batch; say also whether its rows are distinguished by trajectories."""
        table, target = self._stream_table(X, y)
        weight = row_weights(sample_weight, table)
        codes = self._stream_codes(X, table, groups)
        unit = np.zeros(len(table), dtype=int) if codes is None else np.unique(codes, return_inverse=True)[1]
        rows = Rows(table.copy(), target.copy(), weight.copy(), unit, np.zeros(len(table), dtype=int))
        return rows, codes is not None

    def _stream_table(self, X: Any, y: Any) -> tuple[np.ndarray, np.ndarray]:
        from sklearn.utils.validation import column_or_1d

        table, y = self._own._read(X, y, reset=False)
        return table, column_or_1d(y).astype(float)[:, None]

    def _stream_codes(self, X: Any, table: np.ndarray, groups: Any) -> np.ndarray | None:
        if isinstance(self, SequenceMixin):
            return np.asarray(self._codes(X, table, groups))
        return trajectory_codes(X, groups)

    def _signal_positions(self) -> list[int]:
        """Columns of X in which neighbours are looked for: all signals but the time."""
        columns: dict[str, int] = self._own.signal_columns_
        return sorted({k for name, k in columns.items() if name != "time"}) or [0]

    def _memory_columns(self, rows: Rows) -> bool:
        """Whether the target keeps its columns."""
        return rows.y.shape[1] > 1

    def _most(self) -> int:
        return self._memory_rows or (MEMORY_ROWS_IN_ORDER if self._in_order() else MEMORY_ROWS)

    def _in_order(self) -> bool:
        """Whether the estimator needs the order of time."""
        return "one_trajectory" in self._own.get_params(deep=False)

    def _whole(self, grouped: bool) -> bool:
        """Whether the memory keeps or drops whole trajectories instead of rows."""
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

        Up to `MEMORY_ROWS` different rows, the model after any number of batches is that of one ``fit`` on all of them.
        Beyond, it is the fit to a fair sample of the stream, with the weight of all; memory does not grow. A call costs
        no more than a fit to the memory. Where two batches in a row say that the same signals now bring about something
        else, rows from before count less, by as much as they are off.

        Parameters
        ----------
        X : DataFrame or array_like, shape (n_samples, n_columns)
            What ``fit`` takes, SI units.
        y : array_like
            Target, as in ``fit``.
        sample_weight : array_like, shape (n_samples,), optional
            Weights; a weight of 2 is the same row twice.
        groups : array_like, shape (n_samples,), optional
            Trajectory of each row, as in ``fit``; no trajectory goes on from one call to the next.

        Returns
        -------
        self
            The fitted estimator.

        Warns
        -----
        StreamChangeWarning
            If the stream has changed.
        """
        return self._partial_fit_rows(X, y, sample_weight, groups)


class SequenceStreaming(StreamMemory):
    """The same for an estimator whose ``fit`` takes no weights."""

    def partial_fit(self, X: Any, y: Any, groups: Any = None) -> Self:
        """Take in further trajectories: the fit of all so far, as long as the memory holds them.

        Up to `MEMORY_ROWS_IN_ORDER` rows, the model after any number of batches is that of one ``fit`` on all their
        trajectories; one that came before adds nothing. Beyond, it is the fit to a fair sample of whole trajectories;
        memory does not grow. A call costs no more than a fit to the memory. Where two batches in a row say that the
        same signals now bring about something else, trajectories from before are dropped.

        Parameters
        ----------
        X : DataFrame or array_like, shape (n_samples, n_columns)
            What ``fit`` takes, SI units, in time order within each trajectory.
        y : array_like
            Target, as in ``fit``.
        groups : array_like, shape (n_samples,), optional
            Trajectory of each row, as in ``fit``; no trajectory goes on from one call to the next.

        Returns
        -------
        self
            The fitted estimator.

        Warns
        -----
        StreamChangeWarning
            If the stream has changed.
        """
        return self._partial_fit_rows(X, y, None, groups)


def forget(model: Any) -> Any:
    """Drop the memory of a model inside another one, which has its own."""
    if isinstance(model, StreamMemory) and "_memory" in vars(model):
        del model._memory
    return model
