# Written by python docs/tables.py.

from .adaptation import AdaptationDisplay as AdaptationDisplay
from .comparison import comparison_plot as comparison_plot
from .fits import fit_plot as fit_plot
from .force_map import ForceMapDisplay as ForceMapDisplay
from .loops import LoopDisplay as LoopDisplay
from .residual_map import ResidualMapDisplay as ResidualMapDisplay
from .style import save_figure as save_figure
from .volume_surface import VolumeSurfaceDisplay as VolumeSurfaceDisplay
from .volumes import VolumeDisplay as VolumeDisplay
from .volumes import volume_plot as volume_plot
from .whiteness import ResidualTestDisplay as ResidualTestDisplay

__all__ = [
    "AdaptationDisplay",
    "ForceMapDisplay",
    "LoopDisplay",
    "ResidualMapDisplay",
    "ResidualTestDisplay",
    "VolumeDisplay",
    "VolumeSurfaceDisplay",
    "comparison_plot",
    "fit_plot",
    "save_figure",
    "volume_plot",
]
