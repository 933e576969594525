"""Effects beyond the nominal equations: one small class in one file each, found by automatic discovery."""

from .base import Effect, Parameter, Signals, Step
from .plant import Plant
from .registry import all_effects, make_effect

__all__ = ["Effect", "Parameter", "Plant", "Signals", "Step", "all_effects", "make_effect"]
