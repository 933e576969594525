"""What the classical volume models share: named parameters with units and bounds, and a geometry to start from.

A new classical model is one new file in this folder: a frozen dataclass that derives from `ClassicalVolume`.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Annotated, ClassVar, NamedTuple, Self

from ..explained import explained_fields
from ..laws._backend import namespace
from ..signals.state import Array, State
from .base import VolumeJet


@explained_fields
class FitParameter(NamedTuple):
    """One number of a model that an estimator may fit.

    Examples
    --------
    >>> from pamid.volume.braided import BraidedVolume
    >>> p = BraidedVolume.parameter("braid_angle")
    >>> p.name, p.unit
    ('braid_angle', 'rad')
    """

    name: Annotated[str, "Name of the field of the model."]
    unit: Annotated[str, 'Its unit; ``"-"`` for a dimensionless number.']
    lower: Annotated[float, "Physical bounds, in that unit."]
    upper: Annotated[float, "Physical bounds, in that unit."]
    free: Annotated[bool, "Whether a fit frees it unless told otherwise."]
    meaning: Annotated[str, "What it is, in one line."]


REST_LENGTH = FitParameter(
    "rest_length", "m", 1e-3, 10.0, False, "rest length L₀; known from the cut, scales the volume"
)
REST_DIAMETER = FitParameter("rest_diameter", "m", 1e-4, 1.0, True, "inner diameter D₀ at rest")
BRAID_ANGLE = FitParameter("braid_angle", "rad", 0.02, 1.55, True, "angle θ₀ of the threads to the axis at rest")


@explained_fields
@dataclass(frozen=True)
class ClassicalVolume(ABC):
    """A volume model with a closed formula and few parameters.

    Examples
    --------
    >>> from pamid.volume import all_volumes
    >>> all_volumes()["tondu_lopez"].parameter_names()
    ('rest_length', 'rest_diameter', 'braid_angle', 'end_cap', 'end_cap_rise')
    """

    rest_length: Annotated[float, "Rest length L₀, m."]

    name: ClassVar[str]
    """Name by which estimators and `all_volumes` know the model."""
    parameters: ClassVar[tuple[FitParameter, ...]] = ()
    """The scalar parameters that a nonlinear fit may free; empty for a model that is linear in its coefficients."""
    force_falls: ClassVar[bool] = True
    """Whether the force under constant pressure falls with contraction for any parameters of the model."""
    pulls: ClassVar[bool] = True
    """Whether gauge pressure shortens the muscle near its rest length for any parameters of the model."""
    depends_on_pressure: ClassVar[bool] = False
    """Whether V is a function of the pressure, too."""

    @classmethod
    @abstractmethod
    def from_geometry(cls, rest_length: float, rest_diameter: float, braid_angle: float) -> Self:
        """Return the model of a muscle of this geometry (m, m, rad), with every correction at its neutral value."""

    @abstractmethod
    def jet(self, state: State) -> VolumeJet:
        """Return V (m³), ∂V/∂ε (m³) and ∂V/∂P (m³/Pa) at each sample; reads ``eps`` and, if needed, ``P``."""

    @classmethod
    def parameter(cls, name: str) -> FitParameter:
        """Return the declaration of one parameter."""
        return next(p for p in cls.parameters if p.name == name)

    @classmethod
    def parameter_names(cls) -> tuple[str, ...]:
        """Return the names of the parameters that a nonlinear fit may free."""
        return tuple(p.name for p in cls.parameters)


def braid_factors(braid_angle: Array) -> tuple[Array, Array]:
    """Return 3/tan²θ₀ and 1/sin²θ₀, the two numbers by which a braid turns gauge pressure into tension.

    Examples
    --------
    >>> from pamid.volume.classical import braid_factors
    >>> import numpy as np
    >>> a, b = braid_factors(np.radians(25.0))
    >>> round(float(a), 2), round(float(b), 2)
    (13.8, 5.6)
    """
    xp = namespace(braid_angle)
    return 3.0 / xp.tan(braid_angle) ** 2, 1.0 / xp.sin(braid_angle) ** 2


def cylinder_volume(rest_length: Array, rest_diameter: Array) -> Array:
    """Return the volume π D₀² L₀/4 (m³) of a cylinder of these measures (m).

    Examples
    --------
    >>> from pamid.volume.classical import cylinder_volume
    >>> print(f"{1e6 * cylinder_volume(0.2, 0.02):.1f} cm³")
    62.8 cm³
    """
    return 0.7853981633974483 * rest_diameter * rest_diameter * rest_length
