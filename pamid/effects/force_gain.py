"""A load cell with a wrong sensitivity."""

from __future__ import annotations

from ._sensor import Gain, OfForce


class ForceGain(OfForce, Gain):
    r"""A load cell with a wrong sensitivity.

    .. math:: F' = (1 + \delta)\,F
    """

    name = "force_gain"
