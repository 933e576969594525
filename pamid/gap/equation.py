"""Diagnose one equation: that of an estimator's table, or the one that a simulator states on its logs."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..errors import ShortTrajectoryError
from ..signals.roles import STATE_ROLES
from ..simulators.base import Simulator
from ..simulators.problem import Problem, joined
from .design.equation import next_for_equation
from .diagnosis.findings import NextExperiment
from .diagnosis.result import Diagnosis
from .engine import explain
from .one_equation import Gathered, Measured, gather, library_for
from .residuals.single import SignalEvidence
from .several.conditions import Conditions, conditions_of
from .several.engine import naming, refuse_twice, sized, together
from .several.stacked import Log
from .simulated import in_units

if TYPE_CHECKING:
    import pandas as pd

NOISE = (
    "The noise is estimated from differences between neighbouring samples and between repeated runs. A learner on the "
    "same signals and their past predicts {:.0f} % of the gap on held-out runs."
)
ADDS = "Effects add to y: the target is the driving force, not the delivered one."


class Answer(NamedTuple):
    """A diagnosis of one equation, what it is made from, and the rows that were left out."""

    found: Diagnosis
    gathered: Gathered
    without: np.ndarray


def diagnose_equation(m: Measured, library: Sequence[str], sense: str | int, seed: np.random.RandomState) -> Answer:
    """Diagnose one equation on one log."""
    without, notes = m.checked()
    gathered = gather(m, library, sense, without)
    found = explain(gathered.evidence, library, seed, [*_heard(gathered), *notes])
    return Answer(_outward(found, m, gathered), gathered, without)


def _heard(gathered: Gathered) -> list[str]:
    return [NOISE.format(100 * gathered.share)] + ([ADDS] if gathered.evidence.scales.target < 0 else [])


def _outward(found: Diagnosis, m: Measured, gathered: Gathered) -> Diagnosis:
    told = in_units(found, gathered.evidence.placements)
    return replace(told, next_experiment=next_for_equation(found.rivals, m, gathered))


# --- simulators that state their equation -------------------------------------------------------------------
def stated_evidence(log: pd.DataFrame, simulator: Simulator) -> SignalEvidence:
    """Return the evidence on the equation that a simulator states, in the units of the log."""
    problem = simulator.problem(log)
    m = Measured.of(problem)
    found = m.evidence()
    found.log = m.log
    for k, name in enumerate(dict.fromkeys(problem.groups.tolist())):
        if (mine := found.run == k).any():
            found.noise[mine] = problem.noise(np.flatnonzero(problem.groups == name), found.n)
    if not len(found.first):
        raise ShortTrajectoryError("No run is as long as one window.", "runs of 20 ms at least", "Record longer runs.")
    return found


def diagnose_stated(
    log: pd.DataFrame | Mapping[str, pd.DataFrame],
    simulator: Simulator,
    effects: str | Sequence[str],
    conditions: Mapping[str, Conditions] | None,
    seed: int,
    say: Callable[[str], None],
) -> Diagnosis:
    """Diagnose the equation that a simulator states, on one log or on several."""
    rng = np.random.RandomState(np.random.RandomState(seed).randint(2**31 - 1))
    if not isinstance(log, Mapping):
        problem, doubts = simulator.problem(log), simulator.doubts(log)
        m = Measured.of(problem)
        say("compare with the library")
        answer = diagnose_equation(m, _library(effects, m), simulator.sense, rng)
        causes = [(c.effects[0], {k: p.value for k, p in c.parameters.items()}) for c in answer.found.causes]
        notes = [*doubts, *problem.notes]
        return _named(answer.found, simulator, problem, causes, answer.gathered, notes)
    held = conditions_of(list(log), conditions)
    problem, owner = _of_logs(log, simulator, held)
    m = Measured.of(problem)
    say("compare with the library")
    found, gathered = _several(log, m, owner, held, _library(effects, m), simulator.sense, rng, say)
    found = _outward(found, m, gathered)
    last = {name: {k: p.value for k, p in values.items()} for name, values in found.logs[-1].parameters.items()}
    doubts = [f"{name}: {text}" for name, one in log.items() for text in simulator.doubts(one)]
    if problem.fitted is not None:
        problem = problem._replace(fitted=held[-1].under(problem.fitted))
    return _named(found, held[-1].under(simulator), problem, list(last.items()), gathered, [*doubts, *problem.notes])


def _library(effects: str | Sequence[str], m: Measured) -> list[str]:
    return library_for(effects, m.equation, m.plant is not None, m.units)


def _of_logs(
    logs: Mapping[str, pd.DataFrame], simulator: Simulator, held: Sequence[Conditions]
) -> tuple[Problem, np.ndarray]:
    """Return the equation of several logs as one, and the log of each row; logs of the same numbers are fitted as one.

    An error names its log.
    """
    import pandas as pd

    apart: dict[str, list[pd.DataFrame]] = {}
    under, of_run = dict[str, Simulator](), dict[str, int]()
    for k, ((name, log), conditions) in enumerate(zip(logs.items(), held, strict=True)):
        here = conditions.under(simulator)
        with naming(name):
            here.problem(log)
        runs = [f"{name}: {run}" for run in log["trajectory"]]
        of_run |= dict.fromkeys(runs, k)
        key = repr(sorted(conditions.numbers.items()))
        under[key] = here
        apart.setdefault(key, []).append(log.assign(trajectory=runs))
    problem = joined([under[key].problem(pd.concat(some, ignore_index=True)) for key, some in apart.items()])
    return problem, np.array([of_run[run] for run in problem.groups])


def _several(
    logs: Mapping[str, pd.DataFrame], m: Measured, owner: np.ndarray, held: Sequence[Conditions],
    library: Sequence[str], sense: str | int, rng: np.random.RandomState, say: Callable[[str], None],
) -> tuple[Diagnosis, Gathered]:  # fmt: skip
    """Return the joint diagnosis of several logs in typical units: causes are shared unless one came or went."""
    refuse_twice(logs)
    without, notes = m.checked()
    gathered = gather(m, library, sense, without)
    each = list[Log]()
    for k, (name, c) in enumerate(zip(logs, held, strict=True)):
        rows = np.flatnonzero(owner == k)
        one = m.evidence(gathered.evidence.scales, slice(rows[0], rows[-1] + 1), without)
        one.assume(gathered.noise)
        one.weights, one.stretch = gathered.evidence.weights, gathered.evidence.stretch
        one.trajectories = [run.removeprefix(f"{name}: ") for run in one.trajectories]
        each.append(Log(name, one, c.day))
    found, *_ = together(each, library, gathered.evidence.effects, [*_heard(gathered), *notes], rng, say)
    sizes = [(len(log), log["trajectory"].nunique()) for log in logs.values()]
    return replace(found, logs=sized(found.logs, sizes, held)), gathered


def state_names(problem: Problem) -> dict[str, str]:
    """Return what the log calls the columns of the state: a stroke is not a contraction."""
    names = {name: problem.roles.get(role, role) for name, role in STATE_ROLES.items()}
    return names | {"deps": f"d{problem.roles['position']}" if "position" in problem.roles else "velocity"}


def _named(
    found: Diagnosis, simulator: Simulator, problem: Problem, causes: Sequence[tuple[str, Mapping[str, float]]],
    gathered: Gathered, notes: Sequence[str],
) -> Diagnosis:  # fmt: skip
    """Return a diagnosis in the names of the log's signals, with the simulator and the corrected one."""
    names = state_names(problem)
    speed = names["deps"]
    taken = [new for old, new in names.items() if new != old and new in found.windows.columns]
    corrected: Any = problem.fitted or simulator
    if causes:
        corrected = corrected.corrected(causes, -1 if gathered.evidence.scales.target < 0 else 1, problem.unit)
    run = found.next_experiment
    return replace(
        found,
        nominal=simulator,
        corrected=corrected,
        windows=found.windows.drop(columns=taken).rename(columns=names),
        regions=[replace(r, query=re.sub(r"\bvelocity\b", speed, r.query)) for r in found.regions],
        notes=[*notes, *found.notes],
        next_experiment=run and _in_columns(run, problem.roles),
    )


def _in_columns(run: NextExperiment, roles: Mapping[str, str]) -> NextExperiment:
    """Return a designed run with the names of the log's signals in place of roles."""
    roles_first = sorted(roles, key=len, reverse=True)

    def column(key: str) -> str:
        role = next((r for r in roles_first if key == r or key.startswith(f"{r}_")), "")
        return roles[role] + key[len(role) :] if role else key

    return replace(run, trajectory={column(key): value for key, value in run.trajectory.items()})
