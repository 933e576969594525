"""Run every estimator of one equation over folds of whole runs, and score all on the same rows."""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd

from ..errors import FitError, IncompatibleError, InterruptedFitWarning, PamidError, ParameterError
from ..explained import explained_by
from ..requirements import is_sequential, parameter_count, reads_of
from ..signals.thinning import spaced
from .bootstrap import ClusterBootstrap
from .comparison import BASELINE, Comparison, Score, ranked
from .entries import EQUATIONS, SIGNALS, CandidateModel, candidates, target_of
from .floor import noise_floor
from .protocol import Fold, Prepared, folds, prepare

FLOOR_ROWS = 2000
"""Rows at which the sensitivities for the noise floor are taken."""


@explained_by(prepare, candidates)
def compare(
    table: pd.DataFrame,
    equation: str = "force",
    estimators: str | Sequence[str] | Mapping[str, Any] = "all",
    *,
    cv: Any = 5,
    split: str = "run",
    rows: Any = None,
    fit_rows: int = 5000,
    score_rows: int = 50_000,
    parameters: Mapping[str, Any] | None = None,
    tuning: str | float | Sequence[float] = "auto",
    method: str = "savgol",
    smooth_target: bool | None = None,
    window: float | str = "auto",
    n_draws: int = 2000,
    random_state: int = 0,
    progress: Callable[[str], None] | None = None,
    output: str = "eps",
    n_jobs: int | None = None,
) -> Comparison:
    """Compare estimators on unseen runs.

    Rates are taken run by run before anything is split. Each fold holds out whole runs (both muscles of a run
    together); estimators without memory are fitted on evenly thinned rows of the others, those that learn sequences
    on the evenly spaced rows of whole runs. All are scored on the same rows.

    Parameters
    ----------
    table : DataFrame
        One row per muscle and sample: ``trajectory``, ``time`` (s), ``eps``, ``P`` (Pa, absolute), ``F`` (N) and/or
        ``mdot`` (kg/s), and ``run`` where both muscles of a run are listed: what `pamid.bench.unfold` returns.
    equation : {"force", "flow", "inverse", "dynamic"}, default="force"
        What is predicted: a force (N), a mass flow (kg/s), the pressure (Pa) for a force and a contraction, or an
        output in free run from its first value.
    cv : int or splitter, default=5
        Folds of whole runs.
    split : {"run", "kind"}, default="run"
        ``"kind"`` leaves out whole kinds of runs (the first part of their names) in turn.
    fit_rows : int, default=5000
        Maximum number of rows of a fit.
    n_draws : int, default=2000
        Draws of the bootstrap over runs.
    random_state : int, default=0
        Seed of folds, estimators and draws.
    progress : callable, optional
        Called with a label after each fit.
    output : {"eps", "P"}, default="eps"
        Output of the dynamic problem: the contraction under pressure and ``load`` (kg), or the pressure (Pa) under the
        valve command ``u`` and the contraction.
    n_jobs : int, optional
        Fits that run at once, as in scikit-learn: one by default, or as joblib's backend has it, see
        `pamid.distributed.on_dask`. Predictions do not depend on it; times do, where fits share cores.

    Returns
    -------
    Comparison
        The table, the held-out predictions, and what was done to the data.

    Raises
    ------
    TooFewTrajectoriesError
        If the table has fewer than two runs.
    FitError
        If every estimator failed.

    Examples
    --------
    >>> from pamid.bench import BenchParameters, simulate, sine, unfold
    >>> from pamid.compare import compare
    >>> bench = BenchParameters.for_muscle("B")
    >>> log = simulate(bench, [sine(frequency, 10.0, 400) for frequency in (2.0, 4.0, 8.0)])
    >>> result = compare(unfold(log, bench), "force", ["PolynomialForce", "GeometricForce(chou_hannaford)"], cv=3)
    >>> result.best.estimator
    'GeometricForce(chou_hannaford)'
    """
    for name, number in (("fit_rows", fit_rows), ("score_rows", score_rows), ("n_draws", n_draws)):
        if isinstance(number, bool) or not isinstance(number, int | np.integer) or number < 1:
            raise ParameterError(f"{name} is {number!r}.", "a whole number of at least 1", "Correct it.")
    column, unit = target_of(equation, output)
    ready = prepare(
        table,
        equation,
        rows=rows,
        score_rows=score_rows,
        tuning=tuning,
        method=method,
        smooth_target=smooth_target,
        window=window,
        output=output,
    )
    entries = candidates(
        equation,
        estimators,
        parameters=parameters,
        targets=(column, *ready.measured),
        random_state=random_state,
        output=output,
    )
    result = score_candidates(
        entries,
        ready,
        list(folds(ready, cv, split=split, fit_rows=fit_rows, random_state=random_state)),
        unit,
        n_draws=n_draws,
        random_state=random_state,
        progress=progress,
        n_jobs=n_jobs,
    )
    if equation in EQUATIONS:
        result.noise_floor = _floor(ready, table, result.scores, result.fitted, result.rows.index.to_numpy(), method)
    result.rows = result.rows.reset_index(drop=True)
    return result


