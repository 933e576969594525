"""Two muscles that pull on one pulley against each other: kinematics, torque and motion."""

from dataclasses import dataclass
from typing import Annotated, ClassVar

from ..explained import explained_fields
from ..signals.state import Array


@explained_fields
@dataclass(frozen=True)
class AntagonisticJoint:
    r"""Joint of two identical muscles on one pulley.

    .. math:: \varepsilon_1 = \varepsilon_0 + \frac{r q}{L_0}, \quad \varepsilon_2 = \varepsilon_0 - \frac{r q}{L_0},
        \qquad J \ddot q = r (F_1 - F_2) - b_q \dot q

    A positive angle shortens muscle 1 and stretches muscle 2, so tension of muscle 1 turns the joint to positive
    angles; the work of muscle 1 on the joint is r F₁ dq = −F₁ dL₁.

    Examples
    --------
    >>> from pamid.laws.joint import AntagonisticJoint
    >>> joint = AntagonisticJoint(pulley_radius=0.04, rest_length=0.2, initial_contraction=0.12, inertia=0.02)
    >>> eps1, eps2 = joint.contractions(0.2)  # rad
    >>> print(f"{eps1:.2f} and {eps2:.2f}")
    0.16 and 0.08
    """

    pulley_radius: Annotated[float, "r, m."]
    rest_length: Annotated[float, "L₀ of each muscle, m."]
    initial_contraction: Annotated[float, "ε₀ of both muscles at q = 0, dimensionless."]
    inertia: Annotated[float, "J of the joint, kg m²."]
    viscous_damping: Annotated[float, "b_q, N m s/rad."] = 0.0

    equation: ClassVar[str] = "joint"
    target: ClassVar[str] = "q"
    unit: ClassVar[str] = "N m"

    def contractions(self, q: Array) -> tuple[Array, Array]:
        """Return (ε₁, ε₂) at joint angle ``q`` (rad)."""
        turn = self.pulley_radius * q / self.rest_length
        return self.initial_contraction + turn, self.initial_contraction - turn

    def lengths(self, q: Array) -> tuple[Array, Array]:
        """Return (L₁, L₂) in m at joint angle ``q`` (rad)."""
        eps1, eps2 = self.contractions(q)
        return self.rest_length * (1.0 - eps1), self.rest_length * (1.0 - eps2)

    def angle(self, eps1: Array) -> Array:
        """Return the joint angle (rad) at which muscle 1 is contracted by ``eps1``."""
        return (eps1 - self.initial_contraction) * self.rest_length / self.pulley_radius

    def torque(self, F1: Array, F2: Array) -> Array:
        """Return the torque r (F₁ − F₂) of the muscles, N m, from their tensions (N)."""
        return self.pulley_radius * (F1 - F2)

    def acceleration(self, F1: Array, F2: Array, dq: Array, external_torque: Array = 0.0) -> Array:
        """Return q̈ (rad/s²) from the tensions (N), the joint speed (rad/s) and a torque from outside (N m)."""
        return (self.torque(F1, F2) - self.viscous_damping * dq + external_torque) / self.inertia

    def residual(self, F1: Array, F2: Array, dq: Array, ddq: Array) -> Array:
        """Return the residual of the equation of motion, r (F₁ − F₂) − b_q q̇ − J q̈, in N m."""
        return self.torque(F1, F2) - self.viscous_damping * dq - self.inertia * ddq
