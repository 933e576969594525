r"""What a law is: a linear functional of the gas volume.

Both laws of the hybrid models read the volume and its derivatives linearly:

.. math:: y = a(s)\, V + b_\varepsilon(s)\, \frac{\partial V}{\partial\varepsilon}
    + b_P(s)\, \frac{\partial V}{\partial P}

with coefficients that depend on the measured state `s` alone. A law is those three coefficients. That is what lets
any volume model meet any law and any trainer: a trainer needs one directional derivative of the network along
:math:`(b_\varepsilon, 0, b_P, 0)` and never asks which law it serves.
"""

from abc import ABC, abstractmethod
from typing import ClassVar, NamedTuple

from ..signals.state import Array, State


class Coefficients(NamedTuple):
    """The factors of V, ∂V/∂ε and ∂V/∂P in a law, one entry per sample.

    Examples
    --------
    >>> from pamid.laws.quasi_static import QuasiStaticForce
    >>> from pamid.signals import State
    >>> QuasiStaticForce(rest_length=0.2).coefficients(State(0.1, 0.0, 301325.0, 0.0))
    Coefficients(V=0.0, V_eps=1000000.0, V_P=0.0)
    """

    V: Array
    V_eps: Array
    V_P: Array


class Law(ABC):
    """A law that turns the gas volume and its derivatives into something measured.

    Examples
    --------
    >>> from pamid.laws.base import Law
    >>> from pamid.laws.thermodynamic import ThermodynamicFlow
    >>> law = ThermodynamicFlow()
    >>> isinstance(law, Law), law.equation, law.target, law.unit
    (True, 'flow', 'mdot', 'kg/s')
    """

    equation: ClassVar[str]
    """Name of the equation of the bench that the law states: ``"force"`` or ``"flow"``."""
    target: ClassVar[str]
    """Column of a log that holds what the law predicts."""
    unit: ClassVar[str]
    """Unit of the prediction."""
    slope_alone: ClassVar[bool] = False
    """Whether the law reads ∂V/∂ε and neither V nor ∂V/∂P, so that these need not be computed."""

    @abstractmethod
    def coefficients(self, state: State) -> Coefficients:
        """Return the factors of V, ∂V/∂ε and ∂V/∂P at each sample of ``state``."""

    def predict(self, V: Array, V_eps: Array, V_P: Array, state: State) -> Array:
        """Return the prediction, in the law's `unit`, from a volume (m³), its derivatives (m³, m³/Pa) and the signals
        of the muscle.
        """
        c = self.coefficients(state)
        return c.V * V + c.V_eps * V_eps + c.V_P * V_P
