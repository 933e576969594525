"""Effects beyond the nominal equations: one small class in one file each, found by automatic discovery."""

from .._lazy import renamed
from .base import Effect, FlowTerm, Signals
from .plant import Plant
from .registry import all_effects, make_effect
from .spec import EffectSpec
from .values import Parameter

__all__ = ["Effect", "EffectSpec", "FlowTerm", "Parameter", "Plant", "Signals", "all_effects", "make_effect"]

__getattr__ = renamed(__name__, {"Step": "FlowTerm"})
