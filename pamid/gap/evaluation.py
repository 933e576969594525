"""The error of a simulator on a log, beside the noise of the sensors."""

import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping

import numpy as np
import pandas as pd

from ..bench.parameters import BenchParameters
from ..equations.base import Residual
from ..equations.evaluate import LogEvaluation, Sums, evaluate_log, summed
from ..errors import ExcitationWarning
from ..face import check_simulator
from ..signals.frames import logs_as_pandas
from ..simulators.base import Simulator
from .inference.student_t import solve
from .one_equation import equation_of, evidence_on, noise_of
from .residuals.ports import PortEvidence, idle
from .residuals.shooting import ShootingEvidence
from .simulated import evidence_of


def residuals_of(log: pd.DataFrame, simulator: Simulator, like: PortEvidence | None = None) -> PortEvidence:
    """Return the residuals of a simulator on a log, in the units there; predictions over the stretches of another."""
    if isinstance(like, ShootingEvidence):
        return ShootingEvidence(like.log, simulator, lines=like.lines, like=like)
    if not simulator.states_equation:
        return evidence_of(log, simulator)
    problem = simulator.problem(log)
    noise = noise_of(problem, problem.fitted or simulator, log)
    return evidence_on(problem, equation_of(problem), simulator, noise=noise)


def evaluate(
    log: pd.DataFrame | Iterable[pd.DataFrame] | Mapping[str, pd.DataFrame],
    simulator: BenchParameters | Simulator,
    *,
    progress: Callable[[str], None] | None = None,
) -> LogEvaluation:
    """Return how far a simulator of any kind is off on a log, equation by equation, beside the noise of the sensors.

    At ports, clocks half a sample aside, and how inputs act within a sample, are allowed for as in a diagnosis.

    Parameters
    ----------
    log : DataFrame, iterable of DataFrame or mapping of str to DataFrame
        ``trajectory``, ``time`` (s) and the simulator's signals; or several logs, or pieces of one, each of whole runs.
    simulator : BenchParameters or Simulator
        The simulator.
    progress : callable, optional
        Called with a short text at each step.

    Returns
    -------
    LogEvaluation
        For each equation the root mean square residual over windows, the same over the standard deviation of what was
        measured, and the noise floor.

    Raises
    ------
    ParameterError
        ``simulator`` is none.
    MissingColumnError, ShortTrajectoryError, SimulatorRunError
        The log cannot be used, or the simulator does not run on it.

    Examples
    --------
    >>> import pamid
    >>> bench = pamid.BenchParameters.for_muscle("B")
    >>> from pamid.bench import sine
    >>> found = pamid.evaluate(pamid.simulate(bench, [sine(4, 15, 400)]), bench)
    >>> found["force"].rmse < 2.0 * found["force"].noise_floor  # N
    True
    """
    check_simulator(simulator)
    say = progress or (lambda _: None)
    log = logs_as_pandas(log)
    log = list(log.values()) if isinstance(log, Mapping) else log
    if not isinstance(simulator, Simulator):
        return evaluate_log(log, simulator, progress=progress)

    def residuals() -> Iterator[PortEvidence]:
        for piece in [log] if isinstance(log, pd.DataFrame) else simulator.pieces(log):
            say("the log")
            evidence = residuals_of(piece, simulator)
            _warn_of_idle(evidence)
            yield evidence

    return errors_of(residuals())


def errors_of(residuals: Iterable[PortEvidence]) -> LogEvaluation:
    """Return the errors of residuals, as sums over all of them."""
    sums: dict[str, dict[str, Sums]] = {}
    units: dict[str, str] = {}
    for evidence in residuals:
        units |= evidence.units
        left = timed(evidence)
        for equation, part in zip(evidence.equations, evidence.parts, strict=True):
            for k, name in enumerate(evidence.trajectories):
                mine = evidence.run[part] == k
                value, noise, measured, time = (
                    x[part][mine] for x in (left, evidence.noise, evidence.measured, evidence.time)
                )
                if len(value):
                    windows = Residual(time, value[:, None], measured[:, None], noise[:, None])
                    sums.setdefault(equation, {}).setdefault(name, Sums()).add(windows)
    return LogEvaluation({name: summed(runs, units[name]) for name, runs in sums.items()}, {})


def timed(evidence: PortEvidence) -> np.ndarray:
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
    """Warn of effects of the simulator that have nothing to act on in a log."""
    for name, where, _ in evidence.simulator.effects:
        if f"{name}@{where}" not in evidence.effects:
            warnings.warn(
                f"{idle(name, where)} Expected a log in which its port moves. The simulator is evaluated without it.",
                ExcitationWarning,
                stacklevel=3,
            )


evaluate_simulator = evaluate
