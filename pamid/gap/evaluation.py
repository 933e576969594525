"""The error of a simulator with ports on a log, beside the noise of the sensors."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING

import numpy as np

from ..equations.base import Residual
from ..equations.evaluate import LogEvaluation, Sums, summed
from ..errors import SimulatorWarning
from ..signals.frames import as_pandas
from ..simulators.base import Simulator
from .inference.student_t import solve
from .one_equation import equation_of, evidence_on, noise_of
from .simulated import evidence_of

if TYPE_CHECKING:
    import pandas as pd

    from .residuals.ports import PortEvidence


def residuals_of(log: pd.DataFrame, simulator: Simulator) -> PortEvidence:
    """Return the residuals of a simulator with ports, or of its equation, on a log, in the units there."""
    if not simulator.states_equation:
        return evidence_of(log, simulator)
    problem = simulator.problem(log)
    noise = noise_of(problem, problem.fitted or simulator, log)
    return evidence_on(problem, equation_of(problem), simulator, noise=noise)


def evaluate_simulator(
    log: pd.DataFrame | Iterable[pd.DataFrame], simulator: Simulator, *, progress: Callable[[str], None] | None = None
) -> LogEvaluation:
    """Evaluate a simulator with ports on a log.

    Clocks that are half a sample aside, and how inputs act within a sample, are allowed for as in a diagnosis.

    Parameters
    ----------
    log : DataFrame or iterable of DataFrame
        ``trajectory``, ``time`` (s) and the columns that the simulator's ports name; or pieces of such a log, each of
        whole runs.
    simulator : Simulator
        The simulator, its effects included.
    progress : callable, optional
        Called with a short text for each piece.

    Returns
    -------
    LogEvaluation
        For each equation its root mean square residual, the same relative to the standard deviation of the target, and
        the noise floor that the sensors' own noise leaves, over all and by run.

    Raises
    ------
    MissingColumnError, ShortTrajectoryError, SimulatorRunError
        The log cannot be used, or the simulator does not run on it.

    Examples
    --------
    >>> import numpy as np, pandas as pd
    >>> from pamid.gap import evaluate_simulator
    >>> from pamid.simulators import FunctionSimulator, Port
    >>> t = np.arange(0.0, 4.0, 0.01)
    >>> log = pd.DataFrame({"trajectory": "a", "time": t, "P": 1e5 * np.sin(t), "F": 50.0 * np.sin(t) + 2.0})
    >>> ports = [Port("P", "input", "Pa"), Port("F", "output", "N")]
    >>> piston = FunctionSimulator(lambda u, p: u.P * p.area, ports, {"area": (5e-4, 0.0, "m^2")})
    >>> found = evaluate_simulator(log, piston)["F"]
    >>> f"{found.rmse:.2f} {found.unit}"
    '2.00 N'
    """
    import pandas as pd

    say = progress or (lambda _: None)
    sums: dict[str, dict[str, Sums]] = {}
    units: dict[str, str] = {}
    log = as_pandas(log)
    for piece in [log] if isinstance(log, pd.DataFrame) else simulator.pieces(log):
        say("the log")
        evidence = residuals_of(piece, simulator)
        _warn_of_idle(evidence)
        units |= evidence.units
        residuals = _timed(evidence)
        for equation, part in zip(evidence.equations, evidence.parts, strict=True):
            for k, name in enumerate(evidence.trajectories):
                mine = evidence.run[part] == k
                value, noise, measured, time = (
                    x[part][mine] for x in (residuals, evidence.noise, evidence.measured, evidence.time)
                )
                if len(value):
                    windows = Residual(time, value[:, None], measured[:, None], noise[:, None])
                    sums.setdefault(equation, {}).setdefault(name, Sums()).add(windows)
    return LogEvaluation({name: summed(runs, units[name]) for name, runs in sums.items()}, {})


def _timed(evidence: PortEvidence) -> np.ndarray:
    """Return the residuals with the unknowns within a sample fitted: clocks, and how inputs act there."""
    # Whether inputs are held or go in lines is decided with that fitted: errors before and after a correction compare.
    own = np.array([name in evidence.skews for name in evidence.free], dtype=bool)
    if not own.any():
        return evidence.value
    low, high = (end[own] for end in evidence.ends)
    x = solve(evidence.z0, evidence.J[:, own], low, high, evidence.parts, evidence.weights).x
    names = [name for name, known in zip(evidence.free, own, strict=True) if known]
    return evidence.value + sum(evidence.skews[name] * float(v) for name, v in zip(names, x, strict=True))


def _warn_of_idle(evidence: PortEvidence) -> None:
    """Warn of effects of the simulator that a log leaves without anything to act on."""
    for name, where, _ in evidence.simulator.effects:
        if f"{name}@{where}" not in evidence.effects:
            warnings.warn(
                f"The simulator's own effect {name} at {where} cannot act on this log, where nothing moves there: the "
                "simulator is evaluated without it.",
                SimulatorWarning,
                stacklevel=3,
            )
