"""Named effects of a hybrid model: identified beside its geometry, their memory read by its network."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import pandas as pd

from pamid.effects import Effect, make_effect
from pamid.effects._terms import Terms, WholeLog, acts_on, fit_effects, restored, terms_of
from pamid.effects.base import Signals
from pamid.effects.plant import Plant
from pamid.errors import IncompatibleError, MissingColumnError, MissingTrajectoryError, ParameterError
from pamid.signals.state import STATE_SIGNALS, State

from ._base import SignalEstimator, state_of
from ._trajectories import TRAJECTORY, trajectory_codes

if TYPE_CHECKING:
    from ._hybrid import HybridParameters

ROUNDS = 2
"""Rounds in which geometry and effects are fitted alternately, each to the other's residual."""


class Seen(NamedTuple):
    """What the parts of a model read of a table: state of the muscle, inputs of the network, what effects add."""

    state: State
    inputs: np.ndarray
    added: np.ndarray | None


def fitted_effects(model: HybridParameters) -> list[Effect]:
    """Return the identified effects of a fitted model."""
    values: dict[str, dict[str, float]] = getattr(model, "effect_values_", {})
    return [make_effect(name, **given) for name, given in values.items()]


def chosen_effects(model: HybridParameters) -> list[Effect]:
    """Return the effects that a model asks for, checked against its laws."""
    if model.effects is None:
        return []
    if isinstance(model.effects, str):
        raise ParameterError(f"effects={model.effects!r}.", "a list of names or of effects", "Put it in a list.")
    if isinstance(model.effects, Mapping):
        chosen = [make_effect(name, **values) for name, values in model.effects.items()]
    else:
        chosen = [e if isinstance(e, Effect) else make_effect(e) for e in model.effects]
    equations = {law.equation for law in model.laws()}
    for e in chosen:
        if not acts_on(e, equations):
            raise IncompatibleError(
                f"The effect {e.name} adds nothing to {' and '.join(sorted(equations))} of a muscle.",
                "effects on force or flow, or of the pressure sensor",
                "Leave it out.",
            )
    if len({e.name for e in chosen}) < len(chosen):
        raise ParameterError("An effect is named twice.", "each effect once", "Remove the second one.")
    return chosen


def plant_of(model: HybridParameters) -> Plant:
    """Return the muscle as effects see it: a braid of 25° of its length and diameter."""
    return Plant.of_muscle(model.rest_length, model.rest_diameter, atmospheric_pressure=model.atmospheric_pressure)


def whole_log(model: SignalEstimator, X: np.ndarray) -> WholeLog:
    """Return the signals of whole runs in order of time."""
    names = [str(name) for name in getattr(model, "feature_names_in_", ())]
    if TRAJECTORY not in names:
        raise MissingTrajectoryError(
            "The effects have memory, but X has no column 'trajectory'.",
            "a DataFrame whose column 'trajectory' names each row's run, rows in order of time",
            "Add the column.",
        )
    codes = trajectory_codes(pd.DataFrame({TRAJECTORY: X[:, names.index(TRAJECTORY)]}), None, needed_by="A memory")
    starts = np.concatenate([[0], np.flatnonzero(np.diff(np.asarray(codes))) + 1])
    time = X[:, model.signal_columns_["time"]]
    steps = np.diff(time)
    steps[starts[1:] - 1] = np.nan
    dt = float(np.nanmedian(steps)) if np.isfinite(steps).any() else 1.0
    if not dt > 0 or np.nanmin(steps, initial=dt) <= 0:
        raise MissingColumnError("Time does not increase within a run.", "rows in order of time, s", "Sort the table.")
    eps, deps, P, dP = state_of(model, X)
    return WholeLog(Signals(time=time, position=eps, velocity=deps, pressure=P, pressure_rate=dP), dt, starts)


def seen_by(model: HybridParameters, X: np.ndarray) -> Seen:
    """Return the inputs of a model's parts from a validated table."""
    effects = fitted_effects(model)
    if not effects:
        state, columns = state_of(model, X), model.signal_columns_
        as_they_are = X.shape[1] == len(state) and all(columns.get(s) == k for k, s in enumerate(STATE_SIGNALS))
        return Seen(state, X if as_they_are else np.array(state, dtype=float).T, None)
    plant = plant_of(model)
    log = restored(effects, whole_log(model, X))
    terms = [terms_of(effects, law.equation, log, plant) for law in model.laws()]
    state = _state_of(log)
    weights = [np.array([effects[i].values[p.name] for i, p in t.of]) for t in terms]
    added = np.column_stack([t.offset + t.columns @ w for t, w in zip(terms, weights, strict=True)])
    return Seen(state, np.column_stack([*state, *_remembered(terms)]), added)


def fit_model_effects(model: HybridParameters, X: np.ndarray, Y: np.ndarray, weight: np.ndarray, rng: Any) -> None:
    """Identify geometry and effects in turns, and keep the effects in the model."""
    from pamid.training.anchor import fit_anchor

    model.effect_values_ = {}
    effects = chosen_effects(model)
    if not effects:
        return
    log, laws, plant = whole_log(model, X), model.laws(), plant_of(model)
    known = np.isfinite(Y) & (weight > 0)[:, None]
    spread = [float(np.std(Y[known[:, k], k])) or 1.0 for k in range(len(laws))]
    roots = [np.where(known[:, k], np.sqrt(weight / weight.sum()), 0.0) / spread[k] for k in range(len(laws))]
    measured = np.where(known, Y, 0.0)
    model.effect_values_ = {
        e.name: {p.name: 0.0 if p.linear else e.values[p.name] for p in e.parameters} for e in effects
    }
    for _ in range(ROUNDS):
        seen = seen_by(model, X)
        added = np.zeros_like(Y) if seen.added is None else seen.added
        anchor = fit_anchor(
            [(law, seen.state, (Y - added)[:, k], weight) for k, law in enumerate(laws)],
            rest_length=model.rest_length,
            rest_diameter=model.rest_diameter,
            atmospheric_pressure=model.atmospheric_pressure,
            random_state=rng,
        )
        shares = [
            (law.equation, partial(_predicted, law, anchor), measured[:, k], roots[k]) for k, law in enumerate(laws)
        ]
        effects = fit_effects(effects, log, plant, shares)
        model.effect_values_ = {e.name: dict(e.values) for e in effects}


def _state_of(log: WholeLog) -> State:
    s = log.signals
    return State(*(np.asarray(v) for v in (s.position, s.velocity, s.pressure, s.pressure_rate)))


def _predicted(law: Any, volume: Any, log: WholeLog) -> np.ndarray:
    state = _state_of(log)
    return np.asarray(law.predict(*volume.jet(state), state))


def _remembered(terms: list[Terms]) -> list[np.ndarray]:
    """Return the terms that tell of the past alone, each once: what the network may read beside the state."""
    seen: dict[tuple[int, str], np.ndarray] = {}
    for t in terms:
        for column, (i, p), memory in zip(t.columns.T, t.of, t.memory, strict=True):
            if memory:
                seen.setdefault((i, p.name), column)
    return list(seen.values())
