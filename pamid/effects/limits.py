"""Ranges that end, zones without response, and a speed that a command cannot exceed."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping

import numpy as np

from ..signals.state import Array
from ._places import OfCommand, OfForce
from .base import Effect, Signals
from .plant import Plant
from .values import parameter


class OutputSaturation(OfForce):
    r"""The delivered force, or a reading, saturates at a limit.

    .. math:: y' = \max(-y_s, \min(y_s, y))
    """

    name = "output_saturation"
    kinds = ("muscle", "actuator", "joint", "motor")
    limit = parameter("N", 1e-2, 1e5, 280.0, "largest value", idle=True)

    def measure(self, value: Array, x: Array) -> Array:
        """Return the value within ±y_s."""
        return np.clip(value, -self.limit, self.limit)


class ReadingRange(OutputSaturation):
    r"""A reading stays within the range of its sensor, about zero or with an end on one side only.

    .. math:: y' = \max(-y_s, \min(y_s, y)), \qquad y' = \min(y, y_u) \quad\text{or}\quad y' = \max(y, -y_d)
    """

    upper = parameter("N", 1e-2, 1e5, 280.0, "largest value, where only that side has an end", idle=True)
    depth = parameter("N", 1e-2, 1e5, 280.0, "how far it reads below 0, where only that side ends", idle=True)

    def measure(self, value: Array, x: Array) -> Array:
        """Return the value within the range."""
        if "upper" in self.values:
            value = np.minimum(value, self.upper)
        if "depth" in self.values:
            value = np.maximum(value, -self.depth)
        return value if {"upper", "depth"} & self.values.keys() else super().measure(value, x)

    @staticmethod
    def side_of(values: Mapping[str, float]) -> int:
        """Return the side on which a range with these values ends: 1 for the upper, -1 the lower, 0 for both."""
        return int("upper" in values) - int("depth" in values)

    @classmethod
    def ending(cls, side: int) -> type[Effect]:
        """Return the effect of a range that ends on one side, or on both (0)."""
        names = [p.name for p in cls.parameters]
        return cls.narrowed([n for n in names if n != names[side]])


class Slack(OfForce):
    r"""Slack muscle: the tension falls to zero, or to a residual tension once the muscle has buckled.

    .. math:: F' = F_0 + \tfrac{1}{2}\left(F - F_0 + \sqrt{(F - F_0)^2 + w^2}\right)

    Examples
    --------
    >>> from pamid.effects import make_effect
    >>> bool(make_effect("slack", rounding=20, rest=0).measure(-200.0, None) < 1)  # N: nothing is pushed
    True
    """

    name = "slack"
    family = "elasticity"
    kinds = ("muscle",)
    source = "10.1109/37.833638"
    rounding = parameter("N", 0.1, 200.0, 20.0, "force over which the muscle tightens", symbol="w")
    rest = parameter("N", 0.0, 100.0, 5.0, "tension of the loose muscle", symbol="F₀")

    def measure(self, value: Array, x: Array) -> Array:
        """Return the tension of a muscle that does not push, N."""
        over = value - self.rest
        return self.rest + 0.5 * (over + np.sqrt(np.square(over) + self.rounding**2))

    def restore(self, reading: Array, dt: float, starts: Array) -> Array:
        """Return the tension behind a reading; slack readings stay as they are."""
        over = np.asarray(reading, dtype=float) - self.rest
        true = over - self.rounding**2 / (4.0 * np.maximum(over, 1e-9))
        return self.rest + np.where(over > 0.25 * self.rounding, true, 0.0)


class ValveSaturation(OfCommand):
    r"""A stop before full opening.

    .. math:: u' = \max(-u_s, \min(u_s, u))
    """

    name = "valve_saturation"
    source = "10.1115/1.1286336"
    limit = parameter("-", 0.02, 1.0, 0.5, "largest opening", idle=True)

    def command(self, u: Array, s: Signals, x: Array, plant: Plant) -> Array:
        """Return the command within ±u_s."""
        return np.clip(u, -self.limit, self.limit)


class ValveDeadZone(OfCommand):
    r"""Overlap of the spool: small commands open nothing, larger ones less than they should.

    .. math:: u' = \mathrm{sgn}(u)\,\max(|u| - d_u,\, 0)\,\Big(1 + \frac{\kappa\, d_u}{1 - d_u}\Big), \qquad
        d_u = d\,(1 + \sigma\, \mathrm{sgn}\, u)

    With κ = 1 a full command still opens the valve fully, with κ = 0 it opens it by d less. Overlaps may differ for
    filling and venting (σ), and ports open gradually: within ρ d_u about the edge a parabola takes the corner's place.
    """

    name = "valve_dead_zone"
    source = "10.1115/1.1286336"
    width = parameter("-", 0.0, 0.5, 0.04, "size of the command up to which nothing responds", symbol="d")
    stretch = parameter("-", 0.0, 1.0, 0.0, "share of the lost travel that larger commands make up for", symbol="κ")
    skew = parameter(
        "-", -0.9, 0.9, 0.0, "by how much the zone is wider for positive commands than on the mean", symbol="σ"
    )
    rounding = parameter("-", 0.0, 1.0, 0.0, "half width of the round edges, as a share of the zone", symbol="ρ")

    def command(self, u: Array, s: Signals, x: Array, plant: Plant) -> Array:
        """Return the command less the dead zone."""
        width = self.width * (1.0 + self.skew * np.sign(u))
        steeper = 1.0 + self.stretch * width / (1.0 - width)
        past, edge = np.abs(u) - width, np.maximum(self.rounding * width, 1e-12)
        opened = np.where(np.abs(past) < edge, np.square(past + edge) / (4.0 * edge), np.maximum(past, 0.0))
        return np.sign(u) * opened * steeper


class ValveAsymmetry(OfCommand):
    r"""Ports of different size: the vent passes more than the inlet.

    .. math:: u' = (1 - \sigma\alpha)\,u\ (u \ge 0), \qquad u' = (1 + (1 - \sigma)\,\alpha)\,u\ (u < 0)

    With σ = 0 the nominal conductance is that of the inlet, with σ = 1/2 the mean of both.
    """

    name = "valve_asymmetry"
    source = "ISO 6358-1:2013"
    asymmetry = parameter("-", -0.9, 0.9, 0.2, "gain of negative commands less that of others", linear=True, symbol="α")
    split = parameter("-", 0.0, 1.0, 0.0, "share of it that positive commands lack", symbol="σ")

    def command(self, u: Array, s: Signals, x: Array, plant: Plant) -> Array:
        """Return the command, enlarged where it vents and reduced where it fills."""
        part = self.split * self.asymmetry
        return u + (self.asymmetry - part) * np.minimum(u, 0.0) - part * np.maximum(u, 0.0)


class ForceLimit(Effect):
    r"""The force or torque of an actuator saturates: :math:`F' = \max(-F_s, \min(F_s, F))`.

    It acts behind the actuator's own feedback, where a servo that lags its command no longer pulls harder.

    References
    ----------
    G. Stein, "Respect the unstable", IEEE Control Systems Magazine 23(4), 2003.
    https://doi.org/10.1109/MCS.2003.1213600
    """

    family = "drive"
    source = "10.1109/MCS.2003.1213600"
    limit = parameter("N", 1e-9, 1e9, 1.0, "largest force of the actuator", idle=True, points=6, symbol="F_s")

    def adjust(self, values: Mapping[str, float]) -> dict[str, float]:
        """Return the limit of the force, of which 0 is none: of two limits the tighter one acts."""
        own = values["value"]
        return {"value": np.where(own > 0.0, np.minimum(own, self.limit), self.limit)}


class SlewRate(OfCommand):
    r"""Largest speed at which a drive, a valve or an amplifier follows its command.

    .. math:: \dot u' = r\,\operatorname{sgn}(u - u')

    The command is updated once per control period.

    References
    ----------
    G. Stein, "Respect the unstable", IEEE Control Systems Magazine 23(4), 2003.
    https://doi.org/10.1109/MCS.2003.1213600
    """

    name = "slew_rate"
    kinds = ("bench", "motor")
    prior = -2.0  # a lag is the simpler model
    source = "10.1109/MCS.2003.1213600"
    n_states = 1
    sampled = True
    rate = parameter("1/s", 1e-2, 1e4, 2.0, "full commands that are passed in a second")

    def start(self, s: Signals, plant: Plant, dt: float) -> Array:
        """Return a settled output."""
        return np.stack([np.array(s.command, dtype=float)])

    def step(self, x: Array, s0: Signals, s1: Signals, dt: float, plant: Plant) -> Array:
        """Move towards the command of the later instant."""
        return x + np.clip(s1.command - x, -self.rate * dt, self.rate * dt)

    def trace(self, s: Signals, plant: Plant, dt: float, starts: Array) -> Array:
        """Return the output along each run."""
        u = np.asarray(s.command, dtype=float)
        lanes = u.reshape(len(u), -1).T
        return np.stack([_followed(lane, self.rate * dt, starts) for lane in lanes], axis=-1).reshape(1, *u.shape)


def _followed(u: Array, most: float, starts: Array) -> Array:
    """Return the rate-limited output of one command; plain numbers are fastest in a loop."""
    out = np.empty_like(u)
    for begin, end in itertools.pairwise([*np.asarray(starts).tolist(), len(u)]):
        path, x = [], float(u[begin])
        for target in u[begin:end].tolist():
            x = target if abs(target - x) <= most else x + math.copysign(most, target - x)
            path.append(x)
        out[begin:end] = path
    return out
