"""Plots of comparisons, fits and identified volumes, in one quiet style; matplotlib is imported when one is drawn."""

from __future__ import annotations

import importlib
from typing import Any

_HOME = {
    "comparison_plot": "comparison",
    "fit_plot": "fits",
    "volume_plot": "volumes",
    "VolumeDisplay": "volumes",
    "ForceMapDisplay": "force_map",
    "LoopDisplay": "loops",
    "ResidualMapDisplay": "residual_map",
    "VolumeSurfaceDisplay": "volume_surface",
    "AdaptationDisplay": "adaptation",
    "save_figure": "style",
}
"""In which module each public name lives."""

__all__ = sorted(_HOME)


def __getattr__(name: str) -> Any:
    if name in _HOME:
        return getattr(importlib.import_module(f".{_HOME[name]}", __name__), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return list(__all__)