def score_candidates(
    entries: Sequence[CandidateModel],
    ready: Prepared,
    splits: list[Fold],
    unit: str,
    *,
    n_draws: int = 2000,
    random_state: int = 0,
    progress: Callable[[str], None] | None = None,
    n_jobs: int | None = None,
) -> Comparison:
    """Fit candidates in every fold, predict the runs left out, and rank them."""
    scored = np.concatenate([fold.score_rows for fold in splits])
    order = np.argsort(scored, kind="stable")
    scored = scored[order]
    y = ready.table[ready.target].to_numpy(dtype=float)[scored]
    predictions: dict[str, np.ndarray] = {}
    scores: dict[str, Score] = {}
    fitted: dict[str, Any] = {}
    predictions[BASELINE], scores[BASELINE] = _baseline(ready, splits, order)
    done = _run(entries, ready, splits, n_jobs, progress)
    for entry in entries:
        score, predicted, model = _scored(entry, done[entry.label])
        scores[entry.label] = score
        if predicted is not None:
            predictions[entry.label] = predicted[order]
            fitted[entry.label] = model
    if not fitted:
        raise FitError(
            f"Every estimator failed; the first: {scores[entries[0].label].error if entries else 'there was none'}",
            "at least one that can be fitted",
            "Look at the log, or choose other estimators.",
        )
    runs = ready.runs[scored]
    names, clusters = np.unique(runs.astype(str), return_inverse=True)
    draws = ClusterBootstrap(clusters, n_draws, random_state=random_state)
    _judge(scores, predictions, y, draws)
    signals = [name for name in SIGNALS if name in ready.table.columns]
    kept = ready.table[["trajectory", "run", "time", *signals]].iloc[scored]
    if any(entry.sequential for entry in entries):
        ready.notes.append(
            "What learns sequences is fitted on all evenly spaced rows, at the spacing of the scored ones."
        )
    return Comparison(
        ready.equation,
        unit,
        ranked(scores),
        kept.assign(measured=y),
        predictions,
        fitted,
        float("nan"),
        len(splits),
        len(names),
        ready.notes,
    )


def _run(
    entries: Sequence[CandidateModel],
    ready: Prepared,
    splits: list[Fold],
    n_jobs: int | None,
    progress: Callable[[str], None] | None,
) -> dict[str, list[_Fitted]]:
    """Fit and predict every candidate in every fold; after one that failed its other folds are left out."""
    from joblib import Parallel, delayed

    done: dict[str, list[_Fitted]] = {entry.label: [] for entry in entries}
    if (expect := getattr(progress, "expect", None)) is not None:
        expect(len(entries) * len(splits))
    # Asked for as they are started, so that alone, one after the other, nothing is fitted in vain. Fold after fold:
    # once all candidates were fitted in one, the time that the others take is known.
    wanted = (
        (entry, fold) for fold in splits for entry in entries if not (done[entry.label] and done[entry.label][-1].error)
    )
    tasks = (
        delayed(_fitted)(
            entry,
            ready.table,
            ready.runs,
            ready.usable,
            ready.target,
            fold.even_train if entry.sequential else fold.fit_rows,
            fold.even_test if entry.sequential else fold.score_rows,
            fold.score_rows,
        )
        for entry, fold in wanted
    )
    for label, fitted in Parallel(n_jobs=n_jobs, return_as="generator")(tasks):
        done[label].append(fitted)
        if progress is not None:
            progress(label)
    return done


@dataclass(frozen=True)
class _Fitted:
    """One candidate in one fold."""

    predicted: np.ndarray | None = None
    model: Any = None
    fit_seconds: float = 0.0
    predict_seconds: float = 0.0
    n_predicted: int = 0
    n_fit_rows: int = 0
    warnings: tuple[str, ...] = ()
    error: str = ""


