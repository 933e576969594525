"""What commands about a fitted model share: rates before it, runs left out, causes as effects, what a fit found."""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import ParameterError, TooFewTrajectoriesError
from ..requirements import WithBounds, WithLaws
from ._progress import Silent
from ._tables import RATES, Target, needed_signals, predict_table
from .common import note, number, table

if TYPE_CHECKING:
    import numpy as np
    import pandas as pd

Causes = list[tuple[list[str], list[dict[str, float]]]]
"""Names of the effects of each class, and the parameters of each of them."""


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
            "Add a log, or pass --folds 0 to skip this check.",
        )
    folds = min(args.folds, n_runs)
    if folds < args.folds:
        note(args, f"{n_runs} runs allow only {folds} folds")
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


# --- causes of a diagnosis as effects ------------------------------------------------------------------------
def read_causes(folder: str) -> Causes:
    """Read the causes of the ``diagnosis.json`` in a folder."""
    path = Path(folder) / "diagnosis.json"
    try:
        causes = json.loads(path.read_text(encoding="utf-8"))["causes"]
        return [
            (
                [str(name) for name in cause["effects"]],
                [
                    {k: float(v["value"]) for k, v in found.items()}
                    for found in (cause["parameters"], *cause.get("others", ()))
                ],
            )
            for cause in causes
        ]
    except OSError as error:
        raise ParameterError(
            f"{path} cannot be read: {error.strerror}.",
            "the folder that 'pamid diagnose LOG --sim SIM.toml --out DIR' has written",
            "Correct --diagnosis.",
        ) from None
    except (ValueError, KeyError, TypeError, AttributeError):
        raise ParameterError(
            f"{path} holds no causes in pamid's format.", "a file of 'pamid diagnose'", "Diagnose the log again."
        ) from None


def hybrid_for(equation: str | None) -> str:
    """Return the hybrid model that holds such causes."""
    return "ThermodynamicPIHM" if equation == "flow" else "StaticPIHM"


def hold_causes(estimator: Any, causes: Causes, args: argparse.Namespace) -> None:
    """Give the causes to an estimator as its effects, and say which it cannot hold."""
    from ..effects._terms import of_causes

    equations = {law.equation for law in estimator.laws()} if isinstance(estimator, WithLaws) else set()
    if "effects" not in estimator.get_params() or not equations:
        raise ParameterError(
            f"--diagnosis is given, but {args.estimator} takes no effects.",
            "a hybrid model: StaticPIHM, ThermodynamicPIHM",
            "Leave --estimator out, or name one of them.",
        )
    held, left = of_causes(causes, equations)
    estimator.set_params(effects={e.name: dict(e.values) for e in held} or None)
    if left:
        note(args, f"{args.estimator} cannot include {', '.join(left)}: its network fits all that depends on the state")
    if not held:
        note(args, "no cause of the diagnosis acts in this equation; the model is fitted without effects")


# --- what a fit found ---------------------------------------------------------------------------------------
def fitted_parameters(model: Any) -> dict[str, dict[str, Any]]:
    """Return value, unit, error, bounds and flags of each fitted parameter by name; empty without physical meaning."""
    values = getattr(model, "parameters_", None) or getattr(model, "coefficients_", None) or {}
    if any(isinstance(value, dict) for value in values.values()):
        return {}
    errors, units = getattr(model, "standard_errors_", {}), getattr(model, "units_", {})
    inner = model if isinstance(model, WithBounds) else getattr(model, "model_", model)
    bounds = inner.parameter_bounds() if isinstance(inner, WithBounds) else {}
    names = getattr(inner, "fitted_names_", list(values))
    held = set(getattr(inner, "at_bound_", ()))
    return {
        name: {
            "value": float(value),
            "unit": units.get(name),
            "standard_error": _finite(errors.get(name)) if name in names else None,
            "lower": _finite(bounds.get(name, (None, None))[0]),
            "upper": _finite(bounds.get(name, (None, None))[1]),
            "fitted": name in names,
            "at_bound": name in held,
        }
        for name, value in values.items()
    }


def _finite(value: float | None) -> float | None:
    return float(value) if value is not None and math.isfinite(value) else None


def parameter_lines(parameters: dict[str, dict[str, Any]]) -> str:
    """Return a table of the parameters."""
    rows = []
    for name, p in parameters.items():
        if not p["fitted"]:
            said = "held"
        elif p["at_bound"]:
            said = "at its bound"
        else:
            said = "" if p["standard_error"] is not None else "no standard error: the data do not determine it"
        error = "" if p["standard_error"] is None else number(p["standard_error"])
        low = "-inf" if p["lower"] is None else number(p["lower"])
        high = "inf" if p["upper"] is None else number(p["upper"])
        rows.append([name, number(p["value"]), error, p["unit"] or "", f"{low} to {high}", said])
    return table(["parameter", "value", "std. error", "unit", "bounds", ""], rows)
