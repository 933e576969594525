"""Plots of comparisons, fits and identified volumes, in one quiet style; matplotlib is imported when one is drawn."""

from .._lazy import attach

_HOME = {
    "comparison_plot": "comparison",
    "fit_plot": "fits",
    "volume_plot": "volumes",
    "VolumeDisplay": "volumes",
    "ForceMapDisplay": "force_map",
    "LoopDisplay": "loops",
    "ResidualMapDisplay": "residual_map",
    "ResidualTestDisplay": "whiteness",
    "VolumeSurfaceDisplay": "volume_surface",
    "AdaptationDisplay": "adaptation",
    "save_figure": "style",
}
"""In which module each public name lives."""

__getattr__, __dir__, __all__ = attach(__name__, _HOME)
