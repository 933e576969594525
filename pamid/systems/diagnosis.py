"""The diagnosis of a system: its one equation, held against a log."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..signals.roles import STATE_ROLES
from .base import System
from .reference import doubts

if TYPE_CHECKING:
    import pandas as pd

    from ..gap.diagnosis.findings import NextExperiment
    from ..gap.diagnosis.result import Diagnosis


def diagnose_system(
    log: pd.DataFrame,
    system: System,
    effects: str | Sequence[str] = "all",
    *,
    rows: np.ndarray | None = None,
    seed: int = 0,
    progress: Callable[[str], None] | None = None,
) -> Diagnosis:
    """Diagnose where a system and its nominal equation disagree, which effect is the cause, and how far the gap closes.

    Parameters
    ----------
    log : DataFrame
        Tidy log with the system's `inputs`; rows with missing values are left out.
    system : System
        The system, such as ``Cylinder(bore=0.025)``.
    effects : "all" or sequence of str, default="all"
        Effects that may be causes; "all" are those that the system allows.
    rows : array of bool, shape (n_samples,), optional
        Rows of the log that count; windows with any other are left out, but memory of effects runs through them.
    seed : int, default=0
        Seed of the draws behind p-values and intervals.
    progress : callable, optional
        Called with a short text at each step.

    Returns
    -------
    Diagnosis
        The answer.

    Raises
    ------
    MissingColumnError
        The log lacks a signal of the system.
    ExcitationError
        Nothing moves.

    Examples
    --------
    >>> import numpy as np, pandas as pd
    >>> from pamid.systems import diagnose_system
    >>> from pamid.systems.cylinder import Cylinder
    >>> rng, t = np.random.default_rng(0), np.arange(0, 20, 0.005)
    >>> runs = []
    >>> for k, w in enumerate((1.0, 2.0, 3.0)):
    ...     x = 0.02 + 0.015 * np.sin(w * t)
    ...     F = 4.909e-4 * 2e5 + 60 * 0.015 * w * np.cos(w * t) + 0.1 * rng.standard_normal(len(t))
    ...     P = 301325.0 + 20.0 * rng.standard_normal(len(t))
    ...     runs.append(pd.DataFrame({"trajectory": str(k), "time": t, "x": x, "P": P, "F": F}))
    >>> found = diagnose_system(pd.concat(runs), Cylinder(bore=0.025), ["viscous_friction", "force_bias"])
    >>> found.causes[0].effects
    ('viscous_friction',)
    """
    from ..estimators import GapDiagnoser

    say = progress or (lambda _: None)
    say("read the log")
    signals = [i.name for i in system.inputs if i.name in log.columns]
    whole = log[["time", *signals]].notna().all(axis=1).to_numpy()
    clean = log[whole].reset_index(drop=True)
    problem = system.problem(clean)
    notes = [*doubts(clean, system), *problem.notes]
    if len(clean) < len(log):
        notes.append(f"{100 * (1 - len(clean) / len(log)):.1f} % of the rows have a missing value and are left out.")
    counted = None if rows is None else np.asarray(rows, dtype=bool)[whole]
    if counted is not None:
        notes.append(f"Only rows that meet the condition are used: {100 * counted.mean():.0f} % of all.")
    one = len(np.unique(problem.groups)) == 1
    diagnoser = GapDiagnoser(
        problem.nominal,
        effects,
        signals=dict(problem.roles),
        equation=problem.equation,
        plant=problem.plant,
        units=dict(problem.units),
        sense=system.sense,
        one_trajectory=one,
        random_state=seed,
    )
    say("compare with the library")
    diagnoser.fit(problem.X, problem.y, groups=problem.groups, where=counted)
    found = diagnoser.diagnosis_
    names = {name: problem.roles.get(role, role) for name, role in STATE_ROLES.items()}
    speed = f"d{problem.roles['position']}" if "position" in problem.roles else "velocity"
    names = {name: speed if label == "velocity" else label for name, label in names.items()}
    regions = [replace(r, query=re.sub(r"\bvelocity\b", speed, r.query)) for r in found.regions]
    taken = [new for old, new in names.items() if new != old and new in found.windows.columns]
    windows = found.windows.drop(columns=taken).rename(columns=names)  # a stroke is not a contraction
    sense = -1 if diagnoser.scaling_.target < 0 else 1
    nominal: Any = system
    causes = list(diagnoser.effects_.items())
    corrected: Any = system.corrected(causes, sense, problem.unit) if causes else system
    told = [*notes, *found.notes]
    if found.next_experiment is not None:
        found = replace(found, next_experiment=_in_columns(found.next_experiment, problem.roles))
    return replace(found, nominal=nominal, corrected=corrected, windows=windows, regions=regions, notes=told)


def _in_columns(run: NextExperiment, roles: Mapping[str, str]) -> NextExperiment:
    """Return a designed run with the names of the log's signals in place of roles."""
    roles_first = sorted(roles, key=len, reverse=True)

    def column(key: str) -> str:
        role = next((r for r in roles_first if key == r or key.startswith(f"{r}_")), "")
        return roles[role] + key[len(role) :] if role else key

    return replace(run, trajectory={column(key): value for key, value in run.trajectory.items()})
