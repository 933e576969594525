"""Typical units, in which any actuator is of the size of the muscles that the library's bounds are made for."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ...effects import Effect, Parameter
from .units import powers_of

Table = Mapping[str, np.ndarray]

_STRAIN = 0.2  # range that the contraction of a muscle typically covers
_RUN = 10.0  # s, a typical run
_RUNS = (0.5, 100.0)  # s: runs in between are taken as they are
_SIZE = {"force": 10.0, "torque": 10.0, "flow": 1e-4}  # N, N m, kg/s: a typical gap
_PRESSURE = {"force": 5e5, "torque": 5e5, "flow": 2e3}  # Pa; of a flow that is not in pascal: a head


@dataclass(frozen=True)
class Scaling:
    """Conversion of signals and target to those of a typical muscle, and of effects' parameters back."""

    position: float = 1.0
    """Length, angle, voltage ... that counts as a strain of one."""
    time: float = 1.0
    """Value of one second of the log, s."""
    pressure: float = 1.0
    """Value of one unit of the log's pressure, Pa."""
    target: float = 1.0
    """Size of one newton of the target, in its unit; negative where effects add to the target."""

    def inward(self, table: Table) -> dict[str, np.ndarray]:
        """Return signals in typical units; the position stays, since it is converted to strains where it is used."""
        return {role: x * self._of(role) for role, x in table.items()}

    def outward(self, table: Table) -> dict[str, np.ndarray]:
        """Return signals in the units of the log."""
        return {role: x / self._of(role) for role, x in table.items()}

    def _of(self, role: str) -> float:
        return {
            "time": self.time,
            "velocity": 1.0 / self.time,
            "pressure": self.pressure,
            "pressure_rate": self.pressure / self.time,
            "force": 1.0 / abs(self.target),  # what is lost of it is a share of the target
        }.get(role, 1.0)

    def factor(self, effect: type[Effect], p: Parameter) -> float:
        """Return the factor of a parameter from typical units to those of the log.

        Newton is replaced by the unit of the target, pascal by that of the pressure. What a sensor of the target adds
        to its reading keeps its sign, whichever sense effects have.
        """
        size = self.target if effect.channel in ("F", "mdot") and "measure" in effect.hooks() else abs(self.target)
        base = {
            "N": size,
            "s": 1.0 / self.time,
            "Pa": 1.0 / self.pressure,
            "kg": size / self.time,
            "m^3": size / self.time,
        }
        factor = self.position**p.position if effect.site != "joint" else 1.0
        for name, power in powers_of(p.unit).items():
            factor *= base.get(name, 1.0) ** power
        return factor


def scaling_of(
    table: Table, residual: np.ndarray, run_length: float, interval: float, position: float, equation: str = "force"
) -> Scaling:
    """Return the units in which a log is of the size of a muscle's."""
    size = float(np.sqrt(np.mean(np.square(residual)))) if len(residual) else 0.0
    usual = _RUNS[0] <= run_length <= _RUNS[1] and interval <= 0.02
    top = float(np.max(np.abs(table["pressure"]))) if "pressure" in table and len(table["pressure"]) else 0.0
    return Scaling(
        position=position,
        time=1.0 if usual or run_length <= 0 else _RUN / run_length,
        pressure=_PRESSURE[equation] / top if 0.0 < top < 2e4 else 1.0,
        target=size / _SIZE[equation] if size > 0 else 1.0,
    )


def strain_scale(position: np.ndarray, contraction: bool) -> float:
    """Return what counts as a strain of one: one for a contraction ratio, else five times the range."""
    span = float(np.ptp(position)) if len(position) else 0.0
    return 1.0 if contraction or span == 0.0 else span / _STRAIN
