"""What a fit of a hybrid model begins with: checked parameters, rows held out, laws in coordinates of the network."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from pamid.errors import (
    ExcitationWarning,
    MissingTrajectoryError,
    ParameterError,
    TooFewTrajectoriesError,
    UnknownOptionError,
)
from pamid.fitting.epochs import drawn_rows
from pamid.fitting.stream_memory import Rows, merged
from pamid.signals.plausibility import check_units
from pamid.signals.state import State

from ._checks import row_weights

if TYPE_CHECKING:
    from ._hybrid import HybridParameters

VOLUMES = ("anchored", "neural")

AUTO_FRACTION = 0.2
"""Share of the runs that ``validation_fraction="auto"`` holds out."""

AUTO_TRAJECTORIES = 5
"""Number of runs below which ``validation_fraction="auto"`` holds none out."""


def check_parameters(model: HybridParameters) -> None:
    """Raise where a parameter of a hybrid model is out of range."""
    if model.volume_model not in VOLUMES:
        raise UnknownOptionError(
            f"volume_model={model.volume_model!r} is not known.", f"one of {', '.join(VOLUMES)}", "Choose one of them."
        )
    for name in ("rest_length", "rest_diameter"):
        value: Any = getattr(model, name)
        if not (isinstance(value, int | float) and np.isfinite(value) and value > 0):
            raise ParameterError(f"{name}={value!r}.", "a positive length in m", "Correct it.")
        if value > 10:
            raise ParameterError(
                f"{name}={value:g} looks like mm.", "a length in m", f"Divide by 1000: {name}={value / 1000:g}."
            )
    share: Any = model.validation_fraction
    if share != "auto" and not (isinstance(share, int | float) and 0 <= share < 1):
        raise ParameterError(f"validation_fraction={share!r}.", "'auto', or a share from 0 to below 1", "Correct it.")
    if model.dtype not in ("float32", "float64"):
        raise UnknownOptionError(f"dtype={model.dtype!r} is not known.", "'float32' or 'float64'", "Choose one.")


def warn_before(model: HybridParameters, state: State, Y: np.ndarray) -> None:
    """Warn about units and about data that hardly tell what is to be identified, before a fit spends its time."""
    targets = {law.target: Y[:, k] for k, law in enumerate(model.laws())}
    check_units(state._asdict() | targets, ambient_pressure=model.atmospheric_pressure)
    for k, law in enumerate(model.laws()):
        if len(Y) > 1 and np.nanmax(Y[:, k]) == np.nanmin(Y[:, k]):
            warnings.warn(
                f"The target of the {law.equation} equation is constant ({Y[0, k]:g} {law.unit}). Expected one "
                "that varies. Check the channel, or record a run that moves the muscle.",
                ExcitationWarning,
                stacklevel=5,
            )


class FitSamples(NamedTuple):
    """What a hybrid model is fitted to: a validated table, targets of shape (n, n_laws), weights, runs."""

    table: np.ndarray
    Y: np.ndarray
    weight: np.ndarray
    codes: np.ndarray | None

    def without_repeats(self) -> FitSamples:
        """Hold a row that comes several times once, with all its weight, and none without: a weight is a repetition."""
        unit = np.zeros(len(self.Y), dtype=int) if self.codes is None else self.codes
        rows = Rows(np.column_stack([self.table, unit]), self.Y, self.weight, unit).at(self.weight > 0)
        rows = merged(rows, whole=False)
        return FitSamples(rows.X[:, :-1], rows.y, rows.weight, None if self.codes is None else rows.unit)


def early_stopping_rows(
    model: HybridParameters, codes: np.ndarray | None, n: int, rng: Any, trainer: Any
) -> np.ndarray:
    """Draw the whole runs that early stopping watches."""
    fraction = AUTO_FRACTION if model.validation_fraction == "auto" else float(model.validation_fraction)
    if model.validation_fraction == "auto" and trainer.keeps_last:
        fraction = 0.0  # rows that decide nothing are better used for learning
    if codes is None or not fraction:
        if fraction and model.validation_fraction != "auto":
            raise MissingTrajectoryError(
                f"validation_fraction={fraction:g}, and neither groups nor a column 'trajectory'.",
                "one of the two, to hold out whole runs",
                "Pass groups=, keep a 'trajectory' column in a DataFrame, or set validation_fraction=0.",
            )
        return np.zeros(n, dtype=bool)
    names = np.unique(codes)
    if model.validation_fraction == "auto" and len(names) < AUTO_TRAJECTORIES:
        return np.zeros(n, dtype=bool)
    if len(names) < 3:
        raise TooFewTrajectoriesError(
            f"validation_fraction={fraction:g} with {len(names)} runs.",
            "at least three runs to hold one out",
            "Give more runs, or set validation_fraction=0.",
        )
    return drawn_rows(codes, fraction, rng, left=2)


def training_problem(
    model: HybridParameters, state: State, Y: np.ndarray, weight: np.ndarray, inputs: np.ndarray | None = None
) -> Any:
    """Put the laws into the network's coordinates, one block of rows a law."""
    import torch

    from pamid.training.problem import TrainingProblem

    xi, slope = model.input_scale_.apply(np.column_stack(state) if inputs is None else inputs)
    blocks = []
    for k, law in enumerate(model.laws()):
        c = law.coefficients(state)
        factor = model.volume_scale_ / model.target_scale_[k]
        direction = np.zeros_like(xi)
        direction[:, 0] = factor * c.V_eps * slope[:, 0]
        direction[:, 2] = factor * c.V_P * slope[:, 2]
        y = Y[:, k]
        if model.anchor_ is not None:
            y = y - law.predict(*model.anchor_.jet(state), state)
        counted = np.where(np.isfinite(y), weight, 0.0)
        y = np.where(np.isfinite(y), y, 0.0)
        blocks.append((xi, direction, factor * np.asarray(c.V), y / model.target_scale_[k], counted))
    stacked = [np.concatenate(part) for part in zip(*blocks, strict=True)]
    return TrainingProblem.from_arrays(*stacked, dtype=getattr(torch, model.dtype), device=model.device)


