"""Parameters of the bench: the simulator file ``sim.toml``, checked value by value.

A simulator file holds the tables ``muscle``, ``gas``, ``valve`` and ``joint``, optionally ``tolerance`` (how well a
parameter is known) and any number of ``[[effects]]`` (physics beyond the nominal equations). A corrected simulator is
therefore a file of the same format.
"""

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, ClassVar, Self

from ..constants import ATMOSPHERIC_PRESSURE, GAS_CONSTANT, HEAT_CAPACITY_RATIO, REFERENCE_DENSITY, TEMPERATURE
from ..effects import Effect, EffectSpec
from ..effects.plant import Plant
from ..errors import ImplausibleParameterError, SimulatorTypeError, UnknownOptionError, UnknownParameterError
from ..explained import explained_fields
from ..face import AnySimulator
from ..names import require_one_of

_LOCKED_ANGLE = math.acos(1 / math.sqrt(3))  # tan² = 2: a braid beyond it can only extend


def _quantity(unit: str, lower: float, upper: float, hint: str = "", comment: str = "", default: Any = None) -> Any:
    """Declare a number of a simulator file: its unit, its plausible range, what a value outside probably is."""
    metadata = {"unit": unit, "lower": lower, "upper": upper, "hint": hint, "comment": comment}
    if default is None:
        return field(metadata=metadata)
    return field(default=default, metadata=metadata)


def _check_table(table: Any, name: str) -> None:
    """Check and convert all numbers of one table in place; the dataclass is frozen for everyone else."""
    for f in dataclasses.fields(table):
        value = getattr(table, f.name)
        where = f"{name}.{f.name}"
        if "unit" not in f.metadata:
            if not isinstance(value, str):
                raise SimulatorTypeError(f"{where} is {value!r}.", "text", "Put the value in quotes.")
            if not value or len(value) > 100 or not value.isprintable():
                raise ImplausibleParameterError(
                    f"{where} is {value[:40]!r}.", "1 to 100 printable characters", "Give the muscle a plain name."
                )
            continue
        object.__setattr__(table, f.name, check_number(value, where, **f.metadata))


def check_number(
    value: Any, where: str, unit: str, lower: float, upper: float, hint: str = "", comment: str = ""
) -> float:
    """Return ``value`` as a float if it is a plausible number, else raise what says why not."""
    of = "" if unit == "-" else f" {unit}"
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        expected = f"a number in{of}" if of else "a number"
        raise SimulatorTypeError(f"{where} is {value!r}.", expected, "Write the number without quotes.")
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if not lower <= number <= upper:  # NaN fails as well
        remedy = hint if math.isfinite(number) and hint else "Correct the value."
        raise ImplausibleParameterError(f"{where} is {number:g}{of}.", f"{lower:g} to {upper:g}{of}", remedy)
    return number


@explained_fields
@dataclass(frozen=True)
class MuscleParameters:
    r"""Geometry of one muscle; both muscles of the bench are alike.

    Examples
    --------
    >>> muscle = MuscleParameters("B", rest_length=0.2, rest_diameter=0.02, braid_angle=0.436, initial_contraction=0.12)
    """

    name: Annotated[str, "What the muscle is called."]
    rest_length: Annotated[float, "L₀, m."] = _quantity(
        "m", 0.005, 5.0, "Lengths are in m: a muscle of 200 mm has 0.2."
    )
    rest_diameter: Annotated[float, "D₀, m."] = _quantity(
        "m", 0.0005, 0.3, "Diameters are in m: a muscle of 20 mm has 0.02."
    )
    braid_angle: Annotated[float, "θ₀ at rest, between thread and axis, rad."] = _quantity(
        "rad", 0.02, _LOCKED_ANGLE - 0.01, "Angles are in rad: 25 degrees is 0.436.", "at rest"
    )
    initial_contraction: Annotated[float, "ε₀ at joint angle 0, dimensionless."] = _quantity(
        "-", -0.3, 0.4, "The contraction is a ratio: 12 % is 0.12.", "at joint angle 0"
    )

    def __post_init__(self) -> None:
        _check_table(self, "muscle")
        if self.rest_diameter >= self.rest_length:
            raise ImplausibleParameterError(
                f"muscle.rest_diameter is {self.rest_diameter:g} m at a rest_length of {self.rest_length:g} m.",
                "a muscle longer than wide",
                "Check the units of both.",
            )
        if self.initial_contraction >= self.max_contraction:
            raise ImplausibleParameterError(
                f"muscle.initial_contraction is {self.initial_contraction:g}.",
                f"less than {self.max_contraction:.3g}, where a braid of this angle no longer pulls",
                "Lower initial_contraction or braid_angle.",
            )

    @property
    def thread_length(self) -> float:
        """Length of one thread, b = L₀ / cos θ₀, m."""
        return self.rest_length / math.cos(self.braid_angle)

    @property
    def turns(self) -> float:
        """Turns of a thread about the muscle, n = b sin θ₀ / (π D₀)."""
        return self.thread_length * math.sin(self.braid_angle) / (math.pi * self.rest_diameter)

    @property
    def max_contraction(self) -> float:
        """Contraction at which the geometric force vanishes, 1 − b / (√3 L₀)."""
        return 1 - 1 / (math.sqrt(3) * math.cos(self.braid_angle))


