"""Models of a system's one equation compared with each other on runs that their fits have not seen."""

import fnmatch
from collections.abc import Callable, Sequence
from typing import Any, Self

import numpy as np
import pandas as pd
from sklearn.base import BaseEstimator, RegressorMixin

from ..compare.comparison import Comparison
from ..compare.entries import CandidateModel
from ..compare.protocol import Prepared, folds
from ..compare.run import compare, score_candidates
from ..equations.noise import channel_noise
from ..errors import UnknownOptionError
from ..explained import explained_by
from ..simulators.problem import Problem
from .base import System, with_rates

_STILL = 0.05  # of the highest speed, at which the smoothed sign of the motion is three quarters


@explained_by(compare)
def compare_system(
    log: pd.DataFrame,
    system: System,
    estimators: str | Sequence[str] = "all",
    *,
    cv: Any = 5,
    split: str = "run",
    rows: Callable[[pd.DataFrame], np.ndarray | None] | None = None,
    fit_rows: int = 5000,
    score_rows: int = 50_000,
    random_state: int = 0,
    progress: Callable[[str], None] | None = None,
) -> Comparison:
    """Compare models of a system's equation: its nominal one, the same with friction, and learners without physics.

    Parameters
    ----------
    log : DataFrame
        Tidy log with the system's `signals`; rows with missing values are left out.
    system : System
        The system.
    estimators : "all" or sequence of str, default="all"
        Labels, or patterns of labels.
    rows : callable, optional
        Takes the table of signals with the target, returns which rows count.

    Returns
    -------
    Comparison
        The table, the best first.

    Raises
    ------
    MissingColumnError
        The log lacks a signal of the system.
    TooFewTrajectoriesError
        It has fewer than two runs.

    Examples
    --------
    >>> import numpy as np, pandas as pd
    >>> from pamid.systems import compare_system
    >>> from pamid.systems.cylinder import Cylinder
    >>> t, runs = np.arange(0, 8, 0.01), []
    >>> for k, w in enumerate((1.0, 2.0, 3.0)):
    ...     P = 3e5 + 1e5 * np.sin(0.7 * t + k)
    ...     F = 4.909e-4 * (P - 101_325) + 8 * np.sign(np.cos(w * t))
    ...     runs.append(pd.DataFrame({"trajectory": str(k), "time": t, "x": 0.01 * np.sin(w * t), "P": P, "F": F}))
    >>> compare_system(pd.concat(runs), Cylinder(bore=0.025), ["nominal*"], cv=3).best.estimator
    'nominal with friction'
    """
    problem = system.problem(log)
    table, columns = _table(problem)
    usable = np.ones(len(table), dtype=bool) if rows is None or (kept := rows(table)) is None else kept
    even = np.arange(0, len(table), max(1, -(-len(table) // score_rows)))
    ready = Prepared(
        table, problem.equation, "target", problem.groups.astype(object), usable, even, {}, False, table, 0.0, []
    )
    ready.notes.extend(problem.notes)
    splits = list(folds(ready, cv, split=split, fit_rows=fit_rows, random_state=random_state))
    still = _STILL * float(np.quantile(np.abs(table["speed"]), 0.99))
    models = _models(columns, still, random_state)
    entries = [CandidateModel(name, model, columns, ("target",)) for name, model in models.items()]
    wanted = ["*"] if isinstance(estimators, str) and estimators == "all" else list(estimators)
    chosen = [e for e in entries if any(fnmatch.fnmatch(e.label, pattern) for pattern in wanted)]
    if not chosen:
        raise UnknownOptionError(
            f"{', '.join(wanted)} is not a model of a {system.kind}.",
            f"some of {', '.join(e.label for e in entries)}",
            "Correct the names.",
        )
    found = score_candidates(chosen, ready, splits, problem.unit, random_state=random_state, progress=progress)
    runs = [np.flatnonzero(problem.groups == name) for name in dict.fromkeys(problem.groups.tolist())]
    left = problem.y - table["nominal"].to_numpy()
    found.noise_floor = float(np.sqrt(np.mean(np.square([channel_noise(left[run], 1).white for run in runs]))))
    found.rows = found.rows.reset_index(drop=True)
    return found


def _table(problem: Problem) -> tuple[pd.DataFrame, tuple[str, ...]]:
    """Return signals, speed, nominal value and target, and the columns that models read."""
    table = problem.X.drop(columns="nominal", errors="ignore").assign(trajectory=problem.groups)
    position, speed = problem.roles["position"], problem.roles.get("velocity")
    if speed is None:
        table["speed"] = with_rates(table, {position: "speed"})["speed"].to_numpy()
        speed = "speed"
    table = table.rename(columns={speed: "speed"}).reset_index(drop=True)
    columns = tuple(c for c in table.columns if c not in ("trajectory", "time"))
    nominal = np.asarray(problem.nominal(problem.X), dtype=float)
    return table.assign(run=problem.groups, nominal=nominal, target=problem.y), (*columns, "nominal")


class _Nominal(RegressorMixin, BaseEstimator):
    """The last column as it is."""

    def fit(self, X: Any, y: Any) -> Self:
        self.n_parameters_ = 0
        return self

    def predict(self, X: Any) -> np.ndarray:
        return np.asarray(X, dtype=float)[:, -1]


def _models(columns: tuple[str, ...], still: float, seed: int) -> dict[str, Any]:
    """Return the models by their labels; each reads the columns, of which the nominal value is the last."""
    from sklearn.ensemble import HistGradientBoostingRegressor
    from sklearn.linear_model import LinearRegression, Ridge
    from sklearn.pipeline import make_pipeline
    from sklearn.preprocessing import FunctionTransformer, PolynomialFeatures, StandardScaler

    signals = FunctionTransformer(_columns, kw_args={"which": slice(0, -1)})
    friction = FunctionTransformer(_friction, kw_args={"speed": columns.index("speed"), "still": still})
    return {
        "nominal": _Nominal(),
        "nominal, gain and offset": make_pipeline(
            FunctionTransformer(_columns, kw_args={"which": slice(-1, None)}), LinearRegression()
        ),
        "nominal with friction": make_pipeline(friction, LinearRegression(fit_intercept=False)),
        "quadratic": make_pipeline(signals, StandardScaler(), PolynomialFeatures(2), Ridge(1e-3)),
        "boosted trees": make_pipeline(signals, HistGradientBoostingRegressor(random_state=seed)),
    }


def _columns(X: Any, which: slice) -> np.ndarray:
    return np.asarray(X, dtype=float)[:, which]


def _friction(X: Any, speed: int, still: float) -> np.ndarray:
    """Return gain, offset, dry friction, viscous friction, and dry friction that grows with the nominal value."""
    values = np.asarray(X, dtype=float)
    f, v = values[:, -1], values[:, speed]
    way = np.tanh(v / still) if still > 0 else np.zeros(len(v))
    return np.column_stack([f, np.ones(len(f)), way, v, way * np.abs(f)])
