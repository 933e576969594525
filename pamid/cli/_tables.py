"""From a log to the table that an estimator reads, its target, and scores by run."""

from __future__ import annotations

import argparse
import inspect
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

from ..errors import (
    IncompatibleError,
    MissingColumnError,
    MissingParameterError,
    ModelFileError,
    PamidError,
    ParameterError,
    UnknownOptionError,
    among,
)
from ..requirements import WithLaws, last_step, reads_of
from ..signals.unit_names import parse_quantity
from .common import page_numbers, page_of

if TYPE_CHECKING:
    import numpy as np
    import pandas as pd

RATES = {"deps": "eps", "dP": "P", "dx": "x", "dq": "q", "ddq": "q"}
"""Rates that estimators read, and the signals that they are taken of."""


class Target(NamedTuple):
    """What is predicted: its name, the column that holds it, its unit, the kinds of pages and signals it belongs to."""

    name: str
    column: str
    unit: str
    kinds: tuple[str, ...] = ("muscle", "bench")
    signals: tuple[str, ...] = ("eps", "P")


TARGETS = {
    "force": Target("force", "F", "N"),
    "flow": Target("flow", "mdot", "kg/s"),
    "cylinder": Target("cylinder", "F", "N", ("cylinder",), ("x", "P")),
    "drive": Target("drive", "drive", "drive", ("joint",), ("q",)),
}


def equation_of(estimator: Any, wanted: str | None) -> Target:
    """Return the target of an estimator: its own, or the caller's."""
    last = last_step(estimator)
    own = _own_equations(last)
    if len(own) > 1:
        raise IncompatibleError(
            f"{type(last).__name__} predicts {' and '.join(own)} together.",
            "an estimator of one equation",
            "Fit it in Python, or choose another estimator here.",
        )
    if wanted is not None and own and wanted not in own:
        raise IncompatibleError(
            f"{type(last).__name__} predicts {' and '.join(own)}.",
            f"an estimator of {wanted}",
            f"Use --equation {own[0]}, or another estimator.",
        )
    name = wanted or (own[0] if len(own) == 1 else None)
    if name is None:
        raise ParameterError(
            f"{type(last).__name__} can predict either equation.", "force or flow", "Add --equation force or flow."
        )
    target = TARGETS[name]
    return target._replace(unit=last.unit) if target.name == "drive" else target


def _own_equations(estimator: Any) -> list[str]:
    if isinstance(estimator, WithLaws):
        return [law.equation for law in estimator.laws()]
    said = [name for name in getattr(estimator, "equations", ()) if name in TARGETS]
    return said if len(said) == 1 else []


def signal_table(log: pd.DataFrame, page: Any, target: Target) -> pd.DataFrame:
    """Return one row per muscle and sample with ``trajectory``, ``run``, ``time``, ``eps``, ``P`` and the target."""
    if target.signals != ("eps", "P"):
        return _table_of_system(log, page, target)
    columns = list(map(str, log.columns))
    if "eps" in columns and "P" in columns:
        table = log.assign(run=log["trajectory"])
    elif page is None or page.kind != "bench":
        raise MissingColumnError(
            f"The log has no column eps (it has {', '.join(columns[:20])}).",
            "eps and P of one muscle, or q, P1, P2 and a simulator from which eps follows",
            "Add --sim SIM.toml, or map your columns with --columns.",
        )
    else:
        from ..bench.kinematics import unfold

        table = unfold(log, page)
    if target.column not in table.columns:
        raise MissingColumnError(
            f"The log has no {target.column} (it has {', '.join(columns[:20])}).",
            f"measured {target.name} as {target.column}, or {target.column}1 and {target.column}2, in {target.unit}",
            "Choose the other equation, or map your columns with --columns.",
        )
    return table


