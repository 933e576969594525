"""A log compared with a simulator with ports: what direct and simulated residuals share."""

from __future__ import annotations

import warnings
from abc import ABC, abstractmethod
from collections.abc import Collection, Mapping, Sequence
from copy import copy
from dataclasses import replace
from itertools import pairwise
from operator import attrgetter
from types import MappingProxyType
from typing import Self

import numpy as np

from ...effects import Effect
from ...errors import SimulatorRunError, UnitWarning, UnknownOptionError
from ...remembered import Remembered
from ...simulators.base import Simulator
from ...simulators.between import ends_of
from ...simulators.catalogue import chosen, placements, port_effects
from ...simulators.commuting import twins_of
from ...simulators.of_parameters import FIXED
from ...simulators.placement import Placement
from ...simulators.port_log import PortLog
from ...simulators.sizes import SignalSizes
from ...simulators.structure import JointPort, some_instants
from ..inference.student_t import RobustFit, scale, solve
from ..settings import DECIDED, EXCESS, LEAST_GAIN, TOLERANCE
from .between_rows import METHODS, NOTE, STEPS, WHOLE
from .port_signals import UNTURNED, PortWindows
from .protocol import Active, Spec
from .repeats import pieces
from .settled import Settled
from .tolerances import MOST_LAID, SMALL, differ, rms
from .window_noise import WindowNoise

MOST_KEPT = 256 * 2**20
"""Size of the residuals that are kept, bytes: a refit asks for those of one effect again and again."""


def idle(name: str, where: str) -> str:
    """Return a sentence on an effect of the simulator that has nothing to act on in a log."""
    return f"The simulator's own effect {name} at {where} cannot act on this log, since nothing moves there."


