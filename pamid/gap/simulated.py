"""The parts of a diagnosis of a simulator with ports: evidence, library, the answer in the units of the ports."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import pandas as pd

from ..errors import PamidError, ParameterError
from ..simulators.base import Simulator
from ..simulators.dimensions import unit_powers
from ..simulators.forces import as_force, force_per_input
from ..simulators.of_parameters import FIXED
from ..simulators.placement import Placement
from ..simulators.port_log import port_log
from ..simulators.port_units import tell_unit_doubts
from ..simulators.steadiness import tell_if_unsteady
from ..simulators.structure import some_instants
from .diagnosis.findings import Candidate, Cause, Closure, ParameterEstimate
from .diagnosis.result import Diagnosis
from .inference.first_order import FirstOrder
from .inference.floor import Learnable, Learned, explainable
from .inference.gauss_newton import Fitter
from .inference.run_off import Run
from .inference.sensitivity import Template, laid
from .inference.so_far import alone_so_far, in_words, stopped
from .one_equation import stated
from .residuals.between_rows import steps_taken
from .residuals.direct import DirectEvidence
from .residuals.part import MOST_ANSWERS, part_of
from .residuals.ports import PortEvidence
from .residuals.protocol import STATE, Spec
from .residuals.shooting import ShootingEvidence
from .residuals.states import measured_states
from .residuals.tolerances import rms
from .settings import EXCESS, LEAST_GAIN

if TYPE_CHECKING:
    from .several.result import Change
    from .several.stacked import StackedEvidence


@np.errstate(all="ignore")  # what is not finite is refused in words
def evidence_of(
    log: pd.DataFrame, simulator: Simulator, refit: bool = False, simulated: bool = False, lines: bool | None = None,
    say: Callable[[str], None] = lambda _: None,
) -> PortEvidence:  # fmt: skip
    """Return the evidence of a log: directly where it holds the states, else by simulating short stretches.

    Inputs are held or go in lines from row to row, whichever explains more, unless `lines` says so.
    """
    from .residuals.choice import (
        BY_POSITION,
        PREDICTED_IF,
        beside_inputs,
        better_derived,
        bridged,
        motion_is_hidden,
        sign_may_be_lost,
    )

    if simulator.states_equation:
        return stated(log, simulator, refit)
    at_ports = port_log(log, simulator)
    if unsteady := tell_if_unsteady(simulator, at_ports):
        at_ports = replace(at_ports, notes=[*at_ports.notes, unsteady])
    tell_unit_doubts(simulator, at_ports)
    derived = measured_states(simulator, at_ports)

    def in_lines(found: PortEvidence) -> bool:
        return found.lines_explain_more() if lines is None else lines

    def predicted(longest: int = 0) -> ShootingEvidence:
        say("simulate the log from fitted initial states and parameters")
        found = ShootingEvidence(at_ports, simulator, refit=refit, longest=longest)
        if in_lines(found):
            found = ShootingEvidence(at_ports, simulator, refit=refit, lines=True, longest=longest, like=found)
        return beside_inputs(found)

    if derived is None or (simulated and simulator.form != "algebraic"):
        return predicted()
    say("compare the rates of the simulator with the log")
    found = DirectEvidence(at_ports, simulator, derived, refit)
    if better := better_derived(found):
        by_position = DirectEvidence(at_ports, simulator, {**derived, **better}, refit)
        if not motion_is_hidden(by_position):
            found, derived = by_position, by_position.derived
    if in_lines(found):
        straight = DirectEvidence(at_ports, simulator, derived, refit, lines=True)
        found = straight if lines or straight.without_steps().loglik > found.without_steps().loglik else found
    found = bridged(found)
    found.notes += [BY_POSITION.format(position=q, velocity=v) for q, v in derived.items() if v in at_ports.channels]
    if simulator.form == "ode" and sign_may_be_lost(found) and (other := predicted()).folds:
        return other
    if motion_is_hidden(found):
        return predicted()
    # From a log that was made in steps of a sample, predictions by exact integration would drift away.
    for is_so, longest, note in () if found.made_in_samples else PREDICTED_IF:
        if note not in found.notes and is_so(found):
            if not simulator.one_by_one:  # otherwise it would take too long
                return predicted(longest)
            found.notes.append(note)
    return found


def otherwise(evidence: PortEvidence, found: Diagnosis, log: pd.DataFrame) -> PortEvidence | None:
    """Return the evidence with inputs in lines instead of held, or the reverse, if that explains as much with less.

    Which it is was asked before the causes were known, and a large gap says little of what happens within a sample.
    Where the other one needs one cause at an input less, such as a delay of half a sample, or explains more, it is so.
    """
    simulator = evidence.simulator
    if found.verdict in ("none", "untested"):
        return None
    spec = added(evidence, found)
    at_inputs = [k for k in spec if evidence.placements[k].at in simulator.inputs]
    other: PortEvidence | None
    if isinstance(evidence, ShootingEvidence):
        # It costs runs, and matters where something stands in for it.
        at_end = any(k in evidence.skews and abs(v) >= 1.0 for k, v in found.deviations.items())
        other = _predicted_otherwise(evidence) if at_inputs or at_end else None
    elif not isinstance(evidence, DirectEvidence) or simulator.form != "ode" or simulator.one_by_one:
        return None  # one by one it would take too long
    else:
        other = evidence_of(log, evidence.given, evidence.refit, lines=not evidence.lines)
    if other is None or type(other) is not type(evidence) or other.parts != evidence.parts:
        return None
    other.weights = evidence.weights
    there, louder = Fitter(other), _louder(other, evidence)
    here = Fitter(evidence).refine(spec).loglik + louder
    for one in at_inputs:
        less = there.refine({k: v for k, v in spec.items() if k != one})
        if less.loglik > here - LEAST_GAIN:
            other.hear_inputs(less)  # the gap hid their noise
            return other
    return other if there.refine(spec).loglik > here + LEAST_GAIN else None


def _louder(one: PortEvidence, other: PortEvidence) -> float:
    """Return by how much less likely the same residuals are by the noise of one evidence than by that of another."""
    more = np.log(one.noise / other.noise)
    return float(sum(w * np.sum(more[part]) for w, part in zip(one.weights, one.parts, strict=True)))


def _predicted_otherwise(evidence: ShootingEvidence) -> ShootingEvidence | None:
    """Return predictions with inputs in lines instead of held, or the reverse; None where that takes too long."""
    simulator = evidence.simulator
    if simulator.one_by_one if simulator.form == "ode" else not simulator.any_step:
        return None
    return ShootingEvidence(
        evidence.log, evidence.given, refit=evidence.refit, lines=not evidence.lines, longest=evidence.longest,
        like=evidence,
    )  # fmt: skip


def added(evidence: PortEvidence, found: Diagnosis) -> dict[str, dict[str, float]]:
    """Return the effects that are added to a simulator, as its evidence has them."""
    spec = {}
    for cause in found.added:
        at = cause.effects[0], *cause.where[:1]
        there = [p for p in evidence.placements.values() if (p.name, p.port)[: len(at)] == at]
        known = {p.key: {q.name for q in p.effect.parameters} for p in there}  # one law may be there in two forms
        key = min((k for k, names in known.items() if cause.parameters.keys() <= names), key=lambda k: len(known[k]))
        spec[key] = evidence.placements[key].inward({k: p.value for k, p in cause.parameters.items()})
    return spec


def free_run(log: pd.DataFrame, simulator: Simulator, *more: str) -> pd.DataFrame:
    """Return a simulator's response, its effects included, to a log's inputs, each run from its best initial state."""
    if simulator.form == "algebraic":
        raise ParameterError(
            "The simulator is algebraic, so it has no free run.",
            "one of states or of whole runs",
            "Call its output function.",
        )
    at_ports = port_log(log, simulator)
    evidence = ShootingEvidence(at_ports, simulator, whole=True)
    names = [at_ports.names[k] for k in at_ports.run]
    return pd.DataFrame({"trajectory": names, "time": at_ports.t, **evidence.predicted(more)})


def runner(evidence: PortEvidence) -> Run | None:
    """Return a function that simulates effects over a log's stretches; None where residuals are that already."""
    if not isinstance(evidence, DirectEvidence) or evidence.simulator.form != "ode":
        return None
    made: list[tuple[ShootingEvidence, Fitter]] = []

    def run(spec: Spec, refit: bool, behind: float) -> float | None:
        if not made:
            part = part_of(evidence.log, MOST_ANSWERS // max(len(evidence.joints), 1))
            runs = ShootingEvidence(part, evidence.simulator)
            made.append((runs, Fitter(runs)))
        (runs, fitter), places = made[0], evidence.placements
        if not spec.keys() <= runs.placements.keys():
            return None
        within = {k: runs.placements[k].inward(places[k].outward(v)) for k, v in spec.items()}
        return (fitter.refine(within, behind=behind) if refit else fitter.at(within)).loglik

    def run_if_it_can(spec: Spec, refit: bool, behind: float) -> float | None:
        try:
            return run(spec, refit, behind)
        except PamidError:  # the simulator does not follow the log
            return None

    return run_if_it_can


class Library(NamedTuple):
    """The library to first order."""

    templates: dict[str, list[Template]]
    """The templates of each effect that was evaluated."""
    interrupted: bool
    """Whether the user interrupted the rest."""
    learned: Sequence[Learned] = ()
    """What a flexible learner leaves of each equation, where nothing was interrupted."""

    @property
    def share(self) -> float:
        """Share of the gaps beyond the noise that it predicts."""
        return float(np.mean([one.share for one in self.learned])) if self.learned else 0.0


def learn(evidence: PortEvidence, library: Sequence[str], say: Callable[[str], None] = lambda _: None) -> Library:
    """Set the correlation time of each equation's unpredictable residual; return the templates."""
    known: dict[str, list[Template]] = {}
    kinds = {name: evidence.placements[name].effect for name in library}
    x = _fitted(evidence) if evidence.simulates else None
    simple = [n for n, e in kinds.items() if all(p.linear for p in e.parameters) or issubclass(e, FIXED)]
    try:
        for k, name in enumerate([*simple, *(name for name in library if name not in simple)]):
            say(f"sensitivity to {in_words(name)}, {k + 1} of {len(library)}")
            known[name] = _templates(evidence, name, x)
            if simple and name == simple[-1]:
                say(alone_so_far(FirstOrder(evidence, simple, None, known).alone()))
        learned = _remember(evidence, [t for name in library for t in known[name]], say)
    except KeyboardInterrupt as stop:
        stopped(stop)
        if not any(known.values()):
            raise
        return Library(known, True)
    return Library(known, False, learned)


def _remember(evidence: PortEvidence, found: Sequence[Template], say: Callable[[str], None]) -> list[Learned]:
    learned = list[Learned]()
    for equation, part in zip(evidence.equations, evidence.parts, strict=True):
        say(f"learn what could be explained, {len(learned) + 1} of {len(evidence.equations)}")
        mine = [replace(t, columns=evidence.raw(t.columns)[part]) for t in found]
        noise = float(np.sqrt(np.mean(np.square(evidence.noise[part]))))
        view = _view(evidence, equation, part)
        mine = [t for t in mine if np.any(t.columns)]
        learned.append(explainable(view, mine, noise, enough=1.0 + EXCESS))
    evidence.remember([one.left for one in learned])
    return learned


def _fitted(evidence: PortEvidence) -> np.ndarray | None:
    """Return the deviations that fit predictions best; None with a parameter at the end of its tolerance.

    Parameters compensate most of what an effect changes there, and all but exactly where they are fitted; at the end of
    a tolerance they stand in for a cause.
    """
    x = Fitter(evidence).base().x
    given = [k for k, name in enumerate(evidence.free) if name in evidence.simulator.parameters]
    return x if np.all(np.abs(x + evidence.about)[given] < 1.0) else None


def _templates(evidence: PortEvidence, name: str, x: np.ndarray | None) -> list[Template]:
    """Return the templates of an effect, and note which equations it changes."""
    place = evidence.placements[name]
    sizes = {p.name: abs(p.nominal or 0.1 * p.upper) for p in place.effect.parameters}
    found = laid(evidence, name, x)
    evidence.touches(name, [t.columns * [sizes[n] for n in t.linear] if t.linear else t.columns for t in found])
    return found if evidence.touched([name]) else []


def _view(evidence: PortEvidence, equation: str, part: slice) -> Learnable:
    """Return one equation of the evidence in the form that a learner reads."""
    log, signals = evidence.log, {k: v for k, v in evidence.signals().items() if np.ptp(v) > 0.0}
    position = evidence.roles(equation).get("eps", "")
    path = evidence.path_of(position) if position in signals else np.zeros(log.n)
    table = dict(sorted(signals.items(), key=lambda one: one[0] == position))
    return Learnable(
        evidence.value[part], evidence.noise[part], evidence.run[part], evidence.centre[part], table, path,
        log.starts, log.dt * evidence.pace,
    )  # fmt: skip


# --- the answer ---------------------------------------------------------------------------------------------
def outward(found: Diagnosis, evidence: PortEvidence, source: StackedEvidence | None = None) -> Diagnosis:
    """Return a diagnosis with effects and their ports apart, in the units of the ports, and the corrected simulator."""
    places = evidence.placements
    # Its own effects, and the first of each cause.
    spec = {c.effects[0]: {k: p.value for k, p in c.parameters.items()} for c in found.added}
    corrected = found.corrected if source is not None else evidence.corrected(spec, found.deviations)
    if not found.added:
        corrected = None if evidence.fitted is None else evidence.corrected({}, found.deviations)
    notes, physical = _forces(evidence, found, corrected) if corrected is not None else ([], {})
    about = (source or evidence).about
    free = source.free if source is not None else evidence.free
    begun = dict(zip(free, map(float, about), strict=True))
    deviations = {n: v + begun.get(n, 0.0) for n, v in found.deviations.items()}
    # The signals of one log are those at the centre of each window.
    signals = {k: v[evidence.centre] for k, v in evidence.signals().items()} if source is None else source.signals()
    return replace(
        in_units(found, places, physical),
        notes=[*found.notes, *steps_taken(deviations, evidence.log.dt), *at_limits(evidence.given, deviations), *notes],
        windows=_windows(found, signals),
        closure=_by_itself(evidence, found, spec) if source is None and found.added else found.closure,
        nominal=evidence.given,
        corrected=corrected,
        deviations=deviations,
    )


def at_limits(simulator: Simulator, deviations: Mapping[str, float]) -> list[str]:
    """Return a sentence for each parameter that a fit moved to the end of its tolerance: more may be wrong with it."""
    told = []
    for name, way in deviations.items():
        if name in simulator.parameters and abs(way) >= 1.0:
            p = simulator.parameters[name]
            limit = p.value * (1.0 + math.copysign(p.tolerance, way))
            end = "lower" if limit < p.value else "upper"
            told.append(
                f"{name} is at the {end} end of its tolerance, {limit:.4g} {p.unit}. If it may lie beyond, "
                "widen the tolerance: otherwise causes may be named for the rest."
            )
    return told


def _by_itself(evidence: PortEvidence, found: Diagnosis, spec: Spec) -> list[Closure]:
    """Return the closure with that of the corrected simulator, nothing within a sample fitted."""
    none = {k: -v for k, v in zip(evidence.free, map(float, evidence.about), strict=True)}
    own = {k: v for k, v in found.deviations.items() if k in evidence.given.parameters}
    # Steps that a fit allowed for are set aside in evidence that needs none of them.
    allowed = {k: v for k, v in found.deviations.items() if k not in own and v != none.get(k, v)}
    if not allowed:
        return found.closure
    parts = dict(zip(evidence.equations, evidence.parts, strict=True))

    def shares(more: Mapping[str, float]) -> dict[str, float]:
        left = evidence.raw(evidence.z(spec, {**none, **own, **more})) * evidence.noise
        return {c.equation: c.closed_by(rms(left[parts[c.equation]])) for c in found.closure}

    alone, told = shares({}), list[Closure]()
    short = {c.equation for c in found.closure if alone[c.equation] < c.ci90[0]}
    with_one = {k: shares({k: v}) for k, v in allowed.items()} if short else {}
    for c in found.closure:
        most = max(allowed, key=lambda k: with_one[k][c.equation]) if c.equation in short else ""
        told.append(replace(c, alone=alone[c.equation], allowed=most))
    return told


def in_units(
    found: Diagnosis, places: Mapping[str, Placement], physical: Mapping[tuple[str, str], str] | None = None
) -> Diagnosis:
    """Return a diagnosis with effects and their ports apart, in the units of the ports."""
    causes = [_cause(c, places, physical or {}) for c in found.causes]
    told = dict[tuple[str, str], Candidate]()
    for c in found.candidates:
        at = _candidate(c, places)
        told.setdefault((at.effect, at.where), at)
    alone = found.verdict == "class" and all(len(c.effects) == 1 for c in causes)
    return replace(
        found,
        verdict="cause" if alone else found.verdict,
        causes=causes,
        families=[_cause(c, places, physical or {}) for c in found.families],
        candidates=list(told.values()),
        logs=[replace(f, parameters={k: _at(places[k], v) for k, v in f.parameters.items()}) for f in found.logs],
        changes=[_changed(c, places) for c in found.changes],
    )


def _changed(change: Change, places: Mapping[str, Placement]) -> Change:
    """Return how a cause changed, in the units of its port."""
    place = places[change.effect]
    factor, unit = place.factor(change.parameter), place.units.get(change.parameter, change.unit)
    return replace(
        change, effect=place.name, where=place.port, before=change.before * factor, after=change.after * factor,
        unit=unit,
    )  # fmt: skip


def _forces(
    evidence: PortEvidence, found: Diagnosis, corrected: Simulator
) -> tuple[list[str], dict[tuple[str, str], str]]:
    """Return notes and sizes in newtons, by effect and parameter, for those in an input's or acceleration's unit."""
    notes: list[str] = []
    physical: dict[tuple[str, str], str] = {}
    if corrected.form != "ode":
        return notes, physical
    some, signals = some_instants(evidence.log.n), evidence.signals()
    x, u = (np.array([signals[n][some] for n in names]) for names in (corrected.states, corrected.inputs))
    for joint in evidence.joints:
        force = force_per_input(corrected, joint, evidence.log.t[some], x, u)
        if force is None:
            continue
        told: dict[str, str] = {}
        for cause in found.added:
            for name, parameters in zip(cause.effects, (cause.parameters, *cause.others), strict=True):
                place = evidence.placements[name]
                forced = place.acts and place.name != "back_emf"  # a back-EMF is none, a sensor's offset neither
                if not forced or place.port != joint.name:
                    continue
                for word, p in _at(place, parameters).items():
                    if unit_powers(parameters[word].unit).get("N", 0) == 1:
                        value, unit = as_force(p.value, p.unit, joint.unit, force)
                        physical[name, word] = f"{value:.4g} {unit}"
                        told[f"{place.name} {word}".replace("_", " ")] = physical[name, word]
        if told:
            at = f"at {joint.through} acts like" if joint.through else f"of {joint.name} corresponds to"
            notes.append(
                f"With {force.mass}, 1 {joint.unit} {at} {force.factor:.4g} {force.unit}"
                f"{f' at {joint.name}' if joint.through else ''}: {', '.join(f'{k} {v}' for k, v in told.items())}."
            )
    return notes, physical


def _cause(cause: Cause, places: Mapping[str, Placement], physical: Mapping[tuple[str, str], str]) -> Cause:
    first, *others = [
        {k: replace(p, physical=physical.get((name, k), "")) for k, p in _at(places[name], parameters).items()}
        for name, parameters in zip(cause.effects, (cause.parameters, *cause.others), strict=True)
    ]
    names = [places[e].name for e in cause.effects]
    ports = [places[e].port for e in cause.effects]
    known = [k for k, at in enumerate(zip(names, ports, strict=True)) if at in zip(names[:k], ports[:k], strict=True)]
    for k in reversed(known):  # another form of one law
        del names[k], ports[k], others[k - 1]
    return replace(
        cause, effects=tuple(names), where=tuple(filter(None, ports)), parameters=first, others=tuple(others),
        distinguished_by=cause.distinguished_by if others or not known else None,
    )  # fmt: skip


def _at(place: Placement, parameters: Mapping[str, ParameterEstimate]) -> dict[str, ParameterEstimate]:
    """Return the parameters of an effect in the units of its port."""
    return {name: p.scaled(place.factor(name), place.units.get(name, p.unit)) for name, p in parameters.items()}


def _candidate(c: Candidate, places: Mapping[str, Placement]) -> Candidate:
    place = places.get(c.effect)
    return c if place is None else replace(c, effect=place.name, where=place.port)


def _windows(found: Diagnosis, signals: Mapping[str, np.ndarray]) -> pd.DataFrame:
    table = found.windows.drop(columns=[c for c in STATE if c in found.windows.columns])
    taken = [c for c in table.columns if c in signals]
    return table.assign(**{k: v for k, v in signals.items() if k not in taken})
