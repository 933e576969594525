r"""Refit a simulator to a log recorded in closed loop, with instruments that no noise of the log reaches.

Under feedback the noise of a reading comes back in the command, and least squares are then biased. With the windowed
residuals r of the equations, their sensitivities A at the readings, and the same sensitivities Z at states and commands
of a simulated closed loop, which the logged reference drives alone,

.. math:: \hat\theta = \theta - (Z^\top A)^{-1} Z^\top r, \qquad
    \operatorname{cov}\hat\theta = (Z^\top A)^{-1}\, Z^\top \Omega Z\, (A^\top Z)^{-1}

where Ω is the covariance of what remains, estimated along each run (W. K. Newey, K. D. West). From r what the same
windows and derivatives leave of the simulated loop is subtracted, so that their own errors cancel. The simulated
controller is a linear law of reference, its rate, states and the integral of the error, held over each sample and
fitted to the log by least squares: where it is inexact, the estimates become less sure, but not biased.

References
----------
A. Janot, P. O. Vandanjon, M. Gautier, "A generic instrumental variable approach for industrial robot identification",
IEEE Transactions on Control Systems Technology 22(1), 2014. https://doi.org/10.1109/TCST.2013.2246163

W. K. Newey, K. D. West, "A simple, positive semi-definite, heteroskedasticity and autocorrelation consistent covariance
matrix", Econometrica 55(3), 1987. https://doi.org/10.2307/1913610
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Annotated, Any, NamedTuple

import numpy as np
import pandas as pd

from ..bench.parameters import BenchParameters
from ..errors import FitError, IncompatibleError, MissingColumnError, ParameterError
from ..explained import explained_fields
from ..simulators.base import Simulator
from ..simulators.integrate import Runner, side_by_side
from ..simulators.port_log import PortLog, port_log
from ..simulators.ports import Port
from .residuals.direct import DirectEvidence
from .residuals.protocol import lanes
from .residuals.states import measured_states
from .residuals.stretches import FOLLOWS
from .residuals.tolerances import SMALL, rms

ROUNDS = 6
"""Most simulations of the closed loop, each with the estimates of the one before."""
ALIKE = 1e-9
"""Relative singular value below which numbers act alike."""
SUBSTEPS = (1, 4, 16)
"""Steps per sample of the simulated loop: more where dry friction or a fast loop needs them."""
REFERENCE = "reference_of_the_loop"
"""Channels of the references, with their number."""


@explained_fields
class Instrumented(NamedTuple):
    """A number that was estimated with instruments, and by least squares on the same equations.

    Examples
    --------
    >>> from pamid.gap import Instrumented
    >>> print(Instrumented(95.1, 0.5, 94.2, "kg").sentence("mass"))
    with instruments: mass 95.1 ± 0.5 kg (least squares: 94.2, 1.8 standard errors lower)
    """

    value: Annotated[float, "The estimate with instruments and its standard error, in the unit of the number."]
    error: Annotated[float, "The estimate with instruments and its standard error, in the unit of the number."]
    least_squares: Annotated[float, "The estimate by least squares."]
    unit: Annotated[str, "The unit."] = "-"

    @property
    def bias(self) -> float:
        """By how much least squares differ, in standard errors of the estimate with instruments."""
        return (self.least_squares - self.value) / self.error if self.error > 0.0 else 0.0

    def as_dict(self) -> dict[str, Any]:
        """Return it as plain data."""
        return {**self._asdict(), "bias": self.bias}

    def sentence(self, name: str) -> str:
        """Return it in words."""
        way, unit = "higher" if self.bias > 0.0 else "lower", "" if self.unit == "-" else f" {self.unit}"
        least = f"least squares: {self.least_squares:.5g}, {abs(self.bias):.1f} standard errors {way}"
        return f"with instruments: {name} {self.value:.5g} ± {self.error:.2g}{unit} ({least})"


class InstrumentalRefit(NamedTuple):
    """A simulator refitted with instruments.

    Parameters
    ----------
    params : Simulator
        The simulator with the estimates.
    estimates : dict of str to Instrumented
        Parameters with a tolerance by name, and sizes of the simulator's own effects as ``effect@port.parameter``.
    beyond : tuple of str
        Parameters that ended beyond their tolerance, and sizes that ended at 0: effects that act the other way.

    Examples
    --------
    >>> from pamid.gap import InstrumentalRefit
    >>> InstrumentalRefit(None, {}, ()).estimates
    {}
    """

    params: Any
    estimates: dict[str, Instrumented]
    beyond: tuple[str, ...]


def refit_with_instruments(log: pd.DataFrame, params: BenchParameters | Simulator, reference: str) -> InstrumentalRefit:
    """Fit the parameters that have a tolerance, and sizes of the simulator's own effects, to a log of a closed loop.

    Parameters
    ----------
    log : DataFrame
        Log that holds all states of the simulator, or positions whose rates the others are, and the reference.
    params : Simulator
        A simulator of states; such as the corrected one of a diagnosis, whose effects are the causes.
    reference : str or sequence of str
        Column, or columns, that the controller was to follow. They must not depend on readings.

    Returns
    -------
    InstrumentalRefit
        The estimates, each beside that of least squares.

    Raises
    ------
    MissingColumnError
        The log lacks the reference.
    ParameterError
        The reference is a signal of the simulator, or nothing is free.
    IncompatibleError
        The log lacks states, the loop is open, or the simulated loop does not follow the log.

    References
    ----------
    A. Janot, P. O. Vandanjon, M. Gautier, "A generic instrumental variable approach for industrial robot
    identification", IEEE Transactions on Control Systems Technology 22(1), 2014.
    https://doi.org/10.1109/TCST.2013.2246163

    Examples
    --------
    >>> import numpy as np, pandas as pd
    >>> from pamid.gap import refit_with_instruments
    >>> from pamid.simulators import EquationSimulator, Port
    >>> t, rng, v, rows = np.arange(0.0, 4.0, 0.01), np.random.default_rng(0), 0.0, []
    >>> for wanted in np.sin(3.0 * t):
    ...     read = v + 0.02 * rng.standard_normal()
    ...     force = 40.0 * (wanted - read)
    ...     rows.append((wanted, read, force))
    ...     v += 0.01 * (force - 3.0 * v) / 2.0
    >>> log = pd.DataFrame(rows, columns=["wanted", "v", "F"]).assign(time=t, trajectory="a")
    >>> ports = [Port("F", "input", "N"), Port("v", "state", "m/s")]
    >>> cart = EquationSimulator({"dv/dt": "(F - c*v)/m"}, ports, {"m": (2.2, 0.5, "kg"), "c": (2.5, 0.5, "N s/m")})
    >>> found = refit_with_instruments(log, cart, "wanted").estimates["m"]
    >>> abs(found.value - 2.0) < 2.0 * found.error
    True
    """
    references = [reference] if isinstance(reference, str) else list(reference)
    evidence = _evidence(log, params, references)
    start = evidence.given
    sizes = _sizes(evidence, start)
    if not sizes:
        raise ParameterError(
            "No parameter of the simulator has a tolerance, and none of its effects has a size to be estimated.",
            "something to estimate",
            "Give parameters a tolerance in the simulator file.",
        )
    spans = {n: abs(v) * start.parameters[n].tolerance if n in start.parameters else abs(v) for n, v in sizes.items()}
    least, _ = _solved(evidence, start, spans, lambda _: None)
    found, errors = _solved(evidence, least, spans, _Loop(evidence, len(references), least).channels)
    values, before = _sizes(evidence, found), _sizes(evidence, least)
    beyond = [n for n, v in values.items() if (abs(v - sizes[n]) > spans[n] if n in start.parameters else v == 0.0)]
    rows = zip(values.items(), errors, strict=True)
    estimates = {n: Instrumented(v, float(e), before[n], _unit(evidence, n)) for (n, v), e in rows}
    return InstrumentalRefit(found, estimates, tuple(beyond))


# --- the log ------------------------------------------------------------------------------------------------
def _evidence(log: pd.DataFrame, simulator: Any, references: Sequence[str]) -> DirectEvidence:
    """Return the equations of a log whose states are known, with the references among its channels."""
    if simulator.form != "ode":
        raise IncompatibleError(
            "Instruments need the rates of the simulator's states, and this simulator does not give them.",
            "a function of rates, equations, or a MuJoCo model", "Refit without instruments.",
        )  # fmt: skip
    own, has = {p.source for p in simulator.ports}, ", ".join(map(str, log.columns[:20]))
    for name in references:
        said = "the column with the motion that the controller was to follow"
        if name in own:
            problem = f"The reference {name!r} is a signal of the simulator: its noise would reach the instruments."
            raise ParameterError(problem, said, "Name that column.")
        if name not in log.columns:
            raise MissingColumnError(f"The log lacks the reference {name!r}; it has {has}.", said, "Name or record it.")
    more = [Port(f"{REFERENCE}_{k}", "input", column=name) for k, name in enumerate(references)]
    at_ports = port_log(log, Simulator([*simulator.ports, *more]))
    derived = measured_states(simulator, at_ports)
    if derived is None:
        lacking = [s for s in simulator.states if s not in at_ports.channels]
        raise IncompatibleError(
            f"The log lacks {', '.join(lacking)}: residuals would be those of predictions from the first readings.",
            "all states, or positions whose rates the others are", "Record them, or refit without instruments.",
        )  # fmt: skip
    return DirectEvidence(at_ports, simulator, derived)


# --- estimates ----------------------------------------------------------------------------------------------
def _sizes(evidence: DirectEvidence, simulator: Simulator) -> dict[str, float]:
    """Return the numbers to estimate: those with a tolerance, and linear sizes of the simulator's own effects."""
    given = evidence.given
    found = {n: simulator.get(n) for n, p in given.parameters.items() if p.tolerance > 0.0 and p.value != 0.0}
    for (name, where, first), (_, _, now) in zip(given.effects, simulator.effects, strict=True):
        place = evidence.placements.get(f"{name}@{where}")
        for p in place.effect.parameters if place is not None and place.acts else ():
            if p.linear and first.get(p.name):
                found[f"{name}@{where}.{p.name}"] = float(now[p.name])
    return found


