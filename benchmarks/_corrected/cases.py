"""Which diagnoses are made: kind of the simulator, system, and the effects that its log has and its simulator lacks."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.any_simulator.causes import Cause, Command, Force, drawn
from benchmarks.any_simulator.generator import sizes_of
from benchmarks.any_simulator.plants import PLANTS, Plant
from benchmarks.any_simulator.simulate import log_of, record

from . import algebraic
from .pages import write
from .systems import Drive, Pole, Rail

SYSTEMS: dict[str, type[Plant]] = {**PLANTS, "rail": Rail, "pole": Pole, "drive": Drive}
OTHERS = {"bench": algebraic.bench, "cylinder seal": algebraic.cylinder, "joint": algebraic.joint}
LARGE = 3.0
"""Times as large as those of `benchmarks/any_simulator`: what becomes of a cause is tested, not its discovery."""
RUNS, LATER = 4, 3
_AT = {"rail": ("rail", "force", "m"), "cart": ("rail", "force", "cart"), "servo": ("hinge", "motor", "m"),
       "drive": ("load", "current", "Jl"), "cylinder": ("rod", "valve", "C"), "tanks": ("", "pump", "k3"),
       "pole": ("", "volt", "")}  # fmt: skip
_SENSOR = {"rail": "x", "cart": "angle", "servo": "hinge_q", "drive": "ql", "cylinder": "p1", "tanks": "level",
           "pole": "speed"}  # fmt: skip


@dataclass(frozen=True)
class Case:
    """A diagnosis.

    Parameters
    ----------
    kind, system : str
        Kind of the simulator, and what it simulates.
    effects : tuple of str
        What the log has and the simulator lacks.
    """

    kind: str
    system: str
    effects: tuple[str, ...]

    @property
    def name(self) -> str:
        """What it is called."""
        return f"{self.kind} {self.system} {' + '.join(self.effects)}"

    def make(self, rng: np.random.Generator, folder: Path) -> tuple[pd.DataFrame, pd.DataFrame]:
        """Write the simulator file into a folder; return the log, and other runs of the same system."""
        if self.system in OTHERS:
            return OTHERS[self.system](list(self.effects), rng, folder)
        plant = SYSTEMS[self.system]()
        write(self.kind, plant, folder)
        sizes = sizes_of(plant, record(plant, [], {}, rng, 2))
        causes = [_cause(name, plant, sizes, rng) for name in self.effects if name != "backlash"]
        off = {n: float(rng.uniform(-0.5, 0.5)) * tol for n, (_, tol) in plant.numbers.items()}
        if "backlash" in self.effects:
            plant.numbers["play"] = (0.008, 0.0)
        made = [record(plant, causes, off, rng, runs) for runs in (RUNS, LATER)]
        first, later = (log_of(plant, some, rng) for some in made)
        return first, later


def _cause(name: str, plant: Plant, sizes: dict[str, tuple[float, float]], rng: np.random.Generator) -> Cause:
    joint, command, number = _AT[plant.name]
    port = {"actuator": command, "sensor": _SENSOR[plant.name], "parameter": number}.get(name.split("_")[0], joint)
    port = "chamber1" if name == "leakage" else port
    if name == "actuator_bias":
        return Command(name, port, {"a": 0.3 * sizes[port][0]})
    if name == "actuator_dead_zone":
        return Command(name, port, {"a": 0.15 * sizes[port][0]})
    found = drawn(name, port, plant, sizes, rng)
    # A gain of 7 % at the pump is within the tolerance of k1, which multiplies it: "none" would be right.
    if isinstance(found, Force) or name == "sensor_bias" or (name, plant.name) == ("actuator_gain", "tanks"):
        found.p["a"] *= LARGE
    return found


_SINGLE = ("actuator_gain", "actuator_dead_zone", "actuator_lag", "actuator_delay", "actuator_saturation",
           "actuator_bias")  # fmt: skip
_FRICTION = ("viscous_friction", "coulomb_friction", "stribeck_friction")
_TABLE = {
    ("function", "rail"): [*_SINGLE, *_FRICTION],
    ("function", "cylinder"): ["leakage", "parameter_deviation", "actuator_backlash", "leakage + coulomb_friction"],
    ("function", "drive"): ["backlash", "backlash + viscous_friction"],
    ("equations", "rail"): ["coulomb_friction", "quadratic_drag", "actuator_dead_zone", "sensor_delay", "sensor_bias",
                            "parameter_deviation", "actuator_gain + coulomb_friction"],
    ("equations", "drive"): ["backlash", "actuator_saturation"],
    ("control", "pole"): [*_SINGLE, "sensor_gain", "actuator_gain + actuator_bias"],
    ("mujoco", "servo"): ["viscous_friction", "coulomb_friction", "actuator_dead_zone", "actuator_lag",
                          "actuator_saturation", "parameter_deviation", "sensor_gain",
                          "viscous_friction + actuator_gain"],
    ("mujoco", "rail"): ["stribeck_friction", "quadratic_drag", "actuator_bias"],
    ("fmu", "tanks"): ["actuator_gain", "actuator_lag", "actuator_saturation", "sensor_bias", "parameter_deviation"],
    ("fmu", "rail"): ["viscous_friction", "actuator_dead_zone", "coulomb_friction + actuator_bias"],
    ("bench", "bench"): ["coulomb_friction", "hysteresis", "leakage", "valve_dead_zone",
                         "hysteresis + leakage"],
    ("cylinder", "cylinder seal"): ["viscous_friction", "coulomb_friction + force_bias"],
    ("joint", "joint"): ["viscous_friction", "coulomb_friction + fit"],
}  # fmt: skip
CASES = [Case(kind, system, tuple(text.split(" + "))) for (kind, system), some in _TABLE.items() for text in some]
"""All of them."""
