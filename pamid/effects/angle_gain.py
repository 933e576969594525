"""An encoder with a wrong scale."""

from __future__ import annotations

from ._sensor import Gain, OfAngle


class AngleGain(OfAngle, Gain):
    r"""An encoder with a wrong scale.

    .. math:: q' = (1 + \delta)\,q
    """

    name = "angle_gain"
