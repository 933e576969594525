"""Simulators of any origin: functions, control systems, MuJoCo models and FMUs, with ports at which effects act."""

from .base import Simulator
from .catalogue import port_effects
from .function import FunctionSimulator
from .ports import ModelParameter, Port

__all__ = ["FunctionSimulator", "ModelParameter", "Port", "Simulator", "port_effects"]
