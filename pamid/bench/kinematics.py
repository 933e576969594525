"""From the log of a bench to one row per muscle and sample."""

import numpy as np
import pandas as pd

from ..errors import MissingColumnError, MissingTrajectoryError
from ..signals.frames import as_pandas
from .parameters import BenchParameters

SIGNS = {1: 1.0, 2: -1.0}
"""How the joint angle contracts each muscle: muscle 1 shortens with growing angle, muscle 2 lengthens."""


def contraction(q: np.ndarray, muscle: int, params: BenchParameters) -> np.ndarray:
    r"""Contraction ratio of a muscle, ε = ε₀ ± r q / L₀.

    Parameters
    ----------
    q : array
        Joint angle, rad.
    muscle : int
        1 or 2.
    params : BenchParameters
        Pulley radius, rest length and initial contraction.

    Returns
    -------
    array
        ε, dimensionless.

    Examples
    --------
    >>> import numpy as np
    >>> from pamid.bench import BenchParameters, contraction
    >>> contraction(np.array([-0.2, 0.0, 0.2]), 1, BenchParameters.for_muscle("B")).round(3)  # angles in rad
    array([0.08, 0.12, 0.16])
    """
    gain = SIGNS[muscle] * params.joint.pulley_radius / params.muscle.rest_length
    return params.muscle.initial_contraction + gain * q


def unfold(log: pd.DataFrame, params: BenchParameters) -> pd.DataFrame:
    """Turn a log of the bench into one row per muscle and sample.

    Parameters
    ----------
    log : DataFrame
        Columns ``trajectory``, ``time`` (s), ``q`` (rad), ``P1``, ``P2`` (Pa, absolute) and, where measured, ``F1``,
        ``F2`` (N), ``mdot1``, ``mdot2`` (kg/s), ``u1``, ``u2``.
    params : BenchParameters
        The bench.

    Returns
    -------
    DataFrame
        Columns ``trajectory`` (unique per run and muscle, such as ``"sine-1-10#1"``), ``run``, ``muscle``, ``time``,
        ``eps``, ``P`` and, where the log has them, ``F``, ``mdot``, ``u``; all rows of muscle 1, then all of muscle 2,
        each in the order of the log.

    Raises
    ------
    MissingColumnError
        The log lacks ``time``, ``q``, or the pressure of both muscles.
    MissingTrajectoryError
        The log does not name its runs.

    Examples
    --------
    >>> from pamid.bench import BenchParameters, simulate, sine, unfold
    >>> bench = BenchParameters.for_muscle("B")
    >>> table = unfold(simulate(bench, [sine(4, 15, 100)]), bench)
    >>> len(table), [c for c in ("eps", "P", "F", "mdot") if c in table]
    (200, ['eps', 'P', 'F', 'mdot'])
    """
    log = as_pandas(log)
    if "trajectory" not in log:
        raise MissingTrajectoryError(
            "The log has no column 'trajectory'.", "the name of the run in each row", "Add the column."
        )
    muscles = [m for m in SIGNS if f"P{m}" in log]
    if missing := [c for c in ("time", "q") if c not in log] + ([] if muscles else ["P1", "P2"]):
        raise MissingColumnError(
            f"The log lacks {', '.join(missing)}.",
            "time, q and the pressures P1, P2",
            f"Map your columns to these names; the log has {', '.join(map(str, log.columns[:20]))}.",
        )
    codes, runs = pd.factorize(log["trajectory"])
    run_names = np.asarray([str(run) for run in runs], dtype=object)
    time = log["time"].to_numpy(dtype=float)
    q = log["q"].to_numpy(dtype=float)
    signals = [s for s in ("F", "mdot", "u") if all(f"{s}{m}" in log for m in muscles)]
    n = len(log)
    columns: dict[str, np.ndarray] = {
        "trajectory": np.concatenate(
            [np.asarray([f"{r}#{m}" for r in run_names], dtype=object)[codes] for m in muscles]
        ),
        "run": np.tile(run_names[codes], len(muscles)),
        "muscle": np.repeat(np.asarray(muscles, dtype=np.int8), n),
        "time": np.tile(time, len(muscles)),
        "eps": np.concatenate([contraction(q, m, params) for m in muscles]),
        "P": np.concatenate([log[f"P{m}"].to_numpy(dtype=float) for m in muscles]),
    }
    for signal in signals:
        columns[signal] = np.concatenate([log[f"{signal}{m}"].to_numpy(dtype=float) for m in muscles])
    return pd.DataFrame(columns)
