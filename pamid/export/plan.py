"""What is exported: a fitted model taken apart into a geometric volume, a network, formulas and their inputs."""

import re
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from ..effects._terms import added
from ..effects.base import Effect, Signals
from ..effects.plant import Plant
from ..errors import ExportError
from ..laws.base import Law
from ..requirements import AddsEffects, WithLaws
from ..signals.state import STATE_SIGNALS, State
from ..volume.anchored import AnchoredVolume
from ..volume.contact import ContactVolume
from ..volume.neural import NeuralVolume
from ..volume.scaled import ScaledVolume
from .expression import Symbol, as_symbol, symbol
from .memory import Memory, Tracer

UNITS = {"eps": "-", "deps": "1/s", "P": "Pa, absolute", "dP": "Pa/s"}
"""Units of the inputs."""

STEP = 1.0 / 128.0
"""Time between the readings at which an export with memory is compared with ``predict``, s."""

JET = ("V", "V_eps", "V_P")
"""Names under which formulas read the volume and its derivatives."""


@dataclass(frozen=True)
class Output:
    """One thing that the exported model predicts."""

    name: str
    """Name of the equation: ``"force"`` or ``"flow"``."""
    unit: str
    """Its unit."""
    formula: Symbol
    """The prediction from the inputs, V, ∂V/∂ε and ∂V/∂P."""


@dataclass(frozen=True)
class ModelPlan:
    """A model ready to be written in another language."""

    name: str
    """A C identifier."""
    estimator: str
    """What it was."""
    inputs: Mapping[str, str]
    """The signals that it reads, and their units."""
    outputs: tuple[Output, ...]
    """What it predicts."""
    predict: Callable[[np.ndarray], np.ndarray]
    """The model's own ``predict`` on an array of shape (n_samples, n_inputs), as columns, for reference values."""
    centre: np.ndarray
    width: np.ndarray
    """Where the inputs of the fit lay, shape (n_inputs,)."""
    notes: tuple[str, ...]
    """What a user of the export must know."""

    @property
    def title(self) -> str:
        """What it is."""
        names = " and ".join(o.name for o in self.outputs)
        return f"{names} of a pneumatic artificial muscle, from a {self.estimator}"


@dataclass(frozen=True)
class ExportPlan(ModelPlan):
    """A model with a gas volume."""

    anchor: ContactVolume | None
    """The geometric part of the volume."""
    network: NeuralVolume | None
    """The learnt part."""
    factor: float
    offset: float
    """Factor on the volume, dimensionless, and what is added to it, m³."""
    volume: Callable[[np.ndarray], tuple[np.ndarray, ...]]
    """The model's own volume and its derivatives, from the inputs."""
    memory: Memory | None = None
    """What its effects remember; `predict` and `volume` then take the readings of a path, `STEP` seconds apart."""


