"""Volume models: the gas volume of a muscle with its derivatives."""

from .._lazy import renamed
from .base import VolumeJet, VolumeModel
from .checks import VolumeReport, check_volume
from .classical import ClassicalVolume, FitParameter
from .discovery import all_volumes, volume_class

__all__ = [
    "ClassicalVolume",
    "FitParameter",
    "VolumeJet",
    "VolumeModel",
    "VolumeReport",
    "all_volumes",
    "check_volume",
    "volume_class",
]

__getattr__ = renamed(__name__, {"Parameter": "FitParameter"})
