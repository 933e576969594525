"""Sensors of the bench: noise and resolution of each channel."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from ..explained import explained_fields


@explained_fields
@dataclass(frozen=True)
class Sensor:
    """Noise and resolution of one channel.

    Examples
    --------
    >>> import numpy as np
    >>> from pamid.bench import Sensor
    >>> Sensor(noise=0.3, resolution=0.5).read(np.array([10.0, 10.1]), np.random.default_rng(0))  # N
    array([10., 10.])
    """

    noise: Annotated[float, "Standard deviation of white Gaussian noise, unit of the channel."] = 0.0
    resolution: Annotated[float, "Step of the converter, unit of the channel; 0 for none."] = 0.0

    def read(self, values: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Return the sensor's readings of the true ``values``."""
        out = np.array(values, dtype=float)
        if self.noise:
            out += self.noise * rng.standard_normal(out.shape)
        if self.resolution:
            out = np.round(out / self.resolution) * self.resolution
        return out

    @property
    def standard_deviation(self) -> float:
        """Standard deviation of a reading about the true value: noise and rounding together."""
        return math.hypot(self.noise, self.resolution / math.sqrt(12.0))


SENSORS: Mapping[str, Sensor] = {
    "q": Sensor(1.9e-5, 2.0 * math.pi / 2**18),
    "P": Sensor(60.0, 1e6 / 2**16),
    "F": Sensor(0.07, 1000.0 / 2**16),
    "mdot": Sensor(3e-6, 0.02 / 2**16),
}
"""The sensors of the bench: an encoder of 18 bit (rad), 16-bit converters for 10 bar (Pa), 1 kN (N), ±10 g/s (kg/s)."""

IDEAL: Mapping[str, Sensor] = {channel: Sensor() for channel in SENSORS}
"""Sensors that read the truth."""
