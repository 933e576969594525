"""Simulators of any origin, with ports: functions, equations, control systems, MuJoCo models, FMUs."""

from .base import Simulator
from .between import Between
from .catalogue import port_effects
from .control_model import ControlSimulator
from .equation_model import EquationSimulator
from .fmu_model import FmuSimulator
from .function import FunctionSimulator
from .mujoco_model import MujocoSimulator
from .page import page_text, read_simulator, simulator_kinds
from .ports import ModelParameter, Port

__all__ = [
    "Between",
    "ControlSimulator",
    "EquationSimulator",
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
