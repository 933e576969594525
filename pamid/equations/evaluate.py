"""Hold a log against the equations of a simulator: how large each residual is, and how large its noise."""

import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Annotated, Any, Self

import numpy as np
import pandas as pd

from ..bench.parameters import BenchParameters
from ..errors import ReadingWarning, ShortTrajectoryError, UnitWarning
from ..explained import explained_fields
from ..signals.frames import as_pandas
from .allowed import allowed_equations, residuals, without_windows
from .base import Equation, Residual
from .log import BenchLog
from .unit_doubts import unit_doubts
from .windows import WINDOW

_WORST = 3  # windows that one wrong reading falls into, with derivatives
_ENOUGH = 30  # windows from which on three are few
_MOST = 0.5  # of the squared error
_ABOVE = 1.5**2  # squared errors above that of the noise before it matters where they lie


@explained_fields
@dataclass(frozen=True)
class TrajectoryEvaluation:
    """One equation on one run.

    Examples
    --------
    >>> from pamid.bench import BenchParameters, simulate, sine
    >>> from pamid.equations import evaluate_log
    >>> bench = BenchParameters.for_muscle("B")
    >>> found = evaluate_log(simulate(bench, [sine(4, 15, 400)]), bench, ["force"])
    >>> found["force"].trajectories["sine-4-15"].rmse < 0.1  # N
    True
    """

    rmse: Annotated[float, "Root mean square of the residual, in the equation's unit."]
    nrmse: Annotated[float, "`rmse` over the standard deviation of the measured side."]
    noise_floor: Annotated[
        float, "Root mean square of what the channels' noise leaves in the residual, in the equation's unit."
    ]
    n_windows: Annotated[int, "Number of windows, those of both muscles counted."]


@dataclass(frozen=True)
class Evaluation(TrajectoryEvaluation):
    """One equation on a log.

    Parameters
    ----------
    rmse, nrmse, noise_floor : float
        As for one run, over all of them.
    n_windows : int
        Number of windows.
    unit : str
        Unit of `rmse` and `noise_floor`.
    trajectories : dict of str to TrajectoryEvaluation
        The same for each run.

    Examples
    --------
    >>> from pamid.bench import BenchParameters, simulate, sine
    >>> from pamid.equations import evaluate_log
    >>> bench = BenchParameters.for_muscle("B")
    >>> force = evaluate_log(simulate(bench, [sine(4, 15, 400)]), bench, ["force"])["force"]
    >>> force.unit, force.rmse < 2 * force.noise_floor
    ('N', True)
    """

    unit: str = ""
    trajectories: dict[str, TrajectoryEvaluation] = field(default_factory=dict)

    def as_dict(self) -> dict[str, Any]:
        """Return the evaluation as plain numbers and text."""
        own = {name: getattr(self, name) for name in ("rmse", "nrmse", "noise_floor", "unit", "n_windows")}
        return {**own, "trajectories": {name: dict(vars(run)) for name, run in self.trajectories.items()}}


class LogEvaluation(Mapping[str, Evaluation]):
    """The equations that a log allows, by name, and why it does not allow the others.

    Parameters
    ----------
    equations : dict of str to Evaluation
        The evaluated equations.
    skipped : dict of str to str
        For each other equation, what it needs and what the log has.

    Attributes
    ----------
    skipped : dict of str to str
        As given.

    Examples
    --------
    >>> from pamid.bench import BenchParameters, simulate, sine
    >>> from pamid.equations import evaluate_log
    >>> bench = BenchParameters.for_muscle("B")
    >>> found = evaluate_log(simulate(bench, [sine(4, 15, 400)]).drop(columns=["mdot1", "mdot2"]), bench)
    >>> list(found), list(found.skipped)
    (['force', 'joint', 'gas_valve'], ['flow', 'valve'])
    """

    def __init__(self, equations: Mapping[str, Evaluation], skipped: Mapping[str, str]) -> None:
        self._equations = dict(equations)
        self.skipped = dict(skipped)

    def __getitem__(self, name: str) -> Evaluation:
        return self._equations[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._equations)

    def __len__(self) -> int:
        return len(self._equations)

    def __repr__(self) -> str:
        lines = [f"{n}: rmse {e.rmse:.4g} {e.unit}, noise {e.noise_floor:.4g} {e.unit}" for n, e in self.items()]
        return "\n".join([*lines, *(f"{name}: skipped, {why}" for name, why in self.skipped.items())])

    def as_dict(self) -> dict[str, Any]:
        """Return everything as plain numbers and text, as ``pamid evaluate --json`` prints it."""
        return {"equations": {name: e.as_dict() for name, e in self.items()}, "skipped": dict(self.skipped)}


