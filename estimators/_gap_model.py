"""A hybrid model that holds the causes of a diagnosis as its effects."""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from pamid.effects._terms import of_causes
from pamid.effects.plant import Plant
from pamid.errors import EffectsWarning, IncompatibleError

if TYPE_CHECKING:
    from ._pihm import HybridModel


def hybrid_with(causes: Sequence[Any], equation: str, plant: Plant | None) -> HybridModel:
    """Return an unfitted hybrid model of a muscle's force or flow that holds the causes which it can."""
    from .static_pihm import StaticPIHM
    from .thermodynamic_pihm import ThermodynamicPIHM

    kinds: dict[str, type[HybridModel]] = {"force": StaticPIHM, "flow": ThermodynamicPIHM}
    if plant is None or equation not in kinds:
        raise IncompatibleError(
            f"The diagnosis is of {equation}{'' if plant else ' without a plant'}.",
            "force or flow of a muscle, whose length and diameter plant= gives",
            "Pass plant= before the fit, or predict with the diagnoser itself.",
        )
    values = [
        (c.effects, [{k: p.value for k, p in found.items()} for found in (c.parameters, *c.others)]) for c in causes
    ]
    held, left = of_causes(values, {equation})
    if left:
        warn_left_out(left)
    around = math.sqrt(max(plant.thread_length**2 - plant.rest_length**2, 0.0))
    model: Any = kinds[equation]
    return model(
        plant.rest_length,
        around / (math.pi * plant.turns),
        atmospheric_pressure=plant.atmospheric_pressure,
        effects={e.name: dict(e.values) for e in held} or None,
    )


def warn_left_out(left: Sequence[str]) -> None:
    """Warn of causes that a hybrid model does not hold."""
    warnings.warn(
        f"{', '.join(left)}: a hybrid model cannot hold it as an effect. Expected terms of the force or flow, or "
        "faults of the pressure's sensor. Its network takes what depends on the state; the rest stays.",
        EffectsWarning,
        stacklevel=4,
    )
