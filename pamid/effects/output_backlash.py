"""Lost motion between the driven part and the reading."""

from __future__ import annotations

import numpy as np

from ..signals.state import Array
from ._laws import LostMotion
from .values import Parameter


class OutputBacklash(LostMotion):
    r"""Lost motion behind a drive: after a reversal its output stays constant until the play is used up.

    .. math:: y' = \mathrm{play}_w(y)

    This is a gear's play, or a position controller of low gain k against dry friction :math:`F_c`, for which w is
    :math:`F_c / k`: the joint sticks until the control error overcomes the friction. Each run begins at its first
    reading.

    Parameters
    ----------
    **values : float
        ``half_width`` w (unit of the reading).

    Examples
    --------
    >>> import numpy as np
    >>> from pamid.effects import make_effect
    >>> from pamid.effects.base import Signals
    >>> lost = make_effect("output_backlash", half_width=0.5)
    >>> lost.trace(Signals(force=np.array([0.0, 2.0, 1.5, 0.0])), None, 0.01, np.array([0]))[0]
    array([0. , 1.5, 1.5, 0.5])
    """

    name = "output_backlash"
    equations = ("joint",)
    roles = ("force",)
    of = "force"
    channel = "F"
    kinds = ("joint", "motor")
    prior = -4.0  # friction at the joint is equivalent for a drive that pushes with a force
    parameters = (Parameter("half_width", "N", 0.0, 1e3, 1.0, "half the play"),)

    def measure(self, value: Array, x: Array) -> Array:
        """Return the dragged position."""
        return np.asarray(x[0])