def plan_of(model: Any, name: str = "muscle", effects: Sequence[Effect] = (), plant: Plant | None = None) -> ExportPlan:
    """Take a fitted model apart."""
    check_name(name)
    last, notes = last_step(model)
    own = list(last.effects_) if getattr(last, "effect_values_", None) else []
    if not own and isinstance(last, AddsEffects):  # a model that follows its muscle
        effects, plant = [*last.effects_, *effects], plant or last.plant
        notes.append("The parameters are those at the time of the export; here nothing follows the muscle.")
    laws, volume = last.laws if isinstance(last, WithLaws) else None, _fitted_volume(last)
    if (laws is None or volume is None) and effects:
        raise ExportError(
            f"{type(last).__name__} has no gas volume, and {', '.join(e.name for e in effects)} shall be added to it.",
            "a hybrid model where effects are added",
            "Leave --effect out, or fit a hybrid model.",
        )
    if laws is None or volume is None:
        raise ExportError(
            f"{type(last).__name__} has no gas volume of a form that can be written elsewhere.",
            "a hybrid model, a model around one, or a formula: geometric, polynomial, empirical, inverse",
            "Fit one of them; trees, networks and what remembers stay in Python.",
        )
    anchor, network, factor, offset = _parts(volume)
    notes += [f"{e!r} is part of the predictions." for e in (*own, *effects)]
    tracer = None
    if own:
        muscle = Plant.of_muscle(last.rest_length, last.rest_diameter, atmospheric_pressure=last.atmospheric_pressure)
        tracer = Tracer(own, [law.equation for law in laws()], muscle)
    outputs = tuple(_output(law, effects, plant, tracer) for law in laws())
    centre, width = (network.scale.mean, network.scale.spread) if network else _typical(anchor)

    def volumes(x: np.ndarray) -> tuple[np.ndarray, ...]:
        return tuple(np.asarray(v) for v in volume.jet(State(*x.T)))

    def predict(x: np.ndarray) -> np.ndarray:
        state, jet = State(*x.T), volumes(x)
        predicted = [np.asarray(law.predict(*jet, state)) for law in laws()]
        return np.column_stack(
            [y + _added(law, effects, plant, state) for y, law in zip(predicted, laws(), strict=True)]
        )

    plan = ExportPlan(
        name=name,
        estimator=type(last).__name__,
        inputs=UNITS,
        anchor=anchor,
        network=network,
        factor=factor,
        offset=offset,
        outputs=outputs,
        predict=predict,
        volume=volumes,
        centre=np.asarray(centre)[:4],
        width=np.asarray(width)[:4],
        notes=tuple(notes),
    )
    return plan if tracer is None else _remembering(plan, last, tracer, effects)


def _remembering(plan: ExportPlan, model: Any, tracer: Tracer, added: Sequence[Effect]) -> ExportPlan:
    """Return the plan of a model with effects of its own, whose answers follow a path of readings."""
    memory = tracer.memory()
    if added:
        raise ExportError(
            f"The model has effects of its own, and {', '.join(e.name for e in added)} shall be added to it.",
            "one or the other",
            "Leave --effect out, or fit with effects=.",
        )
    return replace(
        plan,
        predict=lambda x: _along(model, x, model.predict).reshape(len(x), -1),
        volume=lambda x: tuple(np.asarray(v) for v in _along(model, x, model.volume)),
        notes=(
            *plan.notes,
            "What effects remember begins with the first reading, as at rest, and follows each next one.",
        ),
        memory=memory,
    )


def check_name(name: str) -> None:
    """Refuse a name that cannot begin those of the code."""
    if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]{0,40}", name):
        raise ExportError(
            f"The name {name[:60]!r} is not a C identifier.", "letters, digits and _", "Pass another --name."
        )


def last_step(model: Any) -> tuple[Any, list[str]]:
    """Return the model at the end of a pipeline; steps that only estimate rates stay outside, others are refused."""
    steps = getattr(model, "steps", None)
    if steps is None:
        best = getattr(model, "best_estimator_", None)
        return (model, []) if best is None else last_step(best)
    notes = []
    for label, step in steps[:-1]:
        if step in (None, "passthrough"):
            continue
        if type(step).__name__ != "RateTransformer":
            raise ExportError(
                f"The step '{label}' ({type(step).__name__}) of the pipeline has no form outside Python.",
                "a hybrid model, after no more than a RateTransformer",
                "Fit the hybrid model on the signals themselves: it scales its inputs.",
            )
        notes.append("Rates are inputs: those of the pipeline look at later samples, which a controller has not.")
    return steps[-1][1], notes


def _fitted_volume(model: Any) -> Any:
    from sklearn.exceptions import NotFittedError

    if not isinstance(model, WithLaws):
        return None
    fitted: Any = model
    try:
        return fitted.volume_
    except NotFittedError:
        raise ExportError(
            f"The {type(model).__name__} is not fitted.", "a fitted model", "Fit it before exporting it."
        ) from None
    except AttributeError:  # its volume has no form of its own
        return None


