"""Whether a source helps at all, and how much of it an adaptation keeps: measured on runs left out."""

import warnings
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from pamid.adapters.source_process import ROWS, SourceProcess, SourceRows
from pamid.errors import AdaptationWarning, ExtrapolationWarning, ParameterError
from pamid.signals.state import State

from ._base import state_of
from ._hybrid_fit import FitSamples
from ._hybrid_use import predicted
from ._pihm import HybridModel
from ._source import hybrid_of

FEW = 10
"""Samples below which there is nothing to hold out."""

WIDTH = 0.5
"""Standard deviation of the fresh fit's weight under its prior about 0: half of all it can be."""

BLOCKS = 5
"""Stretches that a run is cut into where there are too few to leave out whole ones."""

FEW_TRAJECTORIES = 4
"""Number of runs below which neither the pull nor the share of the source is measured on whole runs."""


class _Outcome(NamedTuple):
    """What was measured for one target."""

    weight: float
    process: SourceProcess | None
    kept: float
    errors: dict[str, float]


class Blending:
    """Weigh the adapted model against a fresh fit of the same samples; mixed into the adapters."""

    blend: bool | str = False
    source: Any
    model_: HybridModel
    weight_decay_: float
    _target: Callable[[HybridModel], HybridModel]
    _trainer_as_given: Callable[[], Any]
    blend_: np.ndarray
    processes_: list[SourceProcess | None]
    source_kept_: np.ndarray
    held_out_errors_: list[dict[str, float]]

    def _blends(self) -> bool:
        if not isinstance(self.blend, bool) and self.blend != "auto":
            raise ParameterError(f"blend={self.blend!r}.", "'auto', True or False", "Correct it.")
        from pamid.training import LevenbergMarquardt

        # The published algorithm stays as published unless asked.
        return bool(self.blend) if self.blend != "auto" else isinstance(self._trainer_as_given(), LevenbergMarquardt)

    def _weigh(self, model: HybridModel, samples: FitSamples, linear: tuple[Any, Any, Any]) -> None:
        """Measure for each target the held-out error of the adapted model, of a fresh fit and of both."""
        laws, (table, Y, weight, codes) = model.laws(), samples
        self.blend_, self.source_kept_ = np.zeros(len(laws)), np.ones(len(laws))
        self.processes_, self.held_out_errors_ = [None] * len(laws), [{} for _ in laws]
        if not self._blends():
            return
        said = self._from_source(table)
        state = state_of(model, table)
        offset, counted = 0, np.isfinite(Y) & (weight > 0)[:, None]
        for k in range(len(laws)):
            rows = np.flatnonzero(counted[:, k])
            some = np.unique(np.linspace(0, len(rows) - 1, min(len(rows), ROWS)).round().astype(int))
            place, offset, rows = offset + some, offset + len(rows), rows[some]
            if len(rows) < FEW:
                continue
            blocks = _blocks(None if codes is None else codes[rows], len(rows))
            left = self._left_by_adapted(model, linear, place, blocks)
            adapted = Y[rows, k] + model.target_scale_[k] * left
            read = _rows(state, said[:, k], laws[k]).at(rows)
            found = _outcome(read, Y[rows, k], weight[rows], blocks, adapted)
            self.blend_[k], self.processes_[k], self.source_kept_[k], self.held_out_errors_[k] = found
            self._warn_of_hindrance(found, laws[k])

    def _left_by_adapted(self, model: HybridModel, linear: Any, place: np.ndarray, blocks: np.ndarray) -> np.ndarray:
        import torch

        from pamid.training.prior import held_out_residuals

        problem, bound, psi = linear
        some = problem.rows(torch.as_tensor(place, device=problem.y.device))
        return held_out_residuals(some, psi, model.activation, bound, blocks, self.weight_decay_)

    def _warn_of_hindrance(self, found: _Outcome, law: Any) -> None:
        errors = found.errors
        if errors["fresh"] >= errors["adapted"] or not found.weight:
            return
        warnings.warn(
            f"For {law.target} the source does not help: on held-out samples the adapted model's error is "
            f"{errors['adapted']:.3g} {law.unit}, that of a fit without the source {errors['fresh']:.3g} {law.unit}. "
            f"Expected a smaller error with a source. Predictions keep {found.kept:.0%} of it; volumes are those of "
            "the adapted model. Use a source more like the target, or blend=False to keep all of it.",
            AdaptationWarning,
            stacklevel=7,
        )

    def _from_source(self, table: np.ndarray) -> np.ndarray:
        """Return the source's own prediction for the target's signals, shape (n_samples, n_laws)."""
        source = self._target(hybrid_of(self.source, type(self).__name__))
        with warnings.catch_warnings():
            # An adaptation is meant for muscles that move elsewhere.
            warnings.simplefilter("ignore", ExtrapolationWarning)
            return predicted(source, table)

    def _outputs(self, table: np.ndarray) -> np.ndarray:
        """Return the adapted model's predictions with the fresh fit's share in them, shape (n_samples, n_laws)."""
        out = predicted(self.model_, table)
        weights = getattr(self, "blend_", np.zeros(out.shape[1]))  # none in files of an earlier version
        if not weights.any():
            return out
        said, state = self._from_source(table), state_of(self.model_, table)
        for k, law in enumerate(self.model_.laws()):
            process = self.processes_[k]
            if process is not None and weights[k]:
                rows = _rows(state, said[:, k], law)
                # Outside its samples a fresh fit has no information, the adapted model has its law and its source.
                out[:, k] += weights[k] * process.known(rows) * (process.predict(rows) - out[:, k])
        return out


