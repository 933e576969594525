"""The common ground of a comparison: rates by run, the target, folds of whole runs, and the rows of a fit."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
import pandas as pd

from ..errors import (
    EmptyLogError,
    IncompatibleError,
    MissingColumnError,
    MissingTrajectoryError,
    NonFiniteError,
    ParameterError,
    ShapeError,
    ShortTrajectoryError,
    TooFewTrajectoriesError,
)
from ..explained import explained_fields
from .entries import EQUATIONS, OUTPUTS, START, target_of
from .timing import flow_steps, held_share

RATES = {"deps": "eps", "dP": "P"}

FLOW_WINDOW = 0.02
"""Windows over which the flow equation is averaged, s: they take most of the noise that a rate of pressure brings."""

RUN_WINDOW = 0.01
"""Windows over which a free run is averaged, s: its steps are then worth taking."""

_COMMANDS = ("u", "load")
"""Columns that drive a free run and are handed on where a table has them."""


@explained_fields
@dataclass
class Prepared:
    """A table that every candidate can read, and the use of each of its rows.

    Examples
    --------
    >>> from pamid.bench import BenchParameters, simulate, sine, unfold
    >>> from pamid.compare.protocol import prepare
    >>> bench = BenchParameters.for_muscle("B")
    >>> ready = prepare(unfold(simulate(bench, [sine(4, 10.0, 400)]), bench), "force")
    >>> ready.target, int(ready.usable.sum())
    ('F', 800)
    """

    table: Annotated[
        pd.DataFrame,
        "``trajectory``, ``run``, ``time``, ``eps``, ``deps``, ``P``, ``dP`` and the measured sides, as they are "
        "learnt and scored.",
    ]
    equation: Annotated[str, "The equation."]
    target: Annotated[str, "Column of its measured side."]
    runs: Annotated[np.ndarray, "Run of each row; folds and intervals keep runs together; shape (n_rows,)."]
    usable: Annotated[np.ndarray, "Rows that may be learnt from and scored; shape (n_rows,)."]
    even: Annotated[np.ndarray, "Every k-th row of each run, the spacing at which everything is scored."]
    cutoffs: Annotated[
        dict[str, float], "Cut-off frequency of the rate of each signal, Hz, where rates were taken here."
    ]
    smoothed: Annotated[bool, "Whether the target was smoothed like the pressure."]
    source: Annotated[pd.DataFrame, "The table before it was averaged over windows; the same one if it was not."]
    window: Annotated[float, "Length of the windows, s; 0 if there are none."]
    notes: Annotated[list[str], "What a reader of the result should know."]

    @property
    def measured(self) -> tuple[str, ...]:
        """Measured sides that the table has."""
        return tuple(column for column, _ in EQUATIONS.values() if column in self.table.columns)


def prepare(
    table: pd.DataFrame,
    equation: str = "force",
    *,
    rows: Any = None,
    score_rows: int = 50_000,
    tuning: str | float | Sequence[float] = "auto",
    method: str = "savgol",
    smooth_target: bool | None = None,
    window: float | str = "auto",
    output: str = "eps",
) -> Prepared:
    """Take rates within runs, average where that is due, and choose the rows to score.

    Parameters
    ----------
    table : DataFrame
        One row per muscle and sample: ``trajectory``, ``time`` (s), ``eps``, ``P`` (Pa, absolute) and ``F`` (N) or
        ``mdot`` (kg/s); a column ``run`` where both muscles of a run are listed; ``deps`` (1/s) and ``dP``
        (Pa/s) if they are known; what drives a free run, ``load`` (kg) or the valve command ``u``.
    equation : {"force", "flow", "inverse", "dynamic"}, default="force"
        What is compared.
    rows : array_like of bool, shape (n_rows,), optional
        Rows that count, such as those in which a muscle is not slack; the others serve only to take rates from.
    score_rows : int, default=50000
        Maximum number of rows scored.
    tuning : "auto", float or sequence of float, default="auto"
        Cut-off frequency of the rates, Hz, see `pamid.estimators.RateTransformer`.
    method : {"savgol", "spline", "kalman"}, default="savgol"
        Method of the rates.
    smooth_target : bool, optional
        Whether the measured side is smoothed as the pressure is before its rate is taken. By default a flow is that
        is not averaged over windows: it is compared with a smoothed rate, and should have gone through the same filter.
    window : float or "auto", default="auto"
        Length of windows (s) over which all signals are averaged once the rates are taken; 0 for none. ``"auto"`` is
        0.02 for a flow sampled every 5 ms or faster, whose law is linear in the noisy rates, 0.01 for a free run
        sampled every 2.5 ms or faster, and 0 elsewhere.
    output : {"eps", "P"}, default="eps"
        Output of the dynamic problem.

    Returns
    -------
    Prepared
        The table and its rows.

    Raises
    ------
    MissingColumnError, MissingTrajectoryError, NonFiniteError, EmptyLogError
        The table cannot be used as it is.

    Notes
    -----
    A flow is shifted back by up to half a sample, see `pamid.compare.timing.held_share`: an error of timing that all
    models share would hide what distinguishes them.

    Examples
    --------
    >>> from pamid.bench import BenchParameters, simulate, sine, unfold
    >>> from pamid.compare import prepare
    >>> bench = BenchParameters.for_muscle("B")
    >>> ready = prepare(unfold(simulate(bench, [sine(4, 10.0, 400)]), bench), "force")
    """
    from ..signals import thinned_rows

    column, _ = target_of(equation, output)
    drivers = tuple(c for c in OUTPUTS[output][1] if c in _COMMANDS) if equation == "dynamic" else ()
    _require(table, column, *(("F",) if equation == "inverse" else ()), *drivers)
    notes: list[str] = []
    measured = [c for c in (*(c for c, _ in EQUATIONS.values()), *drivers) if c in table.columns]
    kept = ["trajectory", *(["run"] if "run" in table.columns else []), "time", "eps", "P"]
    given = [r for r in RATES if r in table.columns]
    out = table[[*kept, *given, *measured]].reset_index(drop=True)
    if "run" not in out.columns:
        out.insert(1, "run", out["trajectory"])
    cutoffs: dict[str, float] = {}
    if missing := [s for r, s in RATES.items() if r not in given]:
        out, cutoffs = _with_rates(out, missing, tuning, method)
    length = _window(out, equation, window)
    smooth = smooth_target if smooth_target is not None else equation == "flow" and not length
    if smooth and "P" not in cutoffs:
        smooth = False
        if smooth_target:
            raise IncompatibleError(
                "The table brings its own rates, so their filter is not known.",
                "rates taken here, if the target shall be smoothed alike",
                "Drop the columns deps and dP, or smooth the target yourself.",
            )
    if smooth:
        out[column] = _smoothed(out, column, cutoffs["P"], method)
        notes.append(
            f"{column} was smoothed like P (cut-off {cutoffs['P']:.3g} Hz, {method}) before fitting and scoring."
        )
    usable = np.ones(len(out), dtype=bool)
    if rows is not None:
        usable = np.asarray(rows, dtype=bool)
        if usable.shape != (len(out),):
            raise ShapeError(f"rows has shape {usable.shape}.", f"({len(out)},)", "Pass one entry a row.")
        if not usable.any():
            raise EmptyLogError("No row counts.", "rows that meet the condition", "Loosen the condition.")
        notes.append(f"{int(usable.sum())} of {len(out)} rows count.")
    source = out
    if equation == "flow":
        out = out.assign(step=flow_steps(out, column))
    if length:
        out, usable = _averaged(out, usable, length)
        notes.append(f"All signals are averages over windows of {1e3 * length:g} ms, rates taken before.")
    if equation == "dynamic":
        out[START] = out.groupby("trajectory", sort=False)[column].transform("first")
        notes.append(f"{column} runs freely from its first value; {', '.join(OUTPUTS[output][1])} drive it.")
    if equation == "flow":
        step = out.pop("step").to_numpy(dtype=float)
        share = held_share(out[usable], out[column].to_numpy(dtype=float)[usable], step[usable])
        if share:
            out[column] -= share / 2.0 * step
            notes.append(
                f"The flow was taken to hold for {share:.2f} of the time from a sample to the next, as fits best."
            )
    names = out["trajectory"].to_numpy(dtype=object)
    n_trajectories = len(pd.unique(out["trajectory"]))
    if score_rows < n_trajectories:
        raise ParameterError(
            f"score_rows is {score_rows} for {n_trajectories} runs.", "at least one per run", "Raise it."
        )
    # rows that do not count are skipped, not paid for
    wanted = int(score_rows / usable.mean())
    even = thinned_rows(names, n_rows=min(len(out), max(n_trajectories, wanted)))
    return Prepared(
        out, equation, column, out["run"].to_numpy(dtype=object), usable, even, cutoffs, smooth, source, length, notes
    )


def _window(table: pd.DataFrame, equation: str, window: float | str) -> float:
    """Return the length of the windows, s; 0 for none."""
    if window == "auto":
        step = float(np.median(np.abs(np.diff(table["time"].to_numpy(dtype=float))))) if len(table) > 1 else np.inf
        length = {"flow": FLOW_WINDOW, "dynamic": RUN_WINDOW}.get(equation, 0.0)
        return length if step <= length / 4 else 0.0
    if isinstance(window, str) or not (np.isfinite(window) and window >= 0):
        raise ParameterError(f"window is {window!r}.", "'auto', or a length in s that is not negative", "Correct it.")
    return float(window)


def _averaged(table: pd.DataFrame, usable: np.ndarray, length: float) -> tuple[pd.DataFrame, np.ndarray]:
    """Average over windows; one counts if all of its rows do."""
    from ..signals import windows

    run_of = dict(zip(table["trajectory"], table["run"], strict=True))
    out = windows(table.drop(columns="run").assign(usable=usable.astype(float)), length)
    counts = out["usable"].to_numpy() > 1.0 - 1e-9
    kept = [c for c in table.columns if c != "run"]
    out = out[kept]
    out.insert(1, "run", [run_of[name] for name in out["trajectory"]])
    return out, counts


def _require(table: pd.DataFrame, *columns: str) -> None:
    if "trajectory" not in table.columns:
        raise MissingTrajectoryError(
            "The table has no column 'trajectory'.", "the name of its run in each row", "Add the column."
        )
    if not len(table):
        raise EmptyLogError("The table has no rows.", "at least two runs", "Check how it was read.")
    wanted = tuple(dict.fromkeys(("time", "eps", "P", *columns)))
    if lacking := [c for c in wanted if c not in table.columns]:
        raise MissingColumnError(
            f"The table lacks {', '.join(lacking)}; it has {', '.join(map(str, table.columns[:20]))}.",
            f"trajectory, {', '.join(wanted)}",
            "Rename your columns, or unfold a log of the bench with pamid.bench.unfold.",
        )
    for name in wanted:
        if not np.isfinite(table[name].to_numpy(dtype=float)).all():
            raise NonFiniteError(
                f"The column '{name}' holds NaN or infinite values.", "finite values", "Drop or fill those rows first."
            )


def _with_rates(
    table: pd.DataFrame, signals: list[str], tuning: Any, method: str
) -> tuple[pd.DataFrame, dict[str, float]]:
    from pamid.estimators import RateTransformer

    base = table[["trajectory", "time", *signals]]
    rates = RateTransformer(columns=tuple(signals), tuning=tuning, method=method).fit(base)
    found = rates.transform(base)
    new = found[[f"d{s}" for s in signals]]
    return table.assign(**{c: new[c] for c in new}), dict(zip(signals, rates.cutoffs_.tolist(), strict=True))


def _smoothed(table: pd.DataFrame, column: str, cutoff: float, method: str) -> np.ndarray:
    from ..signals import differentiate

    out = np.empty(len(table))
    for name, rows in table.groupby("trajectory", sort=False).indices.items():
        if len(rows) < 2:
            raise ShortTrajectoryError(f"The run '{name}' has 1 sample.", "at least 2", "Leave it out.")
        part = table.iloc[rows]
        out[rows] = differentiate(part[column].to_numpy(), part["time"].to_numpy(), tuning=cutoff, method=method)[0]
    return out


@dataclass
class Fold:
    """One split: rows by their number in the table."""

    train: np.ndarray
    """Rows of the training runs, shape (n_rows,)."""
    test: np.ndarray
    """Rows of the held-out runs, shape (n_rows,)."""
    fit_rows: np.ndarray
    """Rows that estimators without memory are fitted on."""
    even_train: np.ndarray
    even_test: np.ndarray
    """Evenly spaced rows of both parts, for estimators that learn from sequences."""
    score_rows: np.ndarray
    """Rows on which all are scored."""


def folds(
    prepared: Prepared, cv: Any = 5, *, split: str = "run", fit_rows: int = 5000, random_state: int = 0
) -> Iterator[Fold]:
    """Go through the folds of whole runs."""
    from ..signals import LeaveOneKindOut, TrajectoryKFold, thinned_rows

    runs, table = prepared.runs, prepared.table
    n_runs = len(set(runs[prepared.usable].tolist()))
    if n_runs < 2:
        raise TooFewTrajectoriesError(
            f"The log has {n_runs} run that counts.",
            "at least 2, so that each can be predicted from the others",
            "Add logs of further runs; one run cannot say how well a model holds on another.",
        )
    splitter = cv
    if split == "kind":
        splitter = LeaveOneKindOut()
    elif split != "run":
        raise ParameterError(f"split is {split!r}.", "'run' or 'kind'", "Correct the name.")
    elif isinstance(cv, int | np.integer):
        if cv > n_runs:
            prepared.notes.append(f"{n_runs} runs allow {n_runs} folds, not {cv}.")
        splitter = TrajectoryKFold(min(int(cv), n_runs), shuffle=True, random_state=random_state)
    names = table["trajectory"].to_numpy(dtype=object)
    is_even = np.zeros(len(table), dtype=bool)
    is_even[prepared.even] = True
    for train_rows, test_rows in splitter.split(table, table[prepared.target], groups=runs):
        train, test = np.zeros((2, len(table)), dtype=bool)
        train[train_rows] = True
        test[test_rows] = True
        learnt = np.flatnonzero(train & prepared.usable)
        scored = np.flatnonzero(test & prepared.usable & is_even)
        if not len(learnt) or not len(scored):
            continue
        here = names[learnt]
        chosen = learnt
        if len(learnt) > fit_rows:
            try:
                chosen = learnt[thinned_rows(here, n_rows=fit_rows)]
            except ParameterError as error:
                raise ParameterError(
                    f"fit_rows is {fit_rows}.", "at least one row per run of the fit", "Raise it."
                ) from error
        yield Fold(train, test, chosen, np.flatnonzero(train & is_even), np.flatnonzero(test & is_even), scored)