def _parts(volume: Any) -> tuple[ContactVolume | None, NeuralVolume | None, float, float]:
    """Return anchor, network, factor and constant of a volume."""
    if isinstance(volume, AnchoredVolume):
        anchor, inner, *first = _parts(volume.anchor)
        other, network, *second = _parts(volume.correction)
        if inner is None and other is None and first == second:
            return anchor, network, first[0], first[1] + second[1]
    if isinstance(volume, ContactVolume):
        return volume, None, 1.0, 0.0
    if isinstance(volume, NeuralVolume):
        return None, volume, 1.0, 0.0
    if isinstance(volume, ScaledVolume):  # a similar muscle's volume, scaled
        anchor, network, factor, offset = _parts(volume.source)
        return anchor, network, volume.factor * factor, volume.factor * offset + volume.dead_volume
    raise ExportError(
        f"The volume is a {type(volume).__name__}, which has no form outside Python.",
        "a network, a ContactVolume, or one of them as an anchored volume",
        'Fit with volume_model="anchored" or "neural".',
    )


def _typical(anchor: ContactVolume | None) -> tuple[np.ndarray, np.ndarray]:
    reach = anchor.max_contraction if anchor else 0.3
    ambient = anchor.atmospheric_pressure if anchor else 1e5
    return np.array([reach / 2, 0.0, ambient + 2e5, 0.0]), np.array([reach / 5, 0.3, 1e5, 5e5])


# --- formulas -----------------------------------------------------------------------------------------------
def _along(model: Any, x: np.ndarray, ask: Callable[[Any], Any]) -> Any:
    """Return the prediction of a model with memory along one path of readings."""
    import pandas as pd

    names = [str(n) for n in model.feature_names_in_]
    table = pd.DataFrame(0.0, index=range(len(x)), columns=names)
    signals = {**dict(zip(STATE_SIGNALS, x.T, strict=True)), "time": STEP * np.arange(len(x))}
    for signal, values in signals.items():
        table[names[model.signal_columns_[signal]]] = values
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # a path for a self-test need not lie in the range of the fit
        return ask(table)


def _output(law: Law, effects: Sequence[Effect], plant: Plant | None, tracer: Tracer | None = None) -> Output:
    state = State(*(symbol(s) for s in STATE_SIGNALS))
    c = _traced(lambda: law.coefficients(state), f"The {law.equation} law {type(law).__name__}")
    V, V_eps, V_P = (symbol(n) for n in JET)
    formula = as_symbol(c.V) * V + as_symbol(c.V_eps) * V_eps + as_symbol(c.V_P) * V_P
    formula = as_symbol(formula + as_symbol(_added(law, effects, plant, state)))
    if tracer is not None:
        for effect in tracer.effects:
            own = _traced(partial(tracer.added, effect, law.equation), f"The effect {effect.name}")
            formula = as_symbol(formula + as_symbol(own))
    return Output(law.equation, law.unit, formula)


def _added(law: Law, effects: Sequence[Effect], plant: Plant | None, state: State) -> Any:
    """Return the sum of the effects in a law's prediction."""
    total: Any = 0.0
    s = Signals.of_state(state).with_(time=0.0 * state.P)
    for effect in effects:
        if law.equation not in effect.equations:
            continue
        hooks = set(effect.hooks())
        if effect.n_states or effect.sampled or not hooks <= {"force", "flow"}:
            why = "remembers what was before" if effect.n_states or effect.sampled else "changes more than a prediction"
            raise ExportError(
                f"The effect {effect.name} {why}, and the exported model is a function of the present signals.",
                "effects without memory on force or flow",
                "Leave it out, or keep it in Python.",
            )
        if plant is None and hooks & {"force", "flow"}:
            raise ExportError(
                f"The effect {effect.name} needs the numbers of the bench.", "a simulator file", "Add --sim SIM.toml."
            )
        bench: Any = plant
        share = partial(added, effect, law.equation, s, np.zeros(0), bench)
        total = total + _traced(share, f"The effect {effect.name}")
    return total


def _traced(call: Callable[[], Any], what: str) -> Any:
    try:
        return call()
    except ExportError as error:
        if error.found.startswith("The effect"):
            raise
        raise ExportError(f"{what} has no form outside Python: {error.found}", error.expected, error.remedy) from None
    except (TypeError, AttributeError, ValueError) as error:
        raise ExportError(
            f"{what} has no form outside Python: {str(error)[:160]}",
            "arithmetic and elementary functions of the signals",
            "Leave it out, or write it with numpy's functions.",
        ) from None
