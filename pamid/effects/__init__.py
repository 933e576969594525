"""Effects beyond the nominal equations: a file is a law, a class the law in one place."""

from .._lazy import renamed
from . import _old_modules  # noqa: F401 - it serves old names
from .base import Effect, FlowTerm, Signals
from .plant import Plant
from .registry import all_effects, make_effect
from .spec import EffectSpec
from .values import Parameter, parameter

__all__ = [
    "Effect", "EffectSpec", "FlowTerm", "Parameter", "Plant", "Signals", "all_effects", "make_effect", "parameter",
]  # fmt: skip

__getattr__ = renamed(__name__, {"Step": "FlowTerm"})