def _unit(evidence: DirectEvidence, name: str) -> str:
    if name in evidence.given.parameters:
        return evidence.given.parameters[name].unit
    place, _, parameter = name.rpartition(".")
    return evidence.placements[place].units.get(parameter, "-")


def _with(evidence: DirectEvidence, simulator: Simulator, values: Mapping[str, float]) -> Simulator:
    """Return the simulator with other numbers; sizes that have a sign keep it."""
    effects = []
    for name, where, given in simulator.effects:
        own, place = dict(given), evidence.placements.get(f"{name}@{where}")
        for p in place.effect.parameters if place is not None else ():
            if (key := f"{name}@{where}.{p.name}") in values:
                own[p.name] = max(values[key], 0.0) if p.lower == 0.0 else values[key]
        effects.append((name, where, own))
    return simulator.with_({n: v for n, v in values.items() if n in simulator.parameters}, effects)


def _slopes(
    evidence: DirectEvidence, simulator: Simulator, steps: Mapping[str, float], at: Mapping[str, np.ndarray] | None
) -> tuple[np.ndarray, np.ndarray]:
    """Return residuals at the readings or at others, and their change by a unit of each number."""
    here, sizes = evidence.left(simulator, at), _sizes(evidence, simulator)
    there = [evidence.left(_with(evidence, simulator, {n: sizes[n] + d}), at) for n, d in steps.items()]
    return here, np.column_stack([(one - here) / d for one, d in zip(there, steps.values(), strict=True)])


