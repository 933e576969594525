"""The simulated bench: its parameters, its simulation, its data sets."""

from .._lazy import attach, homes

_HOME = homes(
    controller="Controller",
    datasets="DATASETS dataset step_trajectories training_trajectories triangle_trajectories",
    kinematics="contraction unfold",
    paper_like="paper_like_bench",
    parameters="BenchParameters GasParameters JointParameters MuscleParameters ValveParameters",
    references="Trajectory hold isobaric isometric multisine sealed_hold sine step triangle",
    sensors="IDEAL SENSORS Sensor",
    simulation="simulate",
)
"""In which module each public name lives."""

__getattr__, __dir__, __all__ = attach(__name__, _HOME)
