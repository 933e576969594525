"""Units that a trainer asks a network to be trained in, instead of the spread of its data."""

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class TrainingUnits:
    """Fixed units of a training."""

    inputs: tuple[float, ...]
    """What one of each input is: contraction, its rate (1/s), pressure (Pa, absolute), its rate (Pa/s)."""
    targets: Mapping[str, float]
    """What one of the target is, by equation, such as kg/s of ``"flow"``."""
    volume: float
    """What one of the network's output is, m³."""
