"""The error of a system's nominal equation on a log, beside the noise of the sensors."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..equations import Evaluation, LogEvaluation, TrajectoryEvaluation, channel_noise
from ..equations.windows import samples_per_window
from ..errors import ShortTrajectoryError
from .base import System
from .problem import Problem

if TYPE_CHECKING:
    import pandas as pd


def evaluate_system(log: pd.DataFrame, system: System) -> LogEvaluation:
    r"""Compare a log with the nominal equation of its system, over windows of 20 ms.

    The noise floor is what the white noise of the channels would leave with a perfect equation,

    .. math:: \sigma^2 = \sigma_y^2 + \sum_s \left(\frac{\partial f}{\partial s}\right)^2 \sigma_s^2

    in a mean over a window. The noise of a rate that a filter took is that of the filter's output.

    Parameters
    ----------
    log : DataFrame
        Tidy log with the system's `inputs`; rows with missing values are left out.
    system : System
        The system.

    Returns
    -------
    LogEvaluation
        Its one equation, with errors over all and by run.

    Raises
    ------
    MissingColumnError
        The log lacks a signal of the system.
    ShortTrajectoryError
        No run is as long as one window.

    Examples
    --------
    >>> import numpy as np, pandas as pd
    >>> from pamid.systems import evaluate_system
    >>> from pamid.systems.cylinder import Cylinder
    >>> t = np.arange(0, 5, 0.01)
    >>> log = pd.DataFrame({"trajectory": "a", "time": t, "x": 0.01 * np.sin(3 * t), "P": 4e5 + 1e5 * np.sin(t)})
    >>> log["F"] = 4.909e-4 * (log["P"] - 101_325) + 5
    >>> found = evaluate_system(log, Cylinder(bore=0.025))["force"]
    >>> f"{found.rmse:.1f} {found.unit}"
    '5.0 N'
    """
    problem = system.problem(complete(log, system))
    residual = problem.y - np.asarray(problem.nominal(problem.X), dtype=float)
    time = problem.X["time"].to_numpy(dtype=float)
    runs: dict[str, TrajectoryEvaluation] = {}
    everything: list[tuple[np.ndarray, np.ndarray, float]] = []
    for name in dict.fromkeys(problem.groups.tolist()):
        rows = np.flatnonzero(problem.groups == name)
        period = float(np.median(np.diff(time[rows]))) if len(rows) > 1 else 0.0
        n = samples_per_window(period) if period > 0 else 1
        if len(rows) < n:
            continue
        found = (_means(residual[rows], n), _means(problem.y[rows], n), noise_of(problem, rows, n))
        runs[str(name)] = TrajectoryEvaluation(**_figures([found]))
        everything.append(found)
    if not everything:
        raise ShortTrajectoryError("No run is as long as one window.", "runs of 20 ms at least", "Record longer runs.")
    whole = Evaluation(**_figures(everything), unit=problem.unit, trajectories=runs)
    return LogEvaluation({problem.equation: whole}, {})


def complete(log: pd.DataFrame, system: System) -> pd.DataFrame:
    """Return the rows of a log in which every signal of a system is known."""
    signals = [i.name for i in system.inputs if i.name in log.columns]
    return log.dropna(subset=["time", *signals]).reset_index(drop=True)


def noise_of(problem: Problem, rows: np.ndarray, n: int) -> float:
    """Return the standard deviation that the channels' noise leaves in a mean of n samples of the residual."""
    box = np.full(n, 1.0 / n)
    X = problem.X.iloc[rows]
    variance = channel_noise(problem.y[rows], n).variance(box)
    for column in X.columns.drop("time"):
        values = X[column].to_numpy(dtype=float)
        noise = channel_noise(values, n)
        step = max(noise.white, 1e-6 * float(np.std(values)))
        if step == 0:
            continue
        ahead = np.asarray(problem.nominal(X.assign(**{column: values + step})), dtype=float)
        behind = np.asarray(problem.nominal(X.assign(**{column: values - step})), dtype=float)
        variance += float(np.mean(np.square((ahead - behind) / (2 * step)))) * noise.variance(box)
    return float(np.sqrt(variance))


def _means(values: np.ndarray, n: int) -> np.ndarray:
    return np.asarray(values[: len(values) // n * n].reshape(-1, n).mean(axis=1))


def _figures(parts: list[tuple[np.ndarray, np.ndarray, float]]) -> dict[str, Any]:
    residual, measured = (np.concatenate([part[k] for part in parts]) for k in (0, 1))
    weights = [len(part[0]) for part in parts]
    rmse, spread = float(np.sqrt(np.mean(np.square(residual)))), float(np.std(measured))
    floor = float(np.sqrt(np.average([part[2] ** 2 for part in parts], weights=weights)))
    return {
        "rmse": rmse,
        "nrmse": rmse / spread if spread > 0 else float("nan"),
        "noise_floor": floor,
        "n_windows": len(residual),
    }