def _table_of_system(log: pd.DataFrame, page: Any, target: Target) -> pd.DataFrame:
    table = log if page is None else page.samples(log)
    if lacking := [name for name in (*target.signals, target.column) if name not in table.columns]:
        raise MissingColumnError(
            f"The log has no {', '.join(lacking)} (it has {', '.join(map(str, log.columns[:20]))}).",
            f"{', '.join((*target.signals, target.column))} of a {target.kinds[0]}",
            f"Map your columns with --columns, or give the simulator file of the {target.kinds[0]} with --sim.",
        )
    return table.assign(run=table["trajectory"])


def settle(estimator: Any, speed: Any, unit: str, given: dict[str, Any]) -> None:
    """Set parameters of an estimator from the log unless given: unit of a drive, friction's fading speed."""
    import numpy as np

    accepted = estimator.get_params()
    if "unit" in accepted and "unit" not in given and unit:
        estimator.set_params(unit=unit)
    if "still" in accepted and "still" not in given and speed is not None:
        quick = float(np.quantile(np.abs(speed), 0.99))
        estimator.set_params(still=_STILL * quick if quick > 0 else accepted["still"])


_STILL = 0.05
"""Of the quickest speed: where the sign of the motion counts by three quarters."""
SIZES = ("rest_length", "rest_diameter")
"""What no estimator may take by default: the size of the muscle."""


def make_estimator(
    name: str, settings: dict[str, Any], seed: int | None, numbers_for: Callable[[tuple[str, ...]], dict[str, Any]]
) -> Any:
    """Make an estimator by its name: settings as given, numbers of pages of its kinds, seed where it takes one."""
    from pamid.estimators import all_estimators

    # Others predict rates of states, pressures or several outputs, and not a force or a flow.
    known = {n: c for n, c in all_estimators() if set(getattr(c, "equations", ())) & set(TARGETS)}
    name, settings = _setting_of(name, settings, known)
    if name not in known:
        raise UnknownOptionError(f"There is no estimator {name!r}.", *among(name, known))
    accepted = [p for p in inspect.signature(known[name]).parameters if p not in ("args", "kwargs")]
    if unknown := sorted(set(settings) - set(accepted)):
        raise UnknownOptionError(f"{name} has no parameter {', '.join(unknown)}.", *among(unknown[0], accepted))
    settings = {k: parse_quantity(v, k) if k in SIZES and isinstance(v, str) else v for k, v in settings.items()}
    kinds = dict.fromkeys(k for e in getattr(known[name], "equations", ()) if e in TARGETS for k in TARGETS[e].kinds)
    values = {"random_state": seed, **{k: v for k, v in numbers_for(tuple(kinds)).items() if k != "unit"}}
    if lacking := [size for size in SIZES if size in accepted and size not in {**values, **settings}]:
        raise MissingParameterError(
            f"Missing: {' and '.join(lacking)} of the muscle, which {name} needs.",
            "the size of the muscle that was recorded",
            f"Add --sim SIM.toml ('pamid init --kind muscle' writes one), or --set {lacking[0]}='20 mm'.",
        )
    return known[name](**{k: v for k, v in values.items() if k in accepted} | settings)


def _setting_of(name: str, settings: dict[str, Any], known: dict[str, Any]) -> tuple[str, dict[str, Any]]:
    """Take ``GeometricForce(tondu_lopez)``, as comparisons call it, for the estimator in that setting."""
    kind, bracket, setting = name.partition("(")
    if not bracket or kind not in known:
        return name, settings
    own: dict[str, Any] = {}
    for equation in set(known[kind].equations) & set(TARGETS):
        own |= known[kind].settings(equation)
    if setting.removesuffix(")") not in own:
        raise UnknownOptionError(
            f"{kind} has no setting {setting.removesuffix(')')!r}.",
            f"one of {', '.join(f'{kind}({s})' if s else kind for s in own)}",
            f"Correct the name, or use --estimator {kind} with --set.",
        )
    return kind, own[setting.removesuffix(")")] | settings