def _solved(
    evidence: DirectEvidence, simulator: Simulator, spans: Mapping[str, float],
    channels: Callable[[Simulator], Mapping[str, np.ndarray] | None],
) -> tuple[Simulator, np.ndarray]:  # fmt: skip
    """Return the simulator at which instruments leave nothing to explain, and the standard errors of its numbers."""
    steps = {n: SMALL * v for n, v in spans.items()}
    for _ in range(ROUNDS):
        r, A = _slopes(evidence, simulator, steps, None)
        at = channels(simulator)
        own, Z = (0.0 * r, A) if at is None else _slopes(evidence, simulator, steps, at)
        back = np.linalg.inv(_determined(Z.T @ A, list(spans)))
        step = -back @ (Z.T @ (r - own))
        left = r - own + A @ step
        error = np.sqrt(np.diag(back @ _covariance(Z * left[:, None], lanes(evidence)) @ back.T))
        sizes = _sizes(evidence, simulator)
        simulator = _with(evidence, simulator, {n: v + d for (n, v), d in zip(sizes.items(), step, strict=True)})
        if np.all(np.abs(step) < error):
            return simulator, error
    name = list(spans)[int(np.argmax(np.abs(step) / error))]
    raise FitError(
        f"{name} still changes by more than its standard error after {ROUNDS} rounds.",
        "a simulator that is near the log, and a reference that moves it",
        "Start from the parameters of a refit without instruments, or hold one of the parameters.",
    )


