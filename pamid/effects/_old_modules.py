"""Modules of one effect each, as this package had them: `pamid.effects.creep` and others still serve one version."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Sequence
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec
from types import ModuleType

from .registry import all_effects


class _OldModules(MetaPathFinder, Loader):
    """Finds modules named after an effect, where no other finder does."""

    def find_spec(self, name: str, path: Sequence[str] | None, target: ModuleType | None = None) -> ModuleSpec | None:
        package, _, effect = name.rpartition(".")
        return ModuleSpec(name, self) if package == __package__ and effect in all_effects() else None

    def exec_module(self, module: ModuleType) -> None:
        effect = all_effects()[module.__name__.rpartition(".")[2]]
        setattr(module, effect.__name__, effect)
        warnings.warn(
            f"{module.__name__} is part of {effect.__module__}; the next version knows the new name only.",
            FutureWarning,
            stacklevel=2,
        )


sys.meta_path.append(_OldModules())
