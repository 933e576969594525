"""Units that a trainer asks a network to be trained in, instead of the spread of its data."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class TrainingUnits:
    """Fixed units of a training.

    Examples
    --------
    >>> from pamid.training.units import TrainingUnits
    >>> TrainingUnits((0.1, 0.1, 1e5, 1e5), {"flow": 2.1542e-5}, 1e-10).targets["flow"]  # a normal litre a minute, kg/s
    2.1542e-05
    """

    inputs: tuple[float, ...]
    """What one of each input is: contraction, its rate (1/s), pressure (Pa, absolute), its rate (Pa/s)."""
    targets: Mapping[str, float]
    """What one of the target is, by equation, such as kg/s of ``"flow"``."""
    volume: float
    """What one of the network's output is, m³."""