def _determined(H: np.ndarray, names: Sequence[str]) -> np.ndarray:
    """Return a matrix of products; raise where it determines some numbers only together, or not at all."""
    rows, columns = (np.sqrt(np.sum(np.square(H), axis=k)) for k in (1, 0))
    if np.all(np.isfinite(H)) and rows.all() and columns.all():
        _, s, V = np.linalg.svd(H / np.sqrt(np.outer(rows, columns)))
        if s[-1] > ALIKE * s[0]:
            return H
        together = [n for n, v in zip(names, np.abs(V[-1]), strict=True) if v > FOLLOWS * np.max(np.abs(V[-1]))]
    else:
        together = [n for n, a, b in zip(names, rows, columns, strict=True) if not a * b > 0.0]
    raise IncompatibleError(
        f"The log does not determine {' and '.join(together)}.",
        "parameters that each change the equations in a way of their own",
        "Hold one of them: remove its tolerance.",
    )


def _covariance(scores: np.ndarray, lane: np.ndarray) -> np.ndarray:
    """Return the covariance of the sum of scores that are correlated along each run (Newey–West)."""
    most = int(np.cbrt(len(scores)))
    found = scores.T @ scores
    for lag in range(1, most + 1):
        same = lane[lag:] == lane[:-lag]
        both = scores[lag:][same].T @ scores[:-lag][same]
        found += (1.0 - lag / (most + 1)) * (both + both.T)
    return np.asarray(found)


# --- the loop -----------------------------------------------------------------------------------------------
class _Fed(Runner):
    """Integrates a simulator whose inputs also follow its states, and the integrals of some of them."""

    gains: np.ndarray
    """Shape (n_inputs, n_states, n_runs)."""
    pull: np.ndarray
    """Shape (n_inputs, n_held, n_runs)."""
    held: list[int]

    def begin(self) -> None:
        """Forget earlier runs."""
        self.steps, self.told, self.total = 0, list[np.ndarray](), np.zeros(self.pull.shape[1:])

    def _step(
        self, t: Any, h: float, x: Any, u: Any, p: Any, acting: Any, memory: Any, paths: Any, change: Any = 0.0,
        ramp: Any = 0.0,
    ) -> Any:  # fmt: skip
        if self.steps % self.substeps == 0:  # commands are held over each sample
            fed = np.einsum("unm,nm->um", self.gains, x[: self.gains.shape[1]])
            self.told.append(u + fed - np.einsum("unm,nm->um", self.pull, self.total))
            self.total = self.total + self.dt * x[self.held]
        self.steps += 1
        return super()._step(t, h, x, self.told[-1], p, acting, memory, paths, change, ramp)


