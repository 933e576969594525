"""Places where a law acts: on the reading of a sensor, or on a command."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from ..signals.state import ROLES, Array
from .base import Effect, Signals
from .plant import Plant

ROLE = {channel: ROLES[channel] for channel in ("q", "P", "F", "mdot")}
"""The role in which each channel's true value reaches a sensor's memory."""


class OnSignal(Effect):
    """A law of one signal."""

    of: ClassVar[str]
    """The role of the signal."""

    def signal(self, s: Signals) -> Array:
        """Return the signal: numbers, or symbols in an export."""
        return getattr(s, self.of)


class OfCommand(Effect):
    """Of the command of a valve or drive; what has memory delivers its first state."""

    family = "valve"
    equations = ("valve",)
    of = "command"
    roles = ("command",)

    def command(self, u: Array, s: Signals, x: Array, plant: Plant) -> Array:
        """Return the output that follows the command."""
        return x[0]


class Invertible(Effect):
    """A fault that each reading shows by itself."""

    def restore(self, reading: Array, dt: float, starts: Array) -> Array:
        """Return the values behind the readings."""
        return self.restore_next(reading, reading, np.asarray(dt))


class OfReading(Effect):
    """Of the reading of a sensor; what has memory reads its first state."""

    family = "sensor"
    source = "10.1007/3-540-30368-5"

    def measure(self, value: Array, x: Array) -> Array:
        """Return the reading."""
        return x[0]


class OfForce(OfReading):
    """Of a load cell, or of what a drive delivers."""

    equations: ClassVar[tuple[str, ...]] = ("force", "joint")
    channel = "F"
    of = "force"
    roles = ("force",)


class OfFlow(OfReading):
    """Of a flow meter."""

    equations: ClassVar[tuple[str, ...]] = ("flow", "valve")
    channel = "mdot"
    of = "flow"
    roles = ("flow",)


class OfPressure(OfReading):
    """Of a pressure sensor."""

    equations: ClassVar[tuple[str, ...]] = ("force", "flow", "valve")
    channel = "P"
    of = "pressure"
    roles = ("pressure",)


class OfAngle(OfReading):
    """Of an encoder."""

    equations: ClassVar[tuple[str, ...]] = ("force", "flow", "joint")
    channel = "q"
    site = "joint"
    of = "position"
    roles = ("position",)