class Sums:
    """Running sums over the windows of one run, so that no window has to be kept."""

    def __init__(self) -> None:
        self.n = 0
        self.square = self.noise = self.measured = self.measured_square = 0.0
        self.origin: float | None = None
        self.worst: list[tuple[float, float]] = []

    def add(self, r: Residual) -> None:
        """Take in windows, one per row and a column a side."""
        if not r.value.size:
            return
        largest = np.max(r.value**2, axis=1)
        top = np.argsort(largest)[-_WORST:]
        self.worst += zip(largest[top].tolist(), r.time[top].tolist(), strict=True)
        self.worst = sorted(self.worst)[-_WORST:]
        if self.origin is None:  # sums about a value of the signal itself keep their digits
            self.origin = float(r.measured.flat[0])
        m = r.measured - self.origin
        self.n += r.value.size
        self.square += float(np.sum(r.value**2))
        self.noise += float(np.sum(r.noise**2))
        self.measured += float(np.sum(m))
        self.measured_square += float(np.sum(m**2))

    def merge(self, other: Self) -> None:
        """Add the sums of another."""
        if not other.n or other.origin is None:
            return
        if self.origin is None:
            self.origin = other.origin
        shift = other.origin - self.origin
        self.measured_square += other.measured_square + 2 * shift * other.measured + other.n * shift**2
        self.measured += other.measured + other.n * shift
        self.n += other.n
        self.square += other.square
        self.noise += other.noise

    def result(self) -> dict[str, Any]:
        """Return the numbers of a `TrajectoryEvaluation`."""
        rmse = float(np.sqrt(self.square / self.n))
        variance = max(self.measured_square / self.n - (self.measured / self.n) ** 2, 0.0)
        return {
            "rmse": rmse,
            "nrmse": rmse / float(np.sqrt(variance)) if variance > 0 else float("nan"),
            "noise_floor": float(np.sqrt(self.noise / self.n)),
            "n_windows": self.n,
        }


def summed(runs: Mapping[str, Sums], unit: str) -> Evaluation:
    """Return the evaluation of an equation from the sums of its runs."""
    total = Sums()
    for part in runs.values():
        total.merge(part)
    return Evaluation(
        **total.result(), unit=unit, trajectories={t: TrajectoryEvaluation(**part.result()) for t, part in runs.items()}
    )


def _few_windows(sums: Mapping[str, Mapping[str, Sums]]) -> Iterator[str]:
    """List errors that rest on a few windows of one run, such as those of a wrong first or last reading."""
    for equation, by_trajectory in sums.items():
        n = sum(part.n for part in by_trajectory.values())
        square, noise = (sum(getattr(p, k) for p in by_trajectory.values()) for k in ("square", "noise"))
        if n < _ENOUGH or square <= _ABOVE * noise:
            continue
        trajectory, part = max(by_trajectory.items(), key=lambda item: sum(s for s, _ in item[1].worst))
        share = sum(s for s, _ in part.worst) / square
        if share > _MOST:
            at = part.worst[-1][1]
            yield (
                f"{share:.0%} of the squared error of the {equation} equation lie in {len(part.worst)} of {n:,} "
                f"windows, the largest at {at:.4g} s of '{trajectory}': look at the readings there."
            )


