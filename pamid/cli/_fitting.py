"""What commands that fit a model share: rates before it, the check on runs left out, the pipeline that is saved."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from ..errors import TooFewTrajectoriesError
from ._progress import Silent
from ._tables import RATES, Target, needed_signals, predict_table
from .common import note

if TYPE_CHECKING:
    import numpy as np
    import pandas as pd


def with_rates(signals: pd.DataFrame, estimator: Any, target: Target) -> tuple[list[tuple[str, Any]], pd.DataFrame]:
    """Return the steps before the estimator, fitted, and the table with the rates that the estimator needs."""
    missing = [r for r in RATES if r in needed_signals(estimator) and r not in signals.columns]
    if not missing:
        return [], signals
    from pamid.estimators import RateTransformer

    moving = target.signals if target.signals == ("eps", "P") else tuple(dict.fromkeys(RATES[r] for r in missing))
    base = signals[["trajectory", "time", *target.signals]]
    rates = RateTransformer(columns=moving, second="ddq" in missing).fit(base)
    found = rates.transform(base)
    return [("rates", rates)], found


def held_out(
    args: argparse.Namespace,
    fitted: Callable[[pd.DataFrame, pd.Series], Any],
    X: pd.DataFrame,
    y: pd.Series,
    runs: pd.Series,
    step: Silent,
    every: int = 1,
) -> np.ndarray:
    """Predict each run by a model of the others; the fit to all runs is expected to follow."""
    import numpy as np
    from sklearn.model_selection import GroupKFold

    from ..compare.run import whole_fits

    groups = runs.to_numpy()
    n_runs = len(np.unique(groups.astype(str)))
    if n_runs < 2:
        raise TooFewTrajectoriesError(
            f"The log has {n_runs} run.",
            "at least 2, to score the model on unseen runs",
            "Add a log, or pass --folds 0 to go without the check.",
        )
    folds = min(args.folds, n_runs)
    if folds < args.folds:
        note(args, f"{n_runs} runs allow {folds} folds only")
    predicted = np.full(len(X), np.nan)
    step.expect(folds + 1)
    split = GroupKFold(folds, shuffle=True, random_state=args.seed).split(X, y, groups)
    for k, (train, test) in enumerate(split, 1):
        rows = train[::every]
        with whole_fits():
            model = fitted(X.iloc[rows], y.iloc[rows])
        predicted[test] = predict_table(model, X.iloc[test])
        step(f"held-out fold {k} of {folds}")
    return predicted


def pipeline(steps: list[tuple[str, Any]], fitted: Any) -> Any:
    """Return the pipeline of the fitted steps; those before the estimator were fitted on the same log."""
    if not steps:
        return fitted
    from sklearn.pipeline import Pipeline

    return Pipeline([*steps, ("model", fitted)])