class _Loop:
    """The closed loop of a log: a linear law of its controller, and simulations that the reference drives alone."""

    def __init__(self, evidence: DirectEvidence, references: int, simulator: Simulator) -> None:
        self.evidence, log = evidence, evidence.log
        x, u = evidence.motion
        self.x, r = x, np.stack([log.channels[f"{REFERENCE}_{k}"] for k in range(references)])
        rate = np.concatenate([np.gradient(r[:, a:b], log.dt, axis=1) for a, b in log.spans], axis=1)
        runs = (log.run == np.arange(len(log.spans))[:, None]).astype(float)
        self.led = np.concatenate([runs, r, rate])
        self.held = [self._followed(np.concatenate([runs, r[k : k + 1], rate[k : k + 1]])) for k in range(len(r))]
        self.wanted = _totals(r, log)
        signals = np.concatenate([x, self.led, self.wanted - _totals(x[self.held], log)])
        laws = [_law(basis @ signals, u) @ basis for basis in self._bases(len(r), len(runs))]
        for self.substeps in SUBSTEPS:
            missed = [self._missed(found) for found in self._simulated(simulator, laws)]
            self.law = laws[int(np.argmin(missed))]
            if min(missed) < FOLLOWS:
                break

    def _followed(self, led: np.ndarray) -> int:
        """Return the state that follows a reference best."""
        spread = np.std(self.x, axis=1)
        apart = np.std(self.x - _law(led, self.x) @ led, axis=1)
        share = 1.0 - np.square(apart / np.where(spread > 0.0, spread, np.inf)) - (spread <= 0.0)
        best = int(np.argmax(share))
        if not share[best] > FOLLOWS**2:
            raise IncompatibleError(
                f"No state follows the reference: it explains {100.0 * max(share[best], 0.0):.0f} % of the variance of "
                f"{self.evidence.given.states[best]}.",
                "a log recorded under feedback, and the reference that its controller followed",
                "Name that reference; for an open loop, refit without instruments.",
            )
        return best

    def _bases(self, n_r: int, n_runs: int) -> list[np.ndarray]:
        """Return signals that laws follow: errors, errors and their integrals, or states and references apart."""
        states, n = self.evidence.given.states, len(self.x)
        free = np.eye(n + n_runs + 3 * n_r)
        errors, gone = free.copy(), set[int]()
        for k, held in enumerate(self.held):
            speed = self.evidence.pairs.get(states[held])
            pairs = [(n + n_runs + k, held)]
            if speed is not None:
                pairs.append((n + n_runs + n_r + k, states.index(speed)))
            for row, state in pairs:
                errors[row, state] = -1.0
                gone.add(state)
        errors = np.delete(errors, sorted(gone), axis=0)
        return [errors[:-n_r], errors, free]

    def channels(self, simulator: Simulator) -> Mapping[str, np.ndarray]:
        """Return the readings and commands of the simulated loop; the first state of each run is the log's."""
        [found] = self._simulated(simulator, [self.law])
        missed = self._missed(found)
        if not missed < FOLLOWS:
            raise IncompatibleError(
                f"The simulated closed loop misses the log by {min(100.0 * missed, 1e3):.0f} % of its motion.",
                f"less than {100.0 * FOLLOWS:.0f} %, as with a controller nearly linear in reference and states",
                "Check the reference, or refit without instruments.",
            )
        return found

    def _missed(self, found: Mapping[str, np.ndarray]) -> float:
        log, names = self.evidence.log, self.evidence.given.states
        there = [s for s in names if s in log.channels and np.ptp(log.channels[s]) > 0.0]
        return max(rms(found[s] - log.channels[s]) / float(np.std(log.channels[s])) for s in there)

    def _simulated(self, simulator: Simulator, laws: Sequence[np.ndarray]) -> list[dict[str, np.ndarray]]:
        """Return the channels of the loop under each of some laws, all runs and laws side by side."""
        evidence, log, n, n_r = self.evidence, self.evidence.log, len(self.x), len(self.held)
        rows, many = side_by_side(log.spans, max(b - a for a, b in log.spans)), len(log.spans)
        runner = _Fed(simulator, log.dt, evidence.joints, self.substeps)
        each = np.repeat(np.stack(laws, axis=-1), many, axis=-1)
        runner.gains, runner.pull, runner.held = each[:, :n], each[:, -n_r:], self.held
        runner.begin()
        led = [law[:, n:-n_r] @ self.led + law[:, -n_r:] @ self.wanted for law in laws]
        u = np.concatenate([np.moveaxis(one[:, rows], 0, 1) for one in led], axis=2)
        rows = np.tile(rows, len(laws))
        p = np.repeat(simulator.numbers[:, None], rows.shape[1], axis=1)
        acting = [(place, made) for place, made in evidence.made_as(simulator) if place.acts]
        states = runner.states(log.t[rows], self.x[:, rows[0]], u, p, acting)[:, :n]
        told = np.stack([*runner.told, runner.told[-1]])
        return [self._channels(simulator, states[:, :, k : k + many], told[:, :, k : k + many])
                for k in range(0, rows.shape[1], many)]  # fmt: skip

    def _channels(self, simulator: Simulator, states: np.ndarray, told: np.ndarray) -> dict[str, np.ndarray]:
        """Return the channels of the log from states and commands of runs side by side."""
        log = self.evidence.log
        x, u = (
            np.concatenate([found[: b - a, :, k].T for k, (a, b) in enumerate(log.spans)], axis=1)
            for found in (states, told)
        )
        found = dict(zip((*simulator.states, *simulator.inputs), (*x, *u), strict=True))
        if simulator.outputs:
            wide = np.repeat(simulator.numbers[:, None], log.n, axis=1)
            found |= dict(zip(simulator.outputs, simulator.output(log.t, x, u, wide), strict=True))
        return {k: found.get(k, v) for k, v in log.channels.items()}


def _totals(x: np.ndarray, log: PortLog) -> np.ndarray:
    """Return the sums of signals over the samples before each row of a run, times the sampling interval."""
    runs = [log.dt * (np.cumsum(x[:, a:b], axis=1) - x[:, a:b]) for a, b in log.spans]
    return np.concatenate(runs, axis=1)


def _law(told: np.ndarray, u: np.ndarray) -> np.ndarray:
    """Return the linear law from signals to commands, shape (n_inputs, n_signals)."""
    scale = np.sqrt(np.mean(np.square(told), axis=1, keepdims=True))
    scale[scale == 0.0] = 1.0
    return np.asarray(np.linalg.lstsq((told / scale).T, u.T, rcond=None)[0].T / scale.T)
