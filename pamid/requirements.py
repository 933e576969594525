"""What estimators declare of themselves, and one checker that words the error where a declaration does not fit.

An estimator declares ``reads`` (the signals it takes from X), ``equations`` (what it learns), ``outputs`` (of which it
runs freely), ``sequential`` (whether rows are read in order) and ``settings(equation)`` (those that are compared).
An estimator of somebody else's declares nothing; what holds for it then is said by the caller. What some estimators can
do beside, such as say their predictions as formulas, is a protocol, and asked for by ``isinstance``.
"""

from collections.abc import Collection, Hashable, Mapping, Sequence
from functools import cache
from typing import Any, Protocol, runtime_checkable

from .errors import IncompatibleError


@runtime_checkable
class WithFormulas(Protocol):
    """An estimator whose predictions are formulas of its signals."""

    def formulas(self, signals: Mapping[str, Any]) -> dict[str, tuple[str, Any]]:
        """Return unit and value of each output, from signals in SI units that may be symbols."""


@runtime_checkable
class WithLift(Protocol):
    """An estimator of a muscle's elements, by which a load is lifted."""

    def lift_formulas(self, signals: Mapping[str, Any]) -> tuple[tuple[Any, Any, Any], dict[str, float]]:
        """Return force (N), stiffness (N/m) and damping (N s/m), and the numbers of the lift."""


@runtime_checkable
class WithLaws(Protocol):
    """An estimator of laws that read a gas volume."""

    def laws(self) -> tuple[Any, ...]:
        """Return the laws, one an output."""


@runtime_checkable
class AddsEffects(Protocol):
    """A fitted estimator that adds effects to its predictions."""

    effects_: Any
    plant: Any


@runtime_checkable
class WithBounds(Protocol):
    """An estimator whose parameters have bounds."""

    def parameter_bounds(self) -> dict[str, tuple[float, float]]:
        """Return the bounds of each parameter by name, SI units."""


@runtime_checkable
class WithScaledInputs(Protocol):
    """A fitted estimator that has standardised its inputs."""

    inputs: Any
    input_mean_: Any
    input_scale_: Any


@runtime_checkable
class WithVolume(Protocol):
    """An estimator that identifies the gas volume."""

    def volume(self, X: Any) -> Any:
        """Return V (m³) and its derivatives at the rows of X."""


def formulas_of(model: Any, signals: Mapping[str, Any]) -> dict[str, tuple[str, Any]]:
    """Return unit and value of each output as formulas of the signals; empty for a model that has none."""
    kind: Any = type(model)
    return model.formulas(signals) if _writes_formulas(kind) else {}


@cache  # a protocol takes longer to ask than a formula on one row
def _writes_formulas(kind: Hashable) -> bool:
    return isinstance(kind, type) and issubclass(kind, WithFormulas)


def last_step(model: Any) -> Any:
    """Return the estimator of a pipeline, or the model itself."""
    steps = getattr(model, "steps", None)
    return steps[-1][1] if steps else model


def reads_of(model: Any, otherwise: Sequence[str] = ()) -> tuple[str, ...]:
    """Return the signals that an estimator reads from X."""
    return tuple(getattr(model, "reads", otherwise))


def is_sequential(model: Any) -> bool:
    """Return whether an estimator reads the sequence of samples, as it says itself or by its parameters."""
    return bool(getattr(model, "sequential", "one_trajectory" in model.get_params()))


def parameter_count(model: Any) -> int | None:
    """Count the numbers that a fit has set: as the estimator says, or by what it holds; None if it does not tell."""
    import numpy as np

    if (own := getattr(model, "n_parameters_", None)) is not None:
        return int(own)
    if (last := last_step(model)) is not model:
        return parameter_count(last)
    weights = getattr(model, "weights_", getattr(model, "coefs_", getattr(model, "coef_", None)))
    if weights is None:
        return None
    parts = weights.values() if isinstance(weights, Mapping) else weights
    if isinstance(parts, np.ndarray):
        return int(parts.size)
    return int(sum(np.size(p) for p in parts)) + sum(np.size(p) for p in getattr(model, "intercepts_", ()))


def check_reads(
    model: Any,
    allowed: Collection[str],
    *,
    needed: Collection[str] = (),
    sequential: bool = True,
    otherwise: Sequence[str] = (),
    instead: str,
) -> tuple[str, ...]:
    """Return the signals that an estimator reads, once they are known to fit."""
    reads = reads_of(model, otherwise)
    ordered = not sequential and is_sequential(model)
    if ordered or set(reads) - set(allowed) or set(needed) - set(reads) or not reads:
        rows = "" if sequential else " of single rows"
        least = f", at least of {', '.join(needed)}" if needed else ""
        raise IncompatibleError(
            f"{type(model).__name__} reads {', '.join(reads) or 'unknown signals'}{' in sequence' if ordered else ''}.",
            f"a model{rows} of {', '.join(allowed)}{least}",
            instead,
        )
    return reads
