"""The simulated bench: its parameters, its simulation, its data sets."""

from .controller import Controller
from .datasets import DATASETS, dataset, step_trajectories, training_trajectories, triangle_trajectories
from .kinematics import contraction, unfold
from .paper_like import paper_like_bench
from .parameters import BenchParameters, GasParameters, JointParameters, MuscleParameters, ValveParameters
from .references import (
    Trajectory,
    hold,
    isobaric,
    isometric,
    multisine,
    sealed_hold,
    sine,
    step,
    triangle,
)
from .sensors import IDEAL, SENSORS, Sensor
from .simulation import simulate

__all__ = [
    "DATASETS",
    "IDEAL",
    "SENSORS",
    "BenchParameters",
    "Controller",
    "GasParameters",
    "JointParameters",
    "MuscleParameters",
    "Sensor",
    "Trajectory",
    "ValveParameters",
    "contraction",
    "dataset",
    "hold",
    "isobaric",
    "isometric",
    "multisine",
    "paper_like_bench",
    "sealed_hold",
    "simulate",
    "sine",
    "step",
    "step_trajectories",
    "training_trajectories",
    "triangle",
    "triangle_trajectories",
    "unfold",
]