def evaluate_log(
    log: pd.DataFrame | Iterable[pd.DataFrame],
    params: BenchParameters,
    equations: Sequence[str] | None = None,
    *,
    progress: Callable[[str], None] | None = None,
) -> LogEvaluation:
    """Evaluate the equations of a simulator on a log.

    Parameters
    ----------
    log : DataFrame or iterable of DataFrame
        Log of the bench, see `residuals`; or pieces of one, each of whole runs, as
        `pamid.signals.read_log_pieces` reads them from a log that is larger than memory.
    params : BenchParameters
        The simulator, its effects included.
    equations : sequence of str, optional
        Names of the equations; all that the log allows by default.
    progress : callable, optional
        Called with the name of each run when it is begun.

    Returns
    -------
    LogEvaluation
        For each equation its root mean square residual over windows of 20 ms, the same over the standard deviation
        of the measured side, and the noise floor that the channels' own noise leaves; and in ``skipped`` what the log
        does not allow, and why.

    Raises
    ------
    MissingTrajectoryError, InterleavedTrajectoryError, TimeOrderError, NonFiniteError, EmptyLogError
        The log cannot be used as it is.
    ShortTrajectoryError
        No run is long enough for a window.

    Warns
    -----
    UnitWarning
        The simulator would be right if a column were in another unit, see `unit_doubts`.
    ReadingWarning
        Up to three windows hold most of an error.

    Examples
    --------
    >>> import numpy as np, pandas as pd
    >>> from pamid.bench import BenchParameters
    >>> from pamid.equations import evaluate_log
    >>> rest = np.full(200, 300_000.0)
    >>> log = pd.DataFrame({"trajectory": "rest", "time": np.arange(200) * 1e-3, "q": 0.0, "P1": rest, "P2": rest})
    >>> log = log.assign(mdot1=0.0, mdot2=0.0)
    >>> result = evaluate_log(log, BenchParameters.for_muscle("B"))
    >>> list(result), result["flow"].rmse
    (['flow', 'joint_modelled'], 0.0)
    >>> result.skipped["joint"]
    'joint needs q, F1, F2; the log lacks F1, F2; it is tested together with force instead'
    """
    allowed: dict[str, Equation] = {}
    skipped: dict[str, str] = {}
    doubts: list[str] = []
    sums: dict[str, dict[str, Sums]] = {}
    log = as_pandas(log)
    for piece in map(BenchLog.of, [log] if isinstance(log, pd.DataFrame | BenchLog) else log):
        here, lacking = allowed_equations(piece, equations)
        allowed |= here
        skipped |= lacking
        _ = piece.trajectories  # raises where runs cannot be identified
        doubts = doubts or unit_doubts(piece, params, equations)
        begun = ""
        for trajectory, name, residual in residuals(piece, params, list(here)):
            if progress is not None and trajectory != begun:
                progress(begun := trajectory)
            sums.setdefault(name, {}).setdefault(trajectory, Sums()).add(residual)
    for doubt in doubts:
        warnings.warn(doubt, UnitWarning, stacklevel=2)
    for few in _few_windows(sums):
        warnings.warn(few, ReadingWarning, stacklevel=2)
    skipped = {name: why for name, why in skipped.items() if name not in allowed}
    evaluations: dict[str, Evaluation] = {}
    for name in allowed:
        if not any(part.n for part in sums.get(name, {}).values()):
            skipped[name] = without_windows(allowed[name])
            continue
        evaluations[name] = summed(sums[name], allowed[name].unit)
    if allowed and not evaluations:
        raise ShortTrajectoryError(
            "No run of the log is long enough for a window.",
            f"at least {WINDOW:g} s without gaps",
            "Check the unit of time (it must be seconds) and the sampling.",
        )
    return LogEvaluation(evaluations, skipped)