@explained_fields
@dataclass(frozen=True)
class GasParameters:
    """The gas and the pressures around the muscle.

    Examples
    --------
    >>> GasParameters().temperature  # K
    293.0
    """

    heat_capacity_ratio: Annotated[float, "γ, dimensionless."] = _quantity(
        "-", 1.0, 1.7, "Air has 1.4, an isothermal chamber 1.", default=HEAT_CAPACITY_RATIO
    )
    gas_constant: Annotated[float, "R, J/(kg K)."] = _quantity(
        "J/(kg K)", 50.0, 5000.0, "Air has 287 J/(kg K), not 0.287.", default=GAS_CONSTANT
    )
    temperature: Annotated[float, "T, K."] = _quantity(
        "K", 150.0, 600.0, "Temperatures are in K: 20 °C is 293.", default=TEMPERATURE
    )
    atmospheric_pressure: Annotated[float, "Pa, absolute."] = _quantity(
        "Pa",
        30000.0,
        120000.0,
        "Pressures are absolute, in Pa: 1 bar is 100000.",
        "absolute",
        default=ATMOSPHERIC_PRESSURE,
    )
    supply_pressure: Annotated[float, "Pa, absolute."] = _quantity(
        "Pa", 30000.0, 5000000.0, "Pressures are absolute, in Pa: 6 bar gauge is 700000.", "absolute", default=700000.0
    )

    def __post_init__(self) -> None:
        _check_table(self, "gas")
        if self.supply_pressure <= self.atmospheric_pressure:
            raise ImplausibleParameterError(
                f"gas.supply_pressure is {self.supply_pressure:g} Pa at an atmospheric_pressure of "
                f"{self.atmospheric_pressure:g} Pa.",
                "a supply above ambient pressure",
                "Give supply_pressure as absolute pressure in Pa.",
            )


@explained_fields
@dataclass(frozen=True)
class ValveParameters:
    """The servo valve of each muscle, by ISO 6358.

    Examples
    --------
    >>> ValveParameters(sonic_conductance=6e-9).critical_pressure_ratio
    0.35
    """

    sonic_conductance: Annotated[float, "C at full opening, m³/(s Pa)."] = _quantity(
        "m^3/(s Pa)", 1e-12, 1e-05, "1 dm³/(s bar) is 1e-8 m³/(s Pa).", "at full opening"
    )
    critical_pressure_ratio: Annotated[float, "b_c, dimensionless."] = _quantity(
        "-", 0.0, 0.9, "Valves have 0.1 to 0.5.", default=0.35
    )
    reference_density: Annotated[float, "ρ₀, kg/m³."] = _quantity(
        "kg/m^3", 0.05, 10.0, "Air has 1.185 kg/m³.", default=REFERENCE_DENSITY
    )

    def __post_init__(self) -> None:
        _check_table(self, "valve")


