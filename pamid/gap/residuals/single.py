"""Any actuator's log against any model of one equation, as windows: the evidence of `pamid.estimators.GapDiagnoser`."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...effects.registry import chosen_effects
from ...equations.noise import channel_noise
from ...errors import LackingNumberError
from ...remembered import Remembered
from ...signals.noise import white_noise
from ...signals.state import ROLES, STATE_ROLES
from ...simulators.base import Simulator
from ...simulators.placement import Placement, Scales
from ...simulators.port_log import PortLog
from ...simulators.ports import Port
from ...simulators.sizes import SignalSizes
from .on_equation import OUTPUT, OnEquation, scales_of, strain_scale
from .port_signals import PortWindows
from .ports import PortEvidence
from .protocol import Active, Spec
from .tolerances import rms

if TYPE_CHECKING:
    from ..inference.gauss_newton import Fit

_ROLES = {**STATE_ROLES, "u": ROLES["u"]}
_NOISE = (
    "The noise is estimated from differences between neighbouring samples and between repeated runs. A flexible model "
    "of the same signals and their past predicts {:.0f} % of the gap on held-out runs."
)
_MOVED = "position", "pressure", "command"
_DRIVING = *_MOVED, "flow"
_MOST_OTHERS = 64


class Roles(Simulator):
    """Signals by their roles, as the inputs of one equation."""

    form = "algebraic"

    def corrected(self, effects: Sequence[object], sense: int, unit: str) -> Simulator:
        """Return the same: the owner of the equation adds effects to it."""
        return self


class Stated(NamedTuple):
    """An equation on a log."""

    equation: OnEquation
    """Its modelled side."""
    y: np.ndarray
    """What was measured."""
    fitted: Simulator | None = None
    """The simulator that states it, with what it fits to the log itself."""
    unit: float = 1.0
    """What a unit of y is in the unit of y as given: of a servo, what it is driven by follows from its gain."""


class SignalEvidence(PortEvidence):
    """Residuals of one equation under effects that its model leaves out.

    `names` are those of the runs, `columns` the user's names of the roles; windows with a row of `without` are left
    out. `position` is what counts as a strain of one; a contraction ratio is that of a muscle. `simulator` states the
    equation as `stated`; `under` returns it with other numbers.
    """

    bends = False
    """Any model may be wrong in several small ways at once."""
    decisive = np.inf
    """Gain in log-likelihood that needs no draws to be believed: none, where the noise is only guessed."""

    def __init__(
        self, stated: Stated, names: Sequence[str],
        columns: Mapping[str, str] = MappingProxyType({}), position: float | None = None, contraction: bool = False,
        without: np.ndarray | None = None, simulator: Simulator | None = None, noise: np.ndarray | None = None,
        under: Callable[[np.ndarray], Stated] | None = None, refit: bool = False,
    ) -> None:  # fmt: skip
        equation, y, fitted, _ = stated
        starts, at = equation.starts, np.arange(len(y))
        since = (at - starts[np.searchsorted(starts, at, side="right") - 1]) * equation.dt
        channels = {role: x for role, x in equation.table.items() if role != "time"} | {equation.kind: y}
        log = PortLog(channels, since, starts, equation.dt, list(names))
        numbers = simulator.parameters if simulator is not None and under is not None else {}
        super().__init__(log, Roles([Port(role, "input") for role in _DRIVING if role in channels], numbers), refit)
        self.given, self.fitted = simulator or self.simulator, fitted
        self.equation, self.y, self.columns = equation, y, columns
        self._under, self._others = under, Remembered[Stated](_MOST_OTHERS)
        self.contraction = contraction
        self.without = np.zeros(log.n, dtype=bool) if without is None else without
        self._position = position
        self.n = equation.window
        first = np.concatenate([np.arange(a, b - self.n + 1, self.n) for a, b in log.spans]).astype(int)
        if self.without.any():
            lost = np.concatenate([[0], np.cumsum(self.without)])
            first = first[lost[first + self.n] == lost[first]]
        self._draws = np.zeros((0, log.n)) if noise is None else noise
        self.windows = [PortWindows(equation.kind, equation.units.target, first, first + self.n // 2, np.zeros(0))]
        self.windows = [self.windows[0]._replace(measured=self._mean(y))]
        self._settle()

    def _mean(self, x: np.ndarray) -> np.ndarray:
        [window], middle = self.windows, float(np.mean(x))
        sums = np.concatenate([[0.0], np.cumsum(x - middle)])
        return (sums[window.first + self.n] - sums[window.first]) / self.n + middle

    def _residual(
        self, active: Active, numbers: np.ndarray, channels: Mapping[str, np.ndarray] | None = None
    ) -> np.ndarray:
        there = self.stated(numbers)
        return there.unit * self._mean(there.y - there.equation.modelled(active))

    def stated(self, numbers: np.ndarray) -> Stated:
        """Return the equation with other numbers, under effects in the same sense."""
        under = self._under
        if under is None or np.array_equal(numbers, self.given.numbers):
            return Stated(self.equation, self.y, self.fitted)
        found = self._others.get(numbers.tobytes(), lambda: under(numbers))
        found.equation.join(self.equation)
        return found

    def _with_lines(self) -> np.ndarray:
        return np.zeros(len(self.z0))

    def _under_inputs(self, u: np.ndarray) -> np.ndarray:
        return np.zeros(len(self.value))

    def _again(self) -> None:
        """What is cached of other parameters stays right."""

    @property
    def ends(self) -> tuple[np.ndarray, np.ndarray]:
        """The lowest and highest deviations of the free parameters, within the plausible range of those in it."""
        found = np.array(super().ends)
        for k, name in enumerate(self.free):
            p, (low, high) = self.given.parameters[name], self.given.plausible(name)
            if low <= p.value <= high:
                room = sorted((end - p.value) / (p.value * p.tolerance) - self.about[k] for end in (low, high))
                found[:, k] = np.clip(found[:, k], *room)
        return found[0], found[1]

    def spoken(self, role: str) -> str:
        """Return the user's name of a role."""
        return self.columns.get(role, role)

    def signals(self) -> dict[str, np.ndarray]:
        """Return the signals at each row, by the user's names."""
        return {self.spoken(role): x for role, x in self.equation.table.items()}

    def roles(self, equation: str) -> dict[str, str]:
        """Return the signal behind each name of `STATE`, as far as there is one."""
        return {k: self.spoken(role) for k, role in _ROLES.items() if role in self.equation.table}

    def corrected(self, spec: Spec, deviations: Mapping[str, float] | None = None) -> Simulator:
        """Return the simulator that states the equation with its own effects and others."""
        causes = [(name, self.placements[name].outward(values)) for name, values in spec.items()]
        states = self.stated(self.numbers(deviations)).fitted or self.simulator
        return states.corrected(causes, self.equation.sense, self.equation.units.target) if causes else states

    def heard(self, share: float) -> list[str]:
        """Return the sentence on residuals of which a flexible learner predicts a share."""
        told = [_NOISE.format(100.0 * share)]
        if self.equation.sense < 0:
            told.append("Effects are added to y, which is assumed to be the driving force, not the delivered one.")
        if still := [self.spoken(role) for role in self.equation.table if self.sizes.spans[role] == 0.0]:
            told.append(f"Constant, so no cause can depend on it: {', '.join(still)}.")
        return told

    def driven(self) -> dict[str, np.ndarray]:
        """Return the signals that a run may move, by the user's names."""
        may_move = _MOVED[:1] if self.equation.kind == "torque" else _MOVED  # a joint's load follows from its motion
        table = self.equation.table
        return {self.spoken(role): table[role] for role in may_move if role in self.columns and role in table}

    def begin_as(self, other: PortEvidence) -> None:
        """Set the sense of effects, and the parameters at which it begins, to those of another log."""
        self.equation.sense = other.equation.sense if isinstance(other, SignalEvidence) else 1
        super().begin_as(other)

    # --- where effects act ------------------------------------------------------------------------------------
    def _survey(self, gaps: Mapping[str, float]) -> SignalSizes:
        table = {**self.equation.table, self.equation.kind: self.equation.predicted}
        spans, tops, lows = (
            {k: float(of(x)) for k, x in table.items()} for of in (np.ptp, lambda x: np.max(np.abs(x)), np.min)
        )
        kind, log = self.equation.kind, self.log
        return SignalSizes(spans, tops, lows, gaps, [kind], {}, [], log.usual_seconds, log.dt)

    _surveyed = _survey

    @property
    def position(self) -> float:
        """What counts as a strain of one, over all logs that are diagnosed together."""
        return self._position or strain_scale(self.sizes.spans.get("position", 0.0), self.contraction)

    @property
    def scales(self) -> Scales:
        """What is typical of the log."""
        return scales_of(self.sizes, self.position, self.equation.kind, self.equation.plant is not None)

    def _placed(self) -> Mapping[str, Placement]:
        return self.equation.placements(self.scales, self.sizes)

    def _made_own(self) -> Active:
        """Return no effects: those of a page are part of the model."""
        return []

    def path_of(self, name: str) -> np.ndarray:
        """Return the path without reversals by noise."""
        return self.equation.path

    def reach(self, spec: Spec) -> np.ndarray:
        """Return the share of a small addition to the model that reaches each window's reading; none if slack."""
        active = self.active(spec)
        total = self.equation.modelled([(p, e) for p, e in active if e.channel != OUTPUT[self.equation.kind]])
        small = 1e-4 * float(np.std(self.y)) + 1e-12
        before, after = (self.equation.read(active, x, memory=False) for x in (total, total + small))
        return self._mean((after - before) / small)

    def has(self, name: str) -> bool:
        """Return whether the log has the signals that an effect acts on, and the system the numbers that it reads."""
        return super().has(name) and bool(self.touched([name]))

    def _touched(self, name: str) -> list[str]:
        try:
            return super()._touched(name) if self.equation.holds(self.placements[name].effect) else []
        except LackingNumberError:
            return []

    def library(self, effects: str | Sequence[str], places: Mapping[str, Placement] | None = None) -> list[str]:
        """Return the effects that a choice stands for, "all" being those of what the equation is about."""
        kind = {"force": "actuator", "torque": "motor" if self.equation.units.target == "V" else "joint"}
        chosen = chosen_effects(effects, "muscle" if self.contraction else kind.get(self.equation.kind, "gas"))
        return [name for name in chosen if name != "joint_damping" or "viscous_friction" not in chosen]

    # --- noise ------------------------------------------------------------------------------------------------
    def hear_memory(self, fitted: Fit) -> bool:
        """Return False: the noise is only guessed."""
        return False

    def _draw_noise(self) -> None:
        """Take the larger of the noise that neighbouring residuals show and that of noisier copies of the log."""
        mean, copied, spans = np.full(self.n, 1.0 / self.n), len(self._draws) > 0, self.log.spans

        def shown(left: np.ndarray) -> float:
            if not copied:
                return channel_noise(left, self.n).variance(mean)
            return white_noise(np.diff(left, 3)) ** 2 / self.n if len(left) > 4 else 0.0

        left = self.y - self.equation.predicted
        near = float(np.sqrt(np.average([shown(left[a:b]) for a, b in spans], weights=[b - a for a, b in spans])))
        copies = rms(np.array([rms(self._mean(one)) for one in self._draws]))
        self.noise = np.full(len(self.value), max(near, copies, 1e-4 * rms(self.value), 1e-300))
        self._drawn = np.zeros((0, len(self.value)))