class PortEvidence(WindowNoise, Settled, ABC):
    """Residuals at the ports of a simulator, under effects at any of them.

    A `pamid.gap.residuals.protocol.ResidualSource`. A subclass says how residuals are computed. With ``refit`` they
    start from fitted parameters, where tolerances are so wide that nothing is linear within them.
    """

    exact = False
    """Any model may be wrong in several small ways at once."""
    bends = True
    """Whether residuals are no sums of what effects do one by one: large ones are refitted before they are ranked."""
    rough = False
    """Whether changes are differences of whole runs of somebody's code, which may stick, switch or take steps."""
    overlap = 3
    """A reading is in two windows by the test functions, and in a third by rates of its neighbours."""
    sharp: list[slice] = []  # noqa: RUF012 - none, and nobody adds one
    """Windows in which none may be far out: none, where the noise is only guessed."""
    least_gain = 1.5 * LEAST_GAIN
    decisive = DECIDED
    """Evidence that needs no draws, windows that repeat each other counted once: what acts in one stretch of time
    alone, such as a command that saturates once, looks as likely under any draw of signs."""
    how = ""
    """How residuals come about, for the reader."""
    twins: Mapping[str, str] = MappingProxyType({})
    folds: Mapping[str, float] = MappingProxyType({})
    """Readings whose sign is lost, see `StretchEvidence`."""
    one_sided = True
    runs_within_steps = False
    """Whether the simulator is run over each sample, since its motion within one matters."""
    _nuisances: np.ndarray | None = None
    _aside: tuple[str, np.ndarray] | None = None
    """A nuisance parameter that is fixed, and what one tolerance of it adds to the residuals."""

    def __init__(self, log: PortLog, simulator: Simulator, refit: bool = False, lines: bool = False) -> None:
        self.log, self.simulator, self.refit = log, simulator, refit
        self.lines = lines
        """Whether inputs go straight from row to row, instead of being held over each step."""
        self.windows: list[PortWindows] = []
        self._kept: Remembered[np.ndarray] = Remembered(MOST_KEPT, attrgetter("nbytes"))
        self._touches: dict[str, list[str]] = {}
        self.notes: list[str] = list(log.notes)
        self.placements: Mapping[str, Placement] = {}
        self.joints: list[JointPort] = []
        self.feeds: dict[str, str] = {}
        self.given = simulator
        self.fitted: Simulator | None = None
        """The simulator with what it fits to the log itself, where it does."""
        self.free = [n for n, p in simulator.parameters.items() if p.tolerance > 0.0 and p.value != 0.0]
        self.about = np.zeros(len(self.free))
        self.skews: dict[str, np.ndarray] = {}
        self._turning: dict[str, bool] = {}
        self._laid: Remembered[np.ndarray] = Remembered(MOST_LAID)
        self._timings: Remembered[dict[str, np.ndarray]] = Remembered(MOST_LAID)
        self._own: Active = []
        self.made_in_samples = False
        """Whether the log looks as if each sample was one step of an integrator."""
        self._little: np.ndarray | None = None
        """What steps of Euler's method change, to first order."""
        self._ways = 1
        """Methods of integration and lengths of their steps that were tried."""

    def _settle(self) -> None:
        """Compute everything that the protocol requires, once the windows are known."""
        log = self.log
        self.rows = log.n
        self.equations = [w.equation for w in self.windows]
        self.units = {w.equation: w.unit for w in self.windows}
        ends = np.cumsum([0, *(len(w.first) for w in self.windows)])
        self.parts = [slice(int(a), int(b)) for a, b in pairwise(ends)]
        centre = np.concatenate([w.centre for w in self.windows] or [np.zeros(0, int)])
        self.run = log.run[centre]
        self.block, self.trajectories = self.run, list(log.names)
        self.side = np.concatenate([np.full(len(w.first), k) for k, w in enumerate(self.windows)] or [np.zeros(0, int)])
        self.time = log.t[centre]
        self.first = np.concatenate([w.first for w in self.windows] or [np.zeros(0, int)])
        self.measured = np.concatenate([w.measured for w in self.windows] or [np.zeros(0)])
        self.centre = centre
        plain = self._residual([], self.simulator.numbers)
        self._refuse_not_finite(plain)
        gaps = {e: rms(plain[p]) for e, p in zip(self.equations, self.parts, strict=True)}
        self.sizes = self._surveyed(gaps)
        self.placements = self._placed()
        self._there = frozenset(self.placements)
        self._own = self._made_own()
        self.twins = self._twins()
        self.value = self._residual(self._own, self.simulator.numbers)
        self._refuse_not_finite(self.value)
        self.skipped: dict[str, str] = {}
        self.pace = self.sizes.time
        self.stretch = 0.3 / self.pace
        self._draw_noise()
        self._correlate()
        self.z0 = self._whitening.white(self.value / self.noise)
        self.J = self._slopes_at(self._own, np.zeros(len(self.free)), SMALL if self.curved else 1.0)
        self._choose_steps()
        straight = self.J
        if self.free and self.refit and not self.folds and self._bends():
            self._begun(straight)
        self.time_jumps()
        self.hear_inputs()
        self._set_steps_aside()
        if self.lines:
            self.notes.append(NOTE)

    def lines_explain_more(self) -> bool:
        """Return whether inputs in lines from row to row explain more than held ones, tolerances and clocks fitted."""
        if self.lines or self.simulator.form == "algebraic" or not any(np.ptp(u) > 0.0 for u in self._u):
            return False
        if self.simulator.form == "run" and not (
            self.simulator.any_step and np.any(self.without_causes().scales > 1.0 + EXCESS)
        ):
            return False  # it takes several runs, where there is something to explain
        change = self._whitening.white(self._with_lines() / self.noise)
        held, straight = self.without_steps(), self.without_steps(change)
        # What is left of a gap lasts, so that it says less; once the causes are known, it is asked again.
        least = LEAST_GAIN if self._to_the_noise(straight) else DECIDED
        return straight.loglik > held.loglik + least

    def without_steps(self, change: np.ndarray | float = 0.0) -> RobustFit:
        """Return the fit without causes and without steps of an integrator, of residuals changed by so much.

        Steps that go with the new speed act like inputs that come earlier, as inputs in lines do.
        """
        return self._fitted_beside(change=change)

    @abstractmethod
    def _with_lines(self) -> np.ndarray:
        """Return the change of the residuals by inputs that go straight from row to row, to first order."""

    def _fitted_beside(
        self, step: np.ndarray | None = None, least: float = 0.0, change: np.ndarray | float = 0.0
    ) -> RobustFit:
        """Return the fit of all that is free, of steps of an integrator only some, at least so long."""
        low, high = self.ends
        steps = np.array([name in METHODS for name in self.free], dtype=bool)
        z0, J = self.z0 + change - self.J[:, steps] @ self.about[steps], self.J[:, ~steps]
        low, high = low[~steps], high[~steps]
        prior = np.full(len(low), TOLERANCE)
        if step is not None:
            J, prior = np.column_stack([J, step]), np.append(prior, 0.0)
            low, high = np.append(low, least), np.append(high, 1.0)
        return solve(z0, J, low, high, self.parts, self.weights, prior)

    def _choose_steps(self) -> None:
        """Keep what fits best of methods of integration and lengths of their steps."""
        every = {name: column for name, column in self.skews.items() if name.removesuffix(WHOLE) in METHODS}
        self._keep_free([name for name in self.free if name not in every])
        nothing, ways = np.zeros_like(self.noise), list[tuple[float, str, np.ndarray]]()
        for method in METHODS:
            first, whole = every.get(method), every.get(method + WHOLE)
            if whole is not None:
                first = nothing if first is None else first
                ways += [(share, method, first + share * (whole - first)) for share in np.linspace(0.0, 1.0, 5)]
            elif first is not None:
                ways.append((0.0, method, first))
        if ways:
            share, method, skew = max(ways, key=lambda w: self._fitted_beside(self.white(w[2] / self.noise)).loglik)
            self._free_also(method, skew)
            self.made_in_samples, self._ways = share == 1.0, len(ways)
            self._little = every.get(STEPS)

    def _set_steps_aside(self) -> None:
        """Set steps of an integrator aside, unless they explain the log to its noise, and nothing else does."""
        for method in [name for name in self.free if name in METHODS]:
            step, least = self.J[:, self.free.index(method)], LEAST_GAIN + np.log(self._ways)
            best, without, longest = self._fitted_beside(step), self._fitted_beside(), self._fitted_beside(step, 1.0)
            told = best.loglik > without.loglik + least and self._to_the_noise(best)
            # Noise in modelled rates makes exact logs look as if made in steps, too.
            alone = told and (bool(np.any(without.scales > 1.0)) or not self._noise_pulls())
            whole = self.made_in_samples
            self.made_in_samples = whole and alone and longest.loglik > best.loglik - least
            if not alone:
                self._set_aside(method)
                if not (whole or told) and self._little is not None:  # without causes, little tells methods apart
                    self._aside = STEPS, self._little

    def _noise_pulls(self) -> bool:
        """Return whether noise in modelled rates moves the free parameters: not in what is predicted."""
        return False

    def _to_the_noise(self, fit: RobustFit) -> bool:
        """Return whether a fit leaves no more than the noise in any equation, as far as its windows can tell."""
        counts = [max(part.stop - part.start, 1) for part in self.parts]
        left = [scale(fit.z[part], 0.0) for part in self.parts]
        return bool(np.all(np.array(left) <= 1.0 + EXCESS + np.sqrt(2.0 / np.array(counts))))

    def _begun(self, straight: np.ndarray) -> None:
        """Compute residuals and slopes at the present starting values."""
        self._again()
        self.value = self._residual(self._own, self.simulator.numbers) + self._skewed({}, self._own)
        self._kept.clear()
        self.z0 = self._whitening.white(self.value / self.noise)
        self.J = self._slopes_at(self._own, np.zeros(len(self.free)))
        self.curved = self.curved or differ(straight, self.J)

    @property
    def effects(self) -> Mapping[str, type[Effect]]:
        """The library: each effect at each port."""
        return {key: place.effect for key, place in self.placements.items()}

    def library(self, effects: str | Sequence[str], places: Mapping[str, Placement] | None = None) -> list[str]:
        """Return the keys of a choice among the effects that can act here, or at some places."""
        return chosen(self.placements if places is None else places, effects)

    def heard(self, share: float) -> list[str]:
        """Return what a reader is told of the residuals, of which a flexible learner predicts a share."""
        return [f"The residuals are those {self.how}."]

    # --- the simulator with causes ---------------------------------------------------------------------------
    def corrected(self, spec: Spec, deviations: Mapping[str, float] | None = None) -> Simulator:
        """Return the simulator with its own effects and others, parameters changed by multiples of tolerances."""
        numbers, names, kept = self.numbers(deviations), list(self.simulator.parameters), []
        for name, values in spec.items():
            place = self.placements[name]
            outward = place.outward(values)
            if isinstance(made := place.made(outward), FIXED):
                numbers = place.adjusted(made, numbers, names)
            else:
                kept.append((place.name, place.port, outward))
        changed = dict(zip(names, map(float, numbers), strict=True))
        return self.simulator.with_(changed, [*self.simulator.effects, *kept])

    def deviated(self, deviations: Mapping[str, float]) -> Simulator:
        """Return the simulator as given, its parameters changed by multiples of their tolerances."""
        numbers = self.numbers(deviations)
        return self.given.with_(dict(zip(self.given.parameters, map(float, numbers), strict=True)))

    def _refuse_not_finite(self, residual: np.ndarray) -> None:
        bad = np.flatnonzero(~np.isfinite(residual))
        if len(bad):
            run = self.trajectories[int(self.run[bad[0]])]
            raise SimulatorRunError(
                f"The simulator returns values that are not finite in {len(bad):,} of {len(residual):,} windows, first "
                f"at {self.time[bad[0]]:.4g} s of '{run}'. {self.simulator.undefined}",
                "finite rates and outputs wherever the log has readings",
                "Check its parameters and their units, or leave those rows out.",
            )

    def _twins(self) -> dict[str, str]:
        """Return the faults that commute with the simulator between them, and forces that are steady in this log."""
        joints = [name.removeprefix("steady_force@") for name in self.placements if name.startswith("steady_force@")]
        rubbing = {f"steady_force@{joint}": f"coulomb_friction@{joint}" for joint in joints}
        there = {steady: dry for steady, dry in rubbing.items() if dry in self.placements}
        return {s: d for s, d in there.items() if self._goes_one_way(self.placements[d])} | self._commuting()

    def _commuting(self) -> dict[str, str]:
        if self.simulator.form != "ode" or not self.simulator.inputs:
            return {}
        log, some = self.log, some_instants(self.log.n)
        signals = self.signals()
        x, u = (np.array([signals[n][some] for n in names]) for names in (self.simulator.states, self.simulator.inputs))
        driven = [n for n in self.simulator.inputs if np.ptp(signals[n]) > 0.0]
        return twins_of(self.placements, self.simulator, log.t[some], x, u, driven, set(log.channels))

    def _refuse_nowhere(self, name: str, where: str) -> None:
        """Raise if one of the simulator's own effects is at an unknown port."""
        known = {*(p.name for p in self.simulator.ports), *self.simulator.parameters, *(j.name for j in self.joints)}
        between = port_effects()[name][0] == "link" and ends_of(where) is None
        if between or where not in known:
            can = list(dict.fromkeys(p.port for p in self.placements.values() if p.name == name)) or sorted(known)
            what = "only one port" if between else "no port of the simulator"
            raise UnknownOptionError(
                f"The effect {name} is at {where!r}, which is {what}.",
                f"one of {', '.join(can)}",
                "Correct 'at' under [[effects]].",
            )

    def _made_own(self) -> Active:
        made: Active = []
        for name, where, values in self.simulator.effects:
            place = self.placements.get(f"{name}@{where}")
            if place is None:
                self._refuse_nowhere(name, where)
                self.notes.append(idle(name, where))
                continue
            if (delay := values.get("delay", 0.0)) > (longest := max(b - a for a, b in self.log.spans) * self.log.dt):
                said = f"{name} at {where} delays by {delay:g} s, but the longest run of the log has {longest:.3g} s"
                warnings.warn(f"{said}. Expected a delay in seconds.", UnitWarning, stacklevel=2)
            made.append((place, place.made(values)))
        return made

    # --- the protocol ---------------------------------------------------------------------------------------
    def pieces(self) -> tuple[np.ndarray, int]:
        """Return the run, or piece of one, with which each window is left out in turn, and how many there are.

        Where a log holds one or two runs they are cut into pieces of equal length, each several times as long as the
        residual is correlated.
        """
        return pieces(self.log.spans, self.block, self.time, self.log.dt, self.stretch)

    def _allow(self) -> None:
        """Make what is not known within a sample free parameters."""
        self.free = [*self.free, *self.skews]
        self.about = np.concatenate([self.about, np.zeros(len(self.skews))])

    def change(self, spec: Spec, about: Spec, x: np.ndarray) -> np.ndarray:
        """Return by how much the residuals change from effects to others, at deviations x."""
        return self.z(spec, self._named(x)) - self.z(about, self._named(x))

    def glance(self, spec: Spec) -> np.ndarray:
        """Return roughly what effects change in the residuals, at low cost."""
        return self.change(spec, {}, np.zeros(len(self.free)))

    def touched(self, names: Collection[str]) -> list[str]:
        """Return the equations that effects change."""
        found: set[str] = set()
        for name in names:
            if name not in self._touches:
                self._touches[name] = self._touched(name) if name in self.placements else []
            found |= set(self._touches[name])
        return [e for e in self.equations if e in found]

    def touches(self, name: str, columns: Sequence[np.ndarray]) -> None:
        """Note which equations an effect changes, from changes of the residuals at hand: nothing is run for it."""
        size = np.zeros(len(self.noise))
        for found in columns:
            size = np.maximum(size, np.max(np.abs(self.raw(found)), axis=1, initial=0.0))
        parts = zip(self.equations, self.parts, strict=True)
        self._touches[name] = [e for e, part in parts if np.any(size[part] > 1e-9)]

    def _touched(self, name: str) -> list[str]:
        place = self.placements[name]
        known = [self.reached(p) for p in place.effect.parameters]
        values = {p.name: p.nominal or (0.1 * p.upper if p.linear else p.nominal) for p in known}
        change = np.abs(self.raw(self.change({name: values}, {}, np.zeros(len(self.free)))))
        return [e for e, part in zip(self.equations, self.parts, strict=True) if np.any(change[part] > 1e-9)]

    def prior(self, name: str) -> float:
        """Return the log odds of an effect; one of a path that never reverses could be any function of time."""
        place = self.placements[name]
        prior = float(place.effect.prior)
        return min(prior, UNTURNED) if self._goes_one_way(place) else prior

    def _goes_one_way(self, place: Placement) -> bool:
        """Return whether an effect follows a path that never reverses."""
        repeats = any(p.periods for p in place.effect.parameters)
        path = place.follows.get("position", "") if place.acts else place.at if repeats else ""
        return bool(path) and place.effect.follows_path() and not self._turns(path)

    # --- beside other logs -------------------------------------------------------------------------------------
    @property
    def lasting(self) -> Collection[str]:
        """The simulator's own parameters: a change of one between days is a cause."""
        return self.given.parameters.keys()

    def _placed(self) -> Mapping[str, Placement]:
        """Return every effect where it can act on the log."""
        return placements(self.simulator, self.sizes)

    def has(self, name: str) -> bool:
        """Return whether the log has the signals that an effect acts on."""
        return name in self._there

    def begin_as(self, other: PortEvidence) -> None:
        """Begin from the parameters at which another log of the same simulator begins."""
        x = np.zeros(len(self.free))
        for k, name in enumerate(self.free):
            if name in self.lasting and name in other.free:
                x[k] = other.about[other.free.index(name)] - self.about[k]
        if np.any(x):
            straight = self.J
            self._begin_from(x)
            self._begun(straight)

    def measure_as(self, sizes: SignalSizes) -> None:
        """Scale each effect by the signals of several logs."""
        self.sizes = sizes
        self.placements = self._placed()
        self._there &= self.placements.keys()
        self.twins = self._twins()
        self._kept.clear()
        self._laid.clear()
        self._touches.clear()
        if self._own:
            notes, self._own = list(self.notes), self._made_own()
            self.notes = notes
            self._begun(self.J)

    @property
    def nuisances(self) -> np.ndarray:
        """Change of the residuals by one tolerance of this log's clocks and offsets, where they are not free."""
        return np.zeros((len(self.z0), 0)) if self._nuisances is None else self._nuisances

    def without_nuisances(self) -> None:
        """Fix clocks and offsets: two logs then have the same free parameters."""
        self._nuisances = self.J[:, [name not in self.lasting for name in self.free]]
        self._keep_free(self.lasting)

    def _keep_free(self, names: Collection[str]) -> None:
        """Fix all free parameters but some, where they are."""
        kept = np.array([name in names for name in self.free], dtype=bool)
        self.free = [name for name in self.free if name in names]
        self.about, self.J = self.about[kept], self.J[:, kept]
        self.skews = {name: column for name, column in self.skews.items() if name in names}
        self._laid.clear()

    def _set_aside(self, name: str) -> None:
        """Fix a nuisance parameter at zero; `stepped` frees it again."""
        self._aside = name, self.skews[name]
        self.value = self.value - self.about[self.free.index(name)] * self.skews[name]
        self.z0 = self.white(self.value / self.noise)
        self._keep_free([other for other in self.free if other != name])

    def stepped(self) -> Self | None:
        """Return this evidence with steps of an integrator free; None where they are, or where there are none."""
        if self._aside is None:
            return None
        other = copy(self)
        other._aside, other._laid = None, Remembered(self._laid.most)  # slopes about effects have a column more
        other._free_also(*self._aside)
        return other

    def _free_also(self, name: str, skew: np.ndarray) -> None:
        """Free a nuisance parameter, in which residuals are linear."""
        self.free, self.about = [*self.free, name], np.append(self.about, 0.0)
        self.J, self.skews = np.column_stack([self.J, self.white(skew / self.noise)]), {**self.skews, name: skew}

    def also_under(self, names: Mapping[str, str]) -> None:
        """Add other names of effects, each with its own."""
        more = {other: replace(self.placements[k], key=other) for other, k in names.items() if k in self.placements}
        self.placements = {**self.placements, **more}