def opened(args: argparse.Namespace) -> tuple[dict[str, Any], Any, Target, Any]:
    """Return a model file's description, the model, its target, and the simulator file, if one is given."""
    from .. import persistence

    head, model = persistence.inspect(args.model), persistence.load(args.model)
    target = equation_of(model, args.equation or head["metadata"].get("equation"))
    page = page_of(args) if args.sim else None
    page_numbers(page, kinds=target.kinds)
    return head, model, target, page


def needed_signals(estimator: Any) -> list[str]:
    """Return the signals that an estimator reads."""
    return list(reads_of(estimator, ("eps", "P")))


def predict_table(model: Any, table: pd.DataFrame) -> np.ndarray:
    """Predict a table, with what the model was fitted on as columns."""
    import numpy as np
    from sklearn.exceptions import NotFittedError

    names = list(getattr(model, "feature_names_in_", []))
    if missing := [n for n in names if n not in table.columns]:
        raise MissingColumnError(
            f"The log gives no {', '.join(missing)}.",
            f"the columns that the model was fitted to: {', '.join(names)}",
            "Map the log's columns with --columns, or fit the model on columns that this log has.",
        )
    try:
        predicted = np.asarray(model.predict(table[names] if names else table), dtype=float)
    except PamidError:
        raise
    except NotFittedError:
        raise ModelFileError("The model is not fitted.", "a fitted model", "Fit it before saving it.") from None
    except Exception as error:  # a file may describe a model whose parts do not belong together
        raise ModelFileError(
            f"The model cannot predict this table: {type(error).__name__}: {' '.join(str(error).split())[:160]}.",
            "a consistent model, and the columns that it was fitted to",
            "Check the model with pamid.persistence.inspect, or fit it again.",
        ) from error
    if predicted.shape != (len(table),):
        raise IncompatibleError(
            f"The model predicts the shape {predicted.shape} for {len(table)} rows.",
            "one number per row",
            "Use a model of one target.",
        )
    return predicted


def score_by_trajectory(table: pd.DataFrame, predicted: np.ndarray, target: Target) -> dict[str, Any]:
    """Return rmse and nrmse over all rows and for each run."""
    scores = Scores(target)
    scores.add(table, predicted)
    return scores.result()


class Scores:
    """Errors of predictions, over all rows and for each run, of a table that may come in pieces."""

    def __init__(self, target: Target) -> None:
        self.target = target
        self._origin: float | None = None
        self._sums: dict[str, np.ndarray] = {}

    def add(self, table: pd.DataFrame, predicted: np.ndarray) -> None:
        """Take a piece with its predictions."""
        import numpy as np

        known = table[self.target.column].notna().to_numpy()
        table, predicted = table[known], predicted[known]
        measured = table[self.target.column].to_numpy(dtype=float)
        if self._origin is None:
            self._origin = float(measured[0]) if len(measured) else None
        for name, rows in table.groupby("trajectory", sort=False).indices.items():
            y, error = measured[rows] - self._origin, (predicted - measured)[rows]
            news = np.array([len(y), np.sum(error**2), np.sum(y), np.sum(y**2)])
            self._sums[str(name)] = self._sums.get(str(name), np.zeros(4)) + news

    def result(self) -> dict[str, Any]:
        """Return rmse, nrmse and rows of all, and the same by run."""
        by_trajectory = {name: _score(sums) for name, sums in self._sums.items()}
        return {**_score(sum(self._sums.values())), "unit": self.target.unit, "trajectories": by_trajectory}


def _score(sums: Any) -> dict[str, Any]:
    """Return the figures that follow from numbers of rows, squares of errors, and sums and squares of the measured."""
    n, square, total, squares = (float(v) for v in sums)
    rmse, spread = (square / n) ** 0.5, max(squares / n - (total / n) ** 2, 0.0) ** 0.5
    return {"rmse": rmse, "nrmse": rmse / spread if spread > 0 else float("nan"), "n_samples": int(n)}