@contextmanager
def whole_fits() -> Iterator[None]:
    """End on Ctrl-C where a fit alone would end and keep what it reached: that is no score on unseen runs."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", InterruptedFitWarning)
            yield
    except InterruptedFitWarning:
        raise KeyboardInterrupt from None


def _fitted(
    entry: CandidateModel,
    table: pd.DataFrame,
    runs: np.ndarray,
    usable: np.ndarray,
    target: str,
    fit_rows: np.ndarray,
    test_rows: np.ndarray,
    score_rows: np.ndarray,
) -> tuple[str, _Fitted]:
    """Fit and predict one candidate in one fold."""
    from sklearn.base import clone
    from sklearn.utils.validation import has_fit_parameter

    place = entry.targets.index(target) if target in entry.targets else 0
    X = table[list(entry.columns)]
    Y = table[list(entry.targets)].to_numpy(dtype=float)
    y = Y[:, 0] if len(entry.targets) == 1 else Y
    try:
        with whole_fits(), warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            warnings.simplefilter("error", InterruptedFitWarning)
            model = clone(entry.estimator)
            started = time.perf_counter()
            more = {"groups": runs[fit_rows]} if has_fit_parameter(model, "groups") else {}
            # a sequence has rows that do not count between those that do: they are seen, not learnt
            if not usable[fit_rows].all() and has_fit_parameter(model, "sample_weight"):
                more["sample_weight"] = usable[fit_rows].astype(float)
            model.fit(X.iloc[fit_rows], y[fit_rows], **more)
            middle = time.perf_counter()
            z = np.asarray(model.predict(X.iloc[test_rows]), dtype=float)
            ended = time.perf_counter()
        z = _checked(z, len(test_rows), place, entry.label)
    except Exception as reason:  # one estimator that fails is a line in the table, not the end of it
        return entry.label, _Fitted(error=_one_line(reason))
    return entry.label, _Fitted(
        z[np.searchsorted(test_rows, score_rows)] if entry.sequential else z,
        model,
        middle - started,
        ended - middle,
        len(test_rows),
        len(fit_rows),
        tuple(dict.fromkeys(_one_line(w.message) for w in caught if issubclass(w.category, UserWarning))),
    )


def _scored(entry: CandidateModel, folds_: list[_Fitted]) -> tuple[Score, np.ndarray | None, Any]:
    """Put the folds of one candidate together."""
    said = tuple(dict.fromkeys(text for f in folds_ for text in f.warnings))
    error = next((f.error for f in folds_ if f.error), "")
    if error:
        return Score(entry.label, error=error, warnings=said), None, None
    known = [c for c in (parameter_count(f.model) for f in folds_) if c is not None]
    score = Score(
        entry.label,
        fit_seconds=sum(f.fit_seconds for f in folds_) / len(folds_),
        predict_ms_per_1000=1e6 * sum(f.predict_seconds for f in folds_) / sum(f.n_predicted for f in folds_),
        n_parameters=round(float(np.mean(known))) if known else None,
        n_fit_rows=max(f.n_fit_rows for f in folds_),
        warnings=said,
    )
    return score, np.concatenate([f.predicted for f in folds_ if f.predicted is not None]), folds_[0].model


def _checked(z: np.ndarray, n: int, place: int, label: str) -> np.ndarray:
    if z.ndim == 2:
        z = z[:, place]
    if z.shape != (n,):
        raise IncompatibleError(f"{label} predicts the shape {z.shape} for {n} rows.", f"({n},)", "Correct it.")
    if not np.isfinite(z).all():
        raise FitError(
            f"{label} predicts {int((~np.isfinite(z)).sum())} values that are not finite.", "finite ones", ""
        )
    return z


def _one_line(reason: Any) -> str:
    text = " ".join(str(reason).split())[:240]
    if isinstance(reason, PamidError | Warning):
        return text
    return f"{type(reason).__name__}: {text}"


def _baseline(ready: Prepared, splits: list[Fold], order: np.ndarray) -> tuple[np.ndarray, Score]:
    y = ready.table[ready.target].to_numpy(dtype=float)
    means = [np.full(len(f.score_rows), y[f.fit_rows].mean()) for f in splits]
    score = Score(
        BASELINE,
        fit_seconds=0.0,
        predict_ms_per_1000=0.0,
        n_parameters=1,
        n_fit_rows=max(len(f.fit_rows) for f in splits),
    )
    return np.concatenate(means)[order], score


def _judge(
    scores: dict[str, Score], predictions: Mapping[str, np.ndarray], y: np.ndarray, draws: ClusterBootstrap
) -> None:
    """Fill in errors, intervals and differences to the best."""
    squares = {label: (z - y) ** 2 for label, z in predictions.items()}
    best = min(squares, key=lambda label: float(squares[label].mean()))
    spread = float(np.std(y))
    for label, square in squares.items():
        rmse = draws.rmse(square)
        behind = draws.difference(square, squares[best])
        scores[label] = replace(
            scores[label],
            rmse=rmse.value,
            rmse_low=rmse.low,
            rmse_high=rmse.high,
            nrmse=rmse.value / spread if spread > 0 else float("nan"),
            behind=behind.value if label != best else 0.0,
            behind_low=behind.low,
            behind_high=behind.high,
            differs=label != best and (behind.low > 0 or behind.high < 0),
        )


def _floor(
    ready: Prepared,
    table: pd.DataFrame,
    ranking: list[Score],
    fitted: Mapping[str, Any],
    scored: np.ndarray,
    method: str,
) -> float:
    """Take the noise floor with the sensitivities of the best model that reads single rows."""
    rows = scored[spaced(len(scored), FLOOR_ROWS)]
    target = table[ready.target].to_numpy(dtype=float)
    for score in ranking:
        model = fitted.get(score.estimator)
        if model is None or is_sequential(model) or getattr(model, "joint", False):
            continue
        columns = list(reads_of(model, SIGNALS))

        def predict(x: np.ndarray, model: Any = model, columns: list[str] = columns) -> np.ndarray:
            return np.asarray(model.predict(pd.DataFrame(x, columns=list(SIGNALS))[columns]), dtype=float)

        try:
            return noise_floor(ready, predict, rows, target, method)
        except PamidError:
            return float("nan")
    return float("nan")