def _rows(state: State, said: np.ndarray, law: Any) -> SourceRows:
    c = law.coefficients(state)
    factors = [np.broadcast_to(np.asarray(v, dtype=float), said.shape) for v in (c.V, c.V_eps, c.V_P)]
    present = [v for v in factors if np.any(v)]
    return SourceRows(
        said,
        np.column_stack([state.eps, state.P]),
        np.column_stack(present) if present else np.empty((len(said), 0)),
        np.column_stack([state.deps, state.dP]),
    )


def _blocks(codes: np.ndarray | None, n: int) -> np.ndarray:
    """Return which of n samples are held out together: whole runs, or stretches where there are few."""
    trajectory = np.zeros(n, dtype=int) if codes is None else np.unique(codes, return_inverse=True)[1]
    count = int(trajectory.max()) + 1
    if count >= FEW_TRAJECTORIES:
        return np.asarray(trajectory)
    blocks = np.empty(n, dtype=int)
    for k in range(count):
        own = np.flatnonzero(trajectory == k)
        blocks[own] = BLOCKS * k + np.arange(len(own)) * BLOCKS // len(own)
    return np.unique(blocks, return_inverse=True)[1]


def _outcome(rows: SourceRows, y: np.ndarray, weight: np.ndarray, blocks: np.ndarray, adapted: np.ndarray) -> _Outcome:
    """Weigh the adapted model's held-out predictions against those of fresh fits without and with the source."""
    errors, fits = {"adapted": _error(y - adapted, weight)}, {}
    for name, keep in (("fresh", False), ("both", True)):
        fits[name] = SourceProcess.fit(rows, y, weight, blocks, keep=keep)
        errors[name] = _error(y - fits[name][1], weight)
        if errors["fresh"] >= errors["adapted"]:  # the source helps: nothing more is needed
            return _Outcome(0.0, None, 1.0, errors)
    process, held_out = fits[min(fits, key=lambda name: errors[name])]
    share = share_of_fresh(held_out - adapted, y - adapted, weight, blocks)
    whole = process.predict(rows)
    part = float(np.clip((process.from_source(rows) @ whole) / (whole @ whole), 0.0, 1.0)) if whole.any() else 0.0
    return _Outcome(share, process, 1.0 - share * (1.0 - part), errors)


def share_of_fresh(change: np.ndarray, left: np.ndarray, weight: np.ndarray, blocks: np.ndarray) -> float:
    """Return the least-squares weight of the fresh fit, shrunk to 0 by its variance over blocks of samples."""
    size = float(weight @ change**2)
    if size <= 0.0:
        return 0.0
    share = float(weight @ (change * left)) / size
    score = np.bincount(blocks, weights=weight * change * (left - share * change))
    variance = float(score @ score) / size**2 * len(score) / max(len(score) - 1, 1)
    return float(np.clip(share * WIDTH**2 / (WIDTH**2 + variance), 0.0, 1.0))


def _error(residual: np.ndarray, weight: np.ndarray) -> float:
    return float(np.sqrt(np.average(residual**2, weights=weight)))