@explained_fields
@dataclass(frozen=True)
class JointParameters:
    """The joint that both muscles turn.

    Examples
    --------
    >>> joint = JointParameters(pulley_radius=0.04, inertia=0.02, viscous_damping=0.08)  # m, kg m², N m s/rad
    """

    pulley_radius: Annotated[float, "r, m."] = _quantity("m", 0.001, 1.0, "Radii are in m: 40 mm is 0.04.")
    inertia: Annotated[float, "J, kg m²."] = _quantity(
        "kg m^2", 1e-06, 100.0, "Inertia is in kg m²: 200 kg cm² is 0.02."
    )
    viscous_damping: Annotated[float, "b_q, N m s/rad."] = _quantity(
        "N m s/rad", 0.0, 100.0, "Damping is in N m s/rad."
    )

    def __post_init__(self) -> None:
        _check_table(self, "joint")


TABLES: dict[str, type] = {
    "muscle": MuscleParameters,
    "gas": GasParameters,
    "valve": ValveParameters,
    "joint": JointParameters,
}
"""The required tables of a simulator file."""

NUMBERS: dict[str, str] = {
    f.name: table for table, cls in TABLES.items() for f in dataclasses.fields(cls) if "unit" in f.metadata
}
"""Every number of a simulator file and the table that holds it."""

UNITS: dict[str, str] = {
    f.name: f.metadata["unit"] for cls in TABLES.values() for f in dataclasses.fields(cls) if "unit" in f.metadata
}
"""The unit of every number of a simulator file."""


