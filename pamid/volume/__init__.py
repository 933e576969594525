"""Volume models: the gas volume of a muscle with its derivatives."""

from .base import VolumeJet, VolumeModel
from .checks import VolumeReport, check_volume
from .classical import ClassicalVolume, Parameter
from .discovery import all_volumes, volume_class

__all__ = [
    "ClassicalVolume",
    "Parameter",
    "VolumeJet",
    "VolumeModel",
    "VolumeReport",
    "all_volumes",
    "check_volume",
    "volume_class",
]
