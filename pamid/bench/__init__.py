"""The twin of the bench: its parameters, its simulation, its data sets."""

from .kinematics import contraction, unfold
from .parameters import BenchParameters, GasParameters, JointParameters, MuscleParameters, ValveParameters

__all__ = [
    "BenchParameters",
    "GasParameters",
    "JointParameters",
    "MuscleParameters",
    "ValveParameters",
    "contraction",
    "unfold",
]
