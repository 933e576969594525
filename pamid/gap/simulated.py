"""The diagnosis of any simulator with ports: which effect, at which port, and what the simulator is with it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..effects.registry import effects_beside
from ..simulators.base import Simulator
from ..simulators.catalogue import chosen
from ..simulators.forces import as_force, force_per_input
from ..simulators.of_parameters import FIXED
from ..simulators.placement import Placement
from ..simulators.port_log import port_log
from ..simulators.structure import some_instants
from .diagnosis.findings import Candidate, Cause, ParameterEstimate
from .diagnosis.result import Diagnosis
from .engine import explain
from .inference.floor import explainable
from .inference.sensitivity import templates
from .readings import settled
from .residuals.direct import DirectEvidence
from .residuals.ports import PortEvidence
from .residuals.protocol import STATE
from .residuals.states import measured_states

if TYPE_CHECKING:
    import pandas as pd


def diagnose_simulator(
    log: pd.DataFrame,
    simulator: Simulator,
    effects: str | Sequence[str] = "all",
    *,
    seed: int = 0,
    progress: Callable[[str], None] | None = None,
) -> Diagnosis:
    """Say where a simulator and a log disagree, which effect at which port is the cause, and how far the gap closes.

    Parameters with a tolerance are refitted within it together with every candidate.

    Parameters
    ----------
    log : DataFrame
        ``trajectory``, ``time`` (s) and the columns that the simulator's ports name.
    simulator : Simulator
        The simulator.
    effects : "all" or sequence of str, default="all"
        Effects that may be causes: names as `pamid.simulators.port_effects` gives them, at every port, or such as
        ``"viscous_friction@motor"``.
    seed : int, default=0
        Seed of the draws behind p-values and intervals.
    progress : callable, optional
        Called with a short text at each step.

    Returns
    -------
    Diagnosis
        The answer; its causes say where they act, and ``corrected`` is the simulator with them.

    Raises
    ------
    MissingColumnError, ShortTrajectoryError
        The log cannot be used.
    UnknownOptionError
        No effect has a name.

    Examples
    --------
    >>> import numpy as np, pandas as pd
    >>> from pamid.gap import diagnose_simulator
    >>> from pamid.simulators import FunctionSimulator, Port
    >>> rng, runs = np.random.default_rng(0), []
    >>> for k in range(4):  # a mass of 2 kg on a rail, pushed to and fro, with 3 N s/m of friction
    ...     t, x, v = np.arange(0, 8, 0.01), [0.0], [0.0]
    ...     F = 5 * np.sin((1 + k) * t) + 3 * np.sin(0.7 * t)
    ...     for f in F[:-1]:
    ...         v.append(v[-1] + 0.01 * (f - 3 * v[-1]) / 2)
    ...         x.append(x[-1] + 0.005 * (v[-1] + v[-2]))
    ...     noisy = {"x": x + 1e-5 * rng.standard_normal(800), "v": v + 1e-3 * rng.standard_normal(800)}
    ...     runs.append(pd.DataFrame({"trajectory": str(k), "time": t, "F": F, **noisy}))
    >>> ports = [Port("F", "input", "N"), Port("x", "state", "m"), Port("v", "state", "m/s")]
    >>> rail = FunctionSimulator(lambda t, x, u, p: [x.v, u.F / p.m], ports, {"m": (2.0, 0.05, "kg")})
    >>> found = diagnose_simulator(pd.concat(runs), rail, ["viscous_friction", "quadratic_drag", "actuator_gain"])
    >>> found.causes[0].effects, found.causes[0].where, round(found.causes[0].parameters["coefficient"].value, 1)
    (('viscous_friction',), ('x',), 3.0)
    """
    from threadpoolctl import threadpool_limits

    say = progress or (lambda _: None)
    say("read the log")
    evidence = evidence_of(log, simulator, refit=True)
    library = [k for k in chosen(evidence.placements, effects) if evidence.touched([k])]
    # Thousands of small products: threads would only wait for one another.
    with threadpool_limits(1), effects_beside({k: p.effect for k, p in evidence.placements.items()}):
        library = settled(evidence, evidence.log, simulator, library, say)
        say("what could be explained at all")
        _learn(evidence, library)
        notes = [f"The residuals are {evidence.how}.", *evidence.notes]
        found = explain(evidence, library, np.random.RandomState(seed), notes, say)
    return outward(found, evidence)


def evidence_of(log: pd.DataFrame, simulator: Simulator, refit: bool = False) -> PortEvidence:
    """Return a log held against a simulator: directly where it holds the states, else by simulating short stretches.

    Parameters
    ----------
    log : DataFrame
        The log.
    simulator : Simulator
        The simulator.
    refit : bool, default=False
        Whether to begin from parameters that fit, where tolerances are wide.

    Returns
    -------
    PortEvidence
        The residuals.
    """
    from .residuals.choice import motion_is_hidden, sign_may_be_lost
    from .residuals.shooting import ShootingEvidence

    at_ports = port_log(log, simulator)
    derived = measured_states(simulator, at_ports)
    if derived is None:
        return ShootingEvidence(at_ports, simulator, refit=refit)
    found = DirectEvidence(at_ports, simulator, derived, refit)
    if simulator.form == "ode" and sign_may_be_lost(found):
        predicted = ShootingEvidence(at_ports, simulator, refit=refit)
        if predicted.folds:
            return predicted
    return ShootingEvidence(at_ports, simulator, refit=refit) if motion_is_hidden(found) else found


def free_run(log: pd.DataFrame, simulator: Simulator, *more: str) -> pd.DataFrame:
    """Return what a simulator, its effects among it, makes of a log's inputs, each run from its best initial state.

    Parameters
    ----------
    log : DataFrame
        The log; what it holds of states and outputs serves for the initial states alone.
    simulator : Simulator
        Of states, or of whole runs.
    *more : str
        States or outputs that are wanted though the log does not hold them.

    Returns
    -------
    DataFrame
        ``trajectory``, ``time`` (s), and each state or output that the log holds or is wanted, as the simulator has it.

    Raises
    ------
    ParameterError
        The simulator is algebraic: it has no runs.
    """
    import pandas as pd

    from ..errors import ParameterError
    from .residuals.shooting import ShootingEvidence

    if simulator.form == "algebraic":
        raise ParameterError("The simulator is algebraic.", "one of states or of whole runs", "Call its output.")
    at_ports = port_log(log, simulator)
    evidence = ShootingEvidence(at_ports, simulator, whole=True)
    names = [at_ports.names[k] for k in at_ports.run]
    return pd.DataFrame({"trajectory": names, "time": at_ports.t, **evidence.predicted(more)})


def _learn(evidence: PortEvidence, library: Sequence[str]) -> None:
    """Let the evidence know for how long what no learner predicts in an equation remembers."""
    left = []
    found = [t for name in library for t in templates(evidence, evidence.placements[name].effect)]
    for equation, part in zip(evidence.equations, evidence.parts, strict=True):
        mine = [replace(t, columns=evidence.raw(t.columns)[part]) for t in found]
        noise = float(np.sqrt(np.mean(np.square(evidence.noise[part]))))
        view = _view(evidence, equation, part)
        left.append(explainable(view, [t for t in mine if np.any(t.columns)], noise).left)
    evidence.remember(left)


def _view(evidence: PortEvidence, equation: str, part: slice) -> Any:
    """Return one equation of the evidence as a learner reads it."""
    signals = {k: v for k, v in evidence.signals().items() if np.ptp(v) > 0.0}
    roles = evidence.roles(equation)
    table = {k: v for k, v in signals.items() if k != roles.get("eps")}
    if roles.get("eps") in signals:
        table["position"] = signals[roles["eps"]]
    return SimpleNamespace(
        value=evidence.value[part], noise=evidence.noise[part], run=evidence.run[part], table=table,
        path=table.get("position", np.zeros(evidence.log.n)), first=evidence.centre[part], n=1,
        borders=evidence.log.starts, dt=evidence.log.dt,
    )  # fmt: skip


# --- the answer ---------------------------------------------------------------------------------------------
def outward(found: Diagnosis, evidence: PortEvidence) -> Diagnosis:
    """Return a diagnosis with effects and their ports apart, in the units of the ports, and the corrected simulator.

    Parameters
    ----------
    found : Diagnosis
        What the inference says, in the library's units.
    evidence : PortEvidence
        What it was found on.

    Returns
    -------
    Diagnosis
        The same for the reader.
    """
    places = evidence.placements
    corrected = corrected_simulator(evidence, found) if found.added else None
    forces = _forces(evidence, found, corrected) if corrected is not None else []
    return replace(
        found,
        notes=[*found.notes, *forces],
        causes=[_cause(c, places) for c in found.causes],
        families=[_cause(c, places) for c in found.families],
        candidates=[_candidate(c, places) for c in found.candidates],
        windows=_windows(found, evidence),
        nominal=evidence.given,
        corrected=corrected,
        deviations={n: v + float(a) for (n, v), a in zip(found.deviations.items(), evidence.about, strict=True)},
    )


def corrected_simulator(evidence: PortEvidence, found: Diagnosis) -> Simulator:
    """Return the simulator with the causes added: its own effects, and the first of each cause."""
    added = []
    for cause in found.added:
        place = evidence.placements[cause.effects[0]]
        inward = {k: p.value for k, p in cause.parameters.items()}
        added.append((place, place.outward(inward)))
    simulator = evidence.simulator
    numbers = dict(zip(simulator.parameters, evidence.numbers(found.deviations), strict=True))
    kept = []
    for place, values in added:
        made = place.made(values)
        if isinstance(made, FIXED):
            numbers[place.at] = made.adjust({"value": numbers[place.at]})["value"]
        else:
            kept.append((place.name, place.port, values))
    return simulator.with_(numbers, [*simulator.effects, *kept])


def _forces(evidence: PortEvidence, found: Diagnosis, corrected: Simulator) -> list[str]:
    """Return notes of what sizes in the unit of an input come to in newtons, where a mass says it."""
    if corrected.form != "ode":
        return []
    notes, some, signals = [], some_instants(evidence.log.n), evidence.signals()
    x, u = (np.array([signals[n][some] for n in names]) for names in (corrected.states, corrected.inputs))
    for joint in evidence.joints:
        force = force_per_input(corrected, joint, evidence.log.t[some], x, u)
        if force is None:
            continue
        told: dict[str, str] = {}
        for cause in found.added:
            for name, parameters in zip(cause.effects, (cause.parameters, *cause.others), strict=False):
                place = evidence.placements[name]
                volts = place.name == "back_emf" or place.port != joint.name  # a back-EMF is no force
                sizes = {} if volts else _at(place, parameters)
                for word, p in sizes.items():
                    if (size := as_force(p.value, p.unit, joint.unit, force)) is not None:
                        told[f"{place.name} {word}".replace("_", " ")] = f"{size[0]:.4g} {size[1]}"
        if told:
            at = f"1 {joint.unit} at {joint.through} acts like {force.factor:.4g} {force.unit} at {joint.name}"
            notes.append(f"With {force.mass}, {at}: {', '.join(f'{k} {v}' for k, v in told.items())}.")
    return notes


def _cause(cause: Cause, places: Mapping[str, Placement]) -> Cause:
    first, *others = [
        _at(places[name], parameters)
        for name, parameters in zip(cause.effects, (cause.parameters, *cause.others), strict=False)
    ]
    names = tuple(places[e].name for e in cause.effects)
    ports = tuple(places[e].port for e in cause.effects)
    return replace(cause, effects=names, where=ports, parameters=first, others=tuple(others))


def _at(place: Placement, parameters: Mapping[str, ParameterEstimate]) -> dict[str, ParameterEstimate]:
    """Return the parameters of an effect in the units of its port."""
    return {name: p.scaled(place.factor(name), place.units.get(name, p.unit)) for name, p in parameters.items()}


def _candidate(c: Candidate, places: Mapping[str, Placement]) -> Candidate:
    place = places.get(c.effect)
    return c if place is None else replace(c, effect=place.name, where=place.port)


def _windows(found: Diagnosis, evidence: PortEvidence) -> pd.DataFrame:
    signals = {k: v[evidence.centre] for k, v in evidence.signals().items()}
    table = found.windows.drop(columns=[c for c in STATE if c in found.windows.columns])
    taken = [c for c in table.columns if c in signals]
    return table.assign(**{k: v for k, v in signals.items() if k not in taken})
