"""Simulators of any origin: functions, control systems, MuJoCo models and FMUs, with ports at which effects act."""

from .base import Simulator
from .catalogue import port_effects
from .control_model import ControlSimulator
from .fmu_model import FmuSimulator
from .function import FunctionSimulator
from .mujoco_model import MujocoSimulator
from .page import page_text, read_simulator, simulator_kinds
from .ports import ModelParameter, Port

__all__ = [
    "ControlSimulator",
    "FmuSimulator",
    "FunctionSimulator",
    "ModelParameter",
    "MujocoSimulator",
    "Port",
    "Simulator",
    "page_text",
    "port_effects",
    "read_simulator",
    "simulator_kinds",
]
