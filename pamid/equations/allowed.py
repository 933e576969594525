"""The residuals of the equations that a log allows."""

from collections.abc import Iterator, Sequence

import pandas as pd

from ..bench.parameters import BenchParameters
from ..errors import MissingColumnError
from ..names import require_one_of
from .base import Equation, Residual, all_equations
from .log import BenchLog, columns_of
from .run import Model, Run
from .stretch import HALF
from .windows import WINDOW

CHANNELS = ("P", "F", "mdot", "u")
"""Channels that a run may have beside the angle."""


def allowed_equations(log: BenchLog, names: Sequence[str] | None = None) -> tuple[dict[str, Equation], dict[str, str]]:
    """Return the equations that the columns of a log allow, and the missing columns of each other."""
    known, columns = all_equations(), log.table.columns
    if lacking := [column for column in ("time", "q") if column not in columns]:
        raise MissingColumnError(
            f"The log lacks {' and '.join(lacking)}; it has {', '.join(map(str, columns[:20]))}.",
            "time in s and the joint angle q in rad, which every equation needs",
            "Map your columns to these names.",
        )
    for name in names or ():
        require_one_of(name, known, f"There is no equation {name!r}.")
    allowed: dict[str, Equation] = {}
    skipped: dict[str, str] = {}
    for name, equation in known.items():
        if names is not None and name not in names:
            continue
        needed = [column for channel in equation.channels for column in columns_of(channel)]
        missing = [column for column in needed if not log.reads(column)]
        if equation.without and names is None and log.holds(equation.without):
            continue
        if not missing:
            allowed[name] = equation
        elif not equation.combines:
            skipped[name] = f"{name} needs {', '.join(needed)}; the log lacks {', '.join(missing)}"
    for equation in allowed.values():
        for name in set(equation.combines) & set(skipped):
            skipped[name] += f"; it is tested together with {' and '.join(set(equation.combines) - {name})} instead"
    return allowed, skipped


def residuals(
    log: pd.DataFrame | BenchLog, params: BenchParameters, equations: Sequence[str] | None = None, *, noise: bool = True
) -> Iterator[tuple[str, str, Residual]]:
    """Go through a log and give the residual of each equation on each evenly sampled stretch.

    Parameters
    ----------
    log : DataFrame
        Log of the bench: ``trajectory``, ``time`` (s), ``q`` (rad), ``P1``, ``P2`` (Pa, absolute), ``F1``, ``F2`` (N),
        ``mdot1``, ``mdot2`` (kg/s), ``u1``, ``u2``; an equation is left out if the log lacks what it reads.
    params : BenchParameters
        The simulator, its effects included.
    equations : sequence of str, optional
        Names of the equations; all by default.
    noise : bool, default=True
        Whether residuals come with their noise; zeros otherwise, in less time.

    Yields
    ------
    trajectory : str
        Name of the run.
    equation : str
        Name of the equation.
    residual : Residual
        Its windows; a stretch too short for one window gives none.

    Examples
    --------
    >>> from pamid.bench import BenchParameters, simulate, sine
    >>> from pamid.equations import residuals
    >>> bench = BenchParameters.for_muscle("B")
    >>> for trajectory, equation, r in residuals(simulate(bench, [sine(4, 15, 400)]), bench, ["force", "flow"]):
    ...     print(trajectory, equation, len(r.value))
    sine-4-15 force 20
    sine-4-15 flow 18
    """
    log = BenchLog.of(log)
    allowed, _ = allowed_equations(log, equations)
    if not allowed:
        return
    wanted = {c for e in allowed.values() for c in e.channels} - {"q"}
    model = Model(params, noise=noise)
    if model.effects:  # effects read channels that the equations themselves do not
        wanted |= {c for c in CHANNELS if all(k in log.table.columns for k in columns_of(c))}
    for run in log.runs(model, sorted(wanted)):
        for equation in allowed.values():
            residual = window_residual(equation, run)
            if residual is not None:
                yield run.trajectory, equation.name, residual


def window_residual(equation: Equation, run: Run) -> Residual | None:
    """Return the residual of an equation on a run, None if the run lacks a channel or is too short for a window."""
    if len(run.time) < equation.order * run.n + equation.order + sum(run.margins) or not run.reads(equation):
        return None
    if not len(run.windows(equation).first):
        return None
    return equation.residual(run)


def without_windows(equation: Equation) -> str:
    """Return why an equation has no windows on a log that has its columns."""
    return (
        f"{equation.name} needs {equation.order * WINDOW + 0.01:.2f} s of {', '.join(equation.channels)} together, "
        f"without a hole longer than {HALF * WINDOW:g} s; the log has no such stretch"
    )
