"""One equation of any actuator against a model: its signals on a log, and their evidence."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from ..effects import Plant
from ..equations.noise import channel_noise
from ..errors import ExcitationError, ShortTrajectoryError, TimeOrderError
from ..signals.stretches import stuck_rows
from ..simulators.base import Simulator
from ..simulators.problem import Problem
from .diagnosis.result import Diagnosis
from .inference.floor import sense_of
from .inference.sensitivity import templates
from .residuals.on_equation import OnEquation, Table
from .residuals.rates import with_rates
from .residuals.single import SignalEvidence, Stated
from .residuals.units import Units
from .residuals.window_noise import REPLICATES

Again = Callable[[np.ndarray], Problem]
"""Takes the numbers of a simulator, returns the equation that it states with them."""
_STUCK_SHARE = 0.02  # share of the range by which others must move for a reading that repeats itself to count as stuck


def equation_of(problem: Problem, sense: int = 1, interval: float = 1e-3, dt: float | None = None) -> OnEquation:
    """Return an equation on a log, under effects that act in a sense; an interval, s, serves without a time column."""
    X, roles, codes = problem.X, dict(problem.roles), problem.codes
    given = {role: X[column].to_numpy(dtype=float) for role, column in roles.items() if column in X}
    dt = sampling_interval(given, codes, interval) if dt is None else dt

    def on(T: pd.DataFrame) -> Callable[[Table], np.ndarray]:
        return lambda table: np.asarray(problem.nominal(T.assign(**{roles[r]: table[r] for r in given})), dtype=float)

    def usual(n: int) -> Callable[[Table], np.ndarray]:
        return on(pd.DataFrame(np.tile(X.median().to_numpy(), (n, 1)), columns=X.columns))

    units = told_units(problem.equation, is_contraction(problem.plant, roles), problem.units)
    signals, starts = role_signals(given, codes, dt, problem.equation), np.flatnonzero(np.diff(codes, prepend=-1))
    return OnEquation(signals, on(X), dt, starts, problem.equation, problem.plant, units, sense, usual)


def evidence_on(
    problem: Problem, equation: OnEquation, simulator: Simulator | None = None, without: np.ndarray | None = None,
    position: float | None = None, noise: np.ndarray | None = None, again: Again | None = None, refit: bool = False,
) -> SignalEvidence:  # fmt: skip
    """Return the evidence; `position` is a strain of one, `noise` are draws, `again` frees numbers with a tolerance."""
    columns, contraction = dict(problem.roles), is_contraction(problem.plant, problem.roles)
    if simulator is not None:  # rates that a log lacks are named after their signals
        rates = {"velocity": "position", "pressure_rate": "pressure"}
        columns = {rate: f"d{columns[of]}" for rate, of in rates.items() if of in columns} | columns
    names = [str(problem.groups[k]) for k in equation.starts]

    def under(numbers: np.ndarray) -> Stated:
        assert again is not None
        there, y = again(numbers), problem.y
        unit = 1.0 if np.array_equal(y, there.y) else float(y @ y) / float(y @ there.y)
        return Stated(equation_of(there, equation.sense, dt=equation.dt), there.y, there.fitted, unit)

    found = SignalEvidence(
        Stated(equation, problem.y, problem.fitted), names, columns, position, contraction, without, simulator, noise,
        under if again is not None else None, refit,
    )  # fmt: skip
    if not len(found.first):
        raise ShortTrajectoryError("No run is as long as one window.", "runs of 20 ms at least", "Record longer runs.")
    return found


def facing(
    problem: Problem, sense: str | int = "auto", effects: str | Sequence[str] = "all",
    simulator: Simulator | None = None, interval: float = 1e-3, position: float | None = None,
    noise: np.ndarray | None = None, again: Again | None = None, refit: bool = False,
) -> SignalEvidence:  # fmt: skip
    """Return the evidence on one equation, under effects that act in the sense that explains more."""
    equation = equation_of(problem, 1 if sense == "auto" else int(sense), interval)
    without, notes = checked(problem, equation)
    found = evidence_on(problem, equation, simulator, without, position, noise, again, refit)
    # The tension, or the flow, of a muscle that is known is what it delivers.
    if sense == "auto" and problem.plant is None:
        known = [t for name in found.library(effects) for t in templates(found, name)]
        if sense_of(found, known) < 0:
            equation = equation_of(problem, -1, interval)
            found = evidence_on(problem, equation, simulator, without, position, noise, again, refit)
    found.notes += [*problem.notes, *notes]
    return found


def checked(problem: Problem, equation: OnEquation) -> tuple[np.ndarray, list[str]]:
    """Return the rows that are left out, and notes on the signals; raise where none can be used."""
    signals, y, codes = equation.table, problem.y, problem.codes
    driven = [x for role, x in signals.items() if role in problem.roles and role not in ("time", "flow")]
    if not any(np.ptp(x) > 0 for x in driven):
        what = f"None of the signals {', '.join(signals)} moves."
        raise ExcitationError(what, "motion", "Record runs in which position changes.")
    notes = _notes(signals, codes, problem.roles)
    moving = {k: v for k, v in signals.items() if k in ("position", "pressure", "command")}
    stuck = stuck_beside(y, moving, codes)
    if stuck.any():
        share = f"{100 * stuck.mean():.1f} %"
        what = f"y repeats one value in {share} of the rows while others move: a clipped or stuck sensor."
        notes.append(f"{what} Those rows are left out.")
    without = stuck if problem.counts is None else stuck | ~problem.counts
    if without.all():
        raise ExcitationError("No row is left.", "rows that meet the condition", "Correct where=.")
    return without, notes


def _notes(signals: Table, codes: np.ndarray, roles: Mapping[str, str]) -> list[str]:
    notes: list[str] = []
    if "time" in signals:
        steps, same = np.diff(signals["time"]), np.diff(codes) == 0
        if np.any(steps[same] < 0):
            raise TimeOrderError("Time runs backwards within a run.", "rows in order of time", "Sort each run.")
        each = [float(np.median(s)) for k in np.unique(codes) if len(s := steps[same & (codes[1:] == k)])]
        if each and max(each) > 1.1 * min(each):
            notes.append(
                f"The runs are sampled every {min(each):.3g} to {max(each):.3g} s; the median is used, so time "
                "constants are uncertain by as much."
            )
    if "position" in signals and not {"position", "velocity"} & set(roles):
        notes.append(
            "No column is a position: effects that depend on it are computed from the drive of the system instead."
        )
    return notes


def sampling_interval(signals: Table, codes: np.ndarray, otherwise: float = 1e-3) -> float:
    """Return the sampling interval that the times of signals tell, s; another where they do not."""
    steps = np.diff(signals["time"])[np.diff(codes) == 0] if "time" in signals else np.zeros(0)
    steps = steps[steps > 0]
    return float(np.median(steps)) if len(steps) else float(otherwise)


def role_signals(given: dict[str, np.ndarray], codes: np.ndarray, dt: float, equation: str) -> dict[str, np.ndarray]:
    """Return the signals by role; a missing velocity is differentiated, a missing position is the command or force."""
    signals = dict(given)
    if "position" not in signals and "velocity" not in signals:
        driving = next((r for r in ("command", "force", "pressure") if r in signals), None)
        if driving and not (driving == "pressure" and equation == "flow"):
            signals["position"] = signals[driving]
    return with_rates(signals, codes, dt)


def is_contraction(plant: Plant | None, columns: Mapping[str, str]) -> bool:
    """Return whether the position is a contraction ratio."""
    return plant is not None or columns.get("position", "").lower().startswith(("eps", "contraction"))


def told_units(equation: str, contraction: bool, given: Mapping[str, str] | None) -> Units:
    """Return the units in which parameters are told: SI of a muscle, else as given."""
    si = {"target": "kg/s" if equation == "flow" else "N", "position": "-", "pressure": "Pa"}
    unnamed = {role: f"{role} unit" for role in si}
    return Units(**{**(si if contraction else unnamed), **(given or {})})


def stated(log: pd.DataFrame, simulator: Simulator, refit: bool = False) -> SignalEvidence:
    """Return the evidence on the equation that a simulator states."""

    def again(numbers: np.ndarray) -> Problem:
        changed = dict(zip(simulator.parameters, map(float, numbers), strict=True))
        other = Simulator.with_(simulator, changed)  # on the way to a fit a number may be implausible
        problem = other.problem(log)
        return problem._replace(fitted=problem.fitted or other)

    problem = again(simulator.numbers)
    noise = noise_of(problem, problem.fitted, log)
    found = facing(problem, simulator.sense, simulator=simulator, noise=noise, again=again, refit=refit)
    found.notes = [*(simulator.doubts(log) or ()), *found.notes]
    return found


def noise_of(problem: Problem, simulator: Simulator, log: pd.DataFrame) -> np.ndarray:
    """Return the noise of the residual at each row, from copies of the log with as much noise again."""
    rng, drawn = np.random.RandomState(0), np.zeros((REPLICATES, len(problem.y)))
    runs = list(log.groupby("trajectory", sort=False).indices.values())
    sigma = {}
    for name in (p.name for p in simulator.ports if p.name in log.columns):
        x = log[name].to_numpy(dtype=float)
        power = [channel_noise(known, 1).white for at in runs if len(known := x[at][np.isfinite(x[at])]) > 4]
        sigma[name] = float(np.sqrt(np.mean(np.square(power)))) if power else 0.0
    plain = problem.y - problem.nominal(problem.X)
    for k in range(REPLICATES):
        noisy = {n: log[n] + s * rng.standard_normal(len(log)) for n, s in sigma.items() if s > 0.0}
        again = simulator.problem(log.assign(**noisy))
        left = pd.Series(again.y - again.nominal(again.X), again.X.index).reindex(problem.X.index)
        drawn[k] = (left - plain).fillna(0.0)
    return drawn


def fitted_together(logs: Mapping[str, pd.DataFrame], each: Sequence[Simulator]) -> list[Simulator]:
    """Return each log's simulator of its equation, with its fitted numbers shared by all logs that state the same."""
    alike: dict[str, dict[str, pd.DataFrame]] = {}
    for (name, log), simulator in zip(logs.items(), each, strict=True):
        alike.setdefault(repr(simulator.identity()), {})[name] = log
    return [s.fitted_to(alike[repr(s.identity())]) for s in each]


