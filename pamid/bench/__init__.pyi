# Written by python docs/tables.py.

from .controller import Controller as Controller
from .datasets import DATASETS as DATASETS
from .datasets import dataset as dataset
from .datasets import step_trajectories as step_trajectories
from .datasets import training_trajectories as training_trajectories
from .datasets import triangle_trajectories as triangle_trajectories
from .kinematics import contraction as contraction
from .kinematics import unfold as unfold
from .paper_like import paper_like_bench as paper_like_bench
from .parameters import BenchParameters as BenchParameters
from .parameters import GasParameters as GasParameters
from .parameters import JointParameters as JointParameters
from .parameters import MuscleParameters as MuscleParameters
from .parameters import ValveParameters as ValveParameters
from .references import Trajectory as Trajectory
from .references import hold as hold
from .references import isobaric as isobaric
from .references import isometric as isometric
from .references import multisine as multisine
from .references import sealed_hold as sealed_hold
from .references import sine as sine
from .references import step as step
from .references import triangle as triangle
from .sensors import IDEAL as IDEAL
from .sensors import SENSORS as SENSORS
from .sensors import Sensor as Sensor
from .simulation import simulate as simulate

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