@dataclass(frozen=True)
class BenchParameters(AnySimulator):
    """All parameters of a bench: the content of a simulator file.

    Parameters
    ----------
    muscle : MuscleParameters
        Geometry of the muscles.
    gas : GasParameters
        Gas, ambient and supply.
    valve : ValveParameters
        Servo valves.
    joint : JointParameters
        Joint.
    tolerance : mapping of str to float, default={}
        Relative tolerance of parameters that are not known exactly.
    effects : sequence of (str, dict), default=()
        Effects beyond the nominal equations, by name, with their parameters.

    Raises
    ------
    ImplausibleParameterError
        A value is outside its physical range, NaN or infinite.
    UnknownParameterError
        A tolerance or an effect names something that does not exist.
    SimulatorTypeError
        A value is of the wrong type.

    Examples
    --------
    >>> from pamid.bench.parameters import BenchParameters
    >>> params = BenchParameters.for_muscle("B")
    >>> params.muscle.rest_length
    0.2
    >>> params.replace(inertia=0.021).joint.inertia
    0.021
    """

    muscle: MuscleParameters
    gas: GasParameters
    valve: ValveParameters
    joint: JointParameters
    tolerance: Mapping[str, float] = field(default_factory=dict)
    effects: tuple[EffectSpec, ...] = ()

    kind = library = form = "bench"
    names = tuple(NUMBERS)
    reads_all, day_lasts = False, True
    readings = "F", "F1", "F2", "mdot", "mdot1", "mdot2"
    presets: ClassVar[dict[str, tuple[float, float, float]]] = {
        "A": (0.20, 0.01, 1.5e-9),
        "B": (0.20, 0.02, 6e-9),
        "C": (0.45, 0.02, 1.35e-8),
    }
    """Rest length (m), rest diameter (m) and valve conductance (m³/(s Pa)) of the muscles of the study; the valve
    grows with the cylinder volume, so that the three benches are about equally quick."""

    def __post_init__(self) -> None:
        for name, cls in TABLES.items():
            if not isinstance(getattr(self, name), cls):
                raise SimulatorTypeError(f"{name} is {getattr(self, name)!r}.", f"a {cls.__name__}", "Build one.")
        object.__setattr__(self, "tolerance", self._checked_tolerance())
        object.__setattr__(self, "effects", tuple(map(EffectSpec.of, self.effects or ())))

    def _checked_tolerance(self) -> dict[str, float]:
        if not isinstance(self.tolerance, Mapping):
            raise SimulatorTypeError(f"tolerance is {self.tolerance!r}.", "a table", "Write it as [tolerance].")
        checked = {}
        for name, value in self.tolerance.items():
            says = f"tolerance names {name!r}, which is not a parameter."
            require_one_of(name, NUMBERS, says, "Correct it.", UnknownParameterError)
            checked[name] = check_number(
                value, f"tolerance.{name}", "-", 0.0, 0.9, "Tolerances are relative: 2 % is 0.02."
            )
        return checked

    @classmethod
    def for_muscle(cls, name: str) -> Self:
        """Return the bench of the study with muscle ``"A"``, ``"B"`` or ``"C"``, and the tolerances of the study."""
        if name not in cls.presets:
            raise UnknownOptionError(
                f"The study has no muscle {name!r}.", "A, B or C", "Read other muscles from a simulator file."
            )
        rest_length, rest_diameter, conductance = cls.presets[name]
        return cls(
            MuscleParameters(name, rest_length, rest_diameter, math.radians(25.0), 0.12),
            GasParameters(),
            ValveParameters(conductance),
            JointParameters(0.04, 0.02, 0.08),
            {"rest_diameter": 0.005, "braid_angle": 0.005, "sonic_conductance": 0.02, "inertia": 0.02,
             "viscous_damping": 0.10},
        )  # fmt: skip

    @classmethod
    def from_toml(cls, path: str | Path) -> Self:
        """Read a simulator file, ``sim.toml``, and check it.

        A `SimulatorFileError` says that the file is missing, too large, not valid TOML, lacks something, or holds
        something unknown or implausible.
        """
        from .simulator_file import read_simulator_file

        return read_simulator_file(cls, TABLES, Path(path))

    def to_toml(self, path: str | Path) -> None:
        """Write a simulator file, whole or not at all; an existing one is replaced. An `OutputError` says that it
        cannot be written.
        """
        from ..files import write_whole
        from .simulator_file import simulator_text

        tables = {name: getattr(self, name) for name in TABLES}
        write_whole(Path(path), simulator_text(tables, self.tolerance, self.effects))

    def replace(self, **changes: Any) -> Self:
        """Return a checked copy with some values changed.

        Numbers go by their name in a simulator file (``inertia=0.021``), beside whole tables, ``name``, ``tolerance``
        and ``effects``.
        """
        whole: dict[str, Any] = {}
        inner: dict[str, dict[str, Any]] = {}
        for name, value in changes.items():
            if name in TABLES or name in ("tolerance", "effects"):
                whole[name] = value
            elif name == "name":
                inner.setdefault("muscle", {})[name] = value
            elif name in NUMBERS:
                inner.setdefault(NUMBERS[name], {})[name] = value
            else:
                raise UnknownParameterError(
                    f"{name!r} is not a parameter of the bench.", f"one of {', '.join(NUMBERS)}", "Correct the name."
                )
        for table, values in inner.items():
            whole[table] = dataclasses.replace(whole.get(table, getattr(self, table)), **values)
        return dataclasses.replace(self, **whole)

    def with_(self, parameters: Mapping[str, float]) -> Self:
        """Return the bench with other numbers."""
        return self.replace(**parameters)

    def as_bench(self) -> Self:
        """Return itself."""
        return self

    def plant(self) -> Plant:
        """Return the numbers as effects see them."""
        follow = {name: getattr(self.muscle, name) for name in ("thread_length", "turns")}
        return Plant(**{f.name: follow.get(f.name) or self.get(f.name) for f in dataclasses.fields(Plant)})

    def make_effects(self) -> list[Effect]:
        """Return the effects as objects, in order."""
        return [spec.make() for spec in self.effects]

    def adjusted(self) -> Self:
        """Return the bench with those effects carried out that only change a parameter, and the others kept."""
        changed, kept = self.replace(effects=()), []
        for spec in self.effects:
            if "adjust" in (effect := spec.make()).hooks():
                changed = changed.replace(**effect.adjust(changed.values()))
            else:
                kept.append(spec)
        return changed.replace(effects=tuple(kept))

    def get(self, name: str) -> float:
        """Return one number by its name in a simulator file, such as ``"inertia"``."""
        require_one_of(name, NUMBERS, f"{name!r} is not a parameter of the bench.", error=UnknownParameterError)
        return float(getattr(getattr(self, NUMBERS[name]), name))

    def identity(self) -> dict[str, Any]:
        """Return the identity of the simulator: name, numbers, tolerances and effects, as plain data."""
        return {
            "name": self.muscle.name,
            "numbers": self.values(),
            "tolerance": dict(self.tolerance),
            "effects": [[name, dict(values)] for name, values in self.effects],
        }

    def values(self) -> dict[str, float]:
        """Return all numbers by name, in the order of a simulator file."""
        return {name: self.get(name) for name in NUMBERS}