def stuck_beside(x: np.ndarray, others: Table, codes: np.ndarray) -> np.ndarray:
    """Return the rows in which a reading stays at one value for long while other signals move: clipped or stuck."""
    least = [(v, 5 * _STUCK_SHARE * max(float(np.ptp(v)), 1e-300)) for v in others.values()]
    return stuck_rows(x, lambda a, b: any(np.ptp(v[a:b]) > size for v, size in least), codes)


def plain(found: Diagnosis) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """Return a diagnosis without its table, and the table's columns as arrays."""
    out = ("windows", "nominal", "corrected", "rivals", "logs", "changes", "rounds")
    fields = {k: v for k, v in vars(found).items() if k not in out}
    columns = {
        str(k): np.asarray(v.to_numpy(), dtype=str if v.dtype == object else None) for k, v in found.windows.items()
    }
    return fields, columns


def rebuilt(fields: Mapping[str, Any], columns: Mapping[str, np.ndarray]) -> Diagnosis:
    """Return the diagnosis that `plain` took apart."""
    table = {k: v.astype(object) if v.dtype.kind == "U" else v for k, v in columns.items()}
    now = {"next_run" if k == "next_experiment" else k: v for k, v in fields.items()}  # files of format 2
    return Diagnosis(**now, nominal=None, corrected=None, windows=pd.DataFrame(table))