def volume_scale(model: HybridParameters, state: State, inputs: np.ndarray, weight: np.ndarray) -> float:
    """Choose the volume of one unit of output, so that the laws' targets are of the order of one."""
    _, slope = model.input_scale_.apply(inputs)
    logs = []
    for k, law in enumerate(model.laws()):
        c = law.coefficients(state)
        size = np.asarray(c.V) ** 2 + (c.V_eps * slope[:, 0]) ** 2 + (c.V_P * slope[:, 2]) ** 2
        rms = np.sqrt(np.average(size, weights=weight))
        logs.append(np.log(model.target_scale_[k] / rms) if rms > 0 else 0.0)
    return float(np.exp(np.mean(logs)))


def in_units(model: HybridParameters, trainer: Any) -> None:
    """Put a fitted scale into the units that a trainer asks for, where it has one for all laws."""
    laws = model.laws()
    if trainer.units is None or not all(law.equation in trainer.units.targets for law in laws):
        return
    model.target_scale_ = np.array([trainer.units.targets[law.equation] for law in laws])


def network_in_units(model: HybridParameters, trainer: Any) -> None:
    """Convert a published network to the units of its trainer; a correction to a geometry keeps its own."""
    in_units(model, trainer)
    units, scale = trainer.units, model.input_scale_
    if units is None or model.anchor_ is not None or len(scale.mean) != len(units.inputs):
        return
    if all(law.equation in units.targets for law in model.laws()):
        model.input_scale_ = replace(scale, mean=np.zeros(len(units.inputs)), spread=np.array(units.inputs))
        model.volume_scale_ = units.volume


def checked_weight(sample_weight: Any, X: np.ndarray) -> np.ndarray:
    """Return the weights of the samples as scikit-learn checks them; raise where none counts."""
    weight = row_weights(sample_weight, X)
    if not np.any(weight > 0):
        raise ValueError("sample_weight is zero for every sample. Expected at least one positive weight.")
    return weight


def overridden(trainer: Any, model: Any, *names: str) -> Any:
    """Return a trainer with those of its parameters that a model gives."""
    return trainer.set_params(**{name: value for name in names if (value := getattr(model, name)) is not None})


def counted_rows(Y: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Return which targets a training problem holds, law by law."""
    return (np.isfinite(Y) & (weight > 0)[:, None]).T.ravel()


def split_problem(problem: Any, held_out: np.ndarray, counted: np.ndarray) -> tuple[Any, Any]:
    """Return the problem of the rows to train on and that of the held-out ones, None without any."""
    import torch

    if not held_out.any():
        return problem, None
    rows = np.tile(held_out, len(counted) // len(held_out))[counted]
    return problem.split(torch.as_tensor(rows, device=problem.y.device))


def arrays_of(parameters: Sequence[Any]) -> list[np.ndarray]:
    """Return parameters of torch as arrays of numpy."""
    return [p.detach().cpu().numpy().astype(float) for p in parameters]


def span_of(x: np.ndarray) -> np.ndarray:
    """Return the least and greatest value of each column, shape (2, n_columns)."""
    return np.stack([x.min(axis=0), x.max(axis=0)])


def spread_of(y: np.ndarray, weight: np.ndarray) -> float:
    """Return the weighted standard deviation of a target; its size where it hardly varies, and 1 without samples."""
    keep = np.isfinite(y) & (weight > 0)
    if not keep.any():
        return 1.0
    mean = np.average(y[keep], weights=weight[keep])
    spread = float(np.sqrt(np.average((y[keep] - mean) ** 2, weights=weight[keep])))
    return spread if spread > 1e-12 * abs(mean) and spread > 0 else max(abs(float(mean)), 1.0)
