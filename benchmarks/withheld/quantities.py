"""Numbers of the simulated bench: the nominal ones as a simulator file, and the true ones a little off them."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

MUSCLES = {"A": (0.20, 0.01, 1.5e-9), "B": (0.20, 0.02, 6.0e-9), "C": (0.45, 0.02, 1.35e-8)}
"""Rest length (m), rest diameter (m) and conductance of the valve (m³/(s Pa)) of the muscles of the study."""

TOLERANCE = {"D0": 0.005, "theta": 0.005, "C": 0.02, "J": 0.02, "bq": 0.10}
"""Relative tolerance of the true numbers, by their short names."""

LONG = {
    "D0": "rest_diameter",
    "theta": "braid_angle",
    "C": "sonic_conductance",
    "J": "inertia",
    "bq": "viscous_damping",
}
"""Their names in a simulator file."""


@dataclass(frozen=True)
class Numbers:
    """One bench, SI units; pressures absolute.

    Parameters
    ----------
    muscle : str
        Name of the muscle.
    L0, D0, theta, eps0 : float
        Rest length (m), rest diameter (m), braid angle (rad), contraction at joint angle 0.
    C, bc, rho0 : float
        Conductance (m³/(s Pa)), critical pressure ratio, reference density (kg/m³).
    r, J, bq : float
        Pulley radius (m), inertia (kg m²), damping (N m s/rad).
    gamma, R, T, Pa, Ps : float
        Heat capacity ratio, gas constant (J/(kg K)), temperature (K), ambient and supply pressure (Pa).
    """

    muscle: str
    L0: float
    D0: float
    C: float
    theta: float = math.radians(25.0)
    eps0: float = 0.12
    bc: float = 0.35
    rho0: float = 1.185
    r: float = 0.04
    J: float = 0.02
    bq: float = 0.08
    gamma: float = 1.4
    R: float = 287.0
    T: float = 293.0
    Pa: float = 101_325.0
    Ps: float = 700_000.0

    def changed(self, **relative: float) -> Numbers:
        """Return the numbers with some of them larger by a relative amount."""
        return replace(self, **{k: getattr(self, k) * (1 + v) for k, v in relative.items()})

    def volume(self, eps: float = 0.0) -> float:
        """Gas volume of the ideal braid, m³."""
        L, b2, k = self.L0 * (1 - eps), *braid(self)
        return k * (b2 * L - L**3)

    def force(self, P: float, eps: float) -> float:
        """Tension of the ideal braid, N."""
        L, b2, k = self.L0 * (1 - eps), *braid(self)
        return (P - self.Pa) * k * (3 * L * L - b2)

    def toml(self) -> str:
        """Return the simulator file."""
        tolerance = "\n".join(f"{LONG[k]} = {v!r}" for k, v in TOLERANCE.items())
        return f"""# Nominal simulator of a withheld bench, SI units.
[muscle]
name = "{self.muscle}"
rest_length = {self.L0!r}
rest_diameter = {self.D0!r}
braid_angle = {self.theta!r}
initial_contraction = {self.eps0!r}

[gas]
heat_capacity_ratio = {self.gamma!r}
gas_constant = {self.R!r}
temperature = {self.T!r}
atmospheric_pressure = {self.Pa!r}
supply_pressure = {self.Ps!r}

[valve]
sonic_conductance = {self.C!r}
critical_pressure_ratio = {self.bc!r}
reference_density = {self.rho0!r}

[joint]
pulley_radius = {self.r!r}
inertia = {self.J!r}
viscous_damping = {self.bq!r}

[tolerance]
{tolerance}
"""


def braid(n: Numbers) -> tuple[float, float]:
    """Return b² (m²) and 1/(4 π n²) of the braid: V = (b² L − L³)/(4 π n²)."""
    b = n.L0 / math.cos(n.theta)
    turns = b * math.sin(n.theta) / (math.pi * n.D0)
    return b * b, 1.0 / (4.0 * math.pi * turns * turns)


def nominal(muscle: str) -> Numbers:
    """Return the nominal bench with one of the muscles of the study."""
    L0, D0, C = MUSCLES[muscle]
    return Numbers(muscle, L0, D0, C)


def draw_offsets(rng: np.random.Generator) -> dict[str, float]:
    """Draw how far the true numbers lie off the nominal ones, all within their tolerances."""
    return {k: float(v * rng.uniform(-0.95, 0.95)) for k, v in TOLERANCE.items()}


@dataclass(frozen=True)
class Noise:
    """Noise of the sensors, standard deviations, and steps of their converters (0: none visible).

    Parameters
    ----------
    q, P, F, mdot : float
        rad, Pa, N, kg/s.
    step_q, step_pressure, step_force, step_mdot : float
        The same units.
    tails : float
        Degrees of freedom of Student's t; 0 for a Gaussian.
    """

    q: float
    P: float
    F: float
    mdot: float
    step_q: float
    step_pressure: float
    step_force: float
    step_mdot: float
    tails: float

    def __call__(self, rng: np.random.Generator, shape: tuple[int, ...]) -> np.ndarray:
        """Draw standard noise of unit variance."""
        if not self.tails:
            return rng.standard_normal(shape)
        return rng.standard_t(self.tails, shape) / math.sqrt(self.tails / (self.tails - 2))


def draw_noise(rng: np.random.Generator, n: Numbers) -> Noise:
    """Draw the noise of a bench: half to twice that of a usual one, with 16- to 20-bit converters or none visible."""
    factor = np.exp(rng.uniform(np.log(0.5), np.log(2.0), 4))
    q, P = 2e-5 * factor[0], 60.0 * factor[1]
    F = 2e-4 * n.force(3e5, n.eps0) * factor[2]
    mdot = 4e-4 * n.C * n.rho0 * n.Ps * factor[3]
    coarse = rng.random(4) < 0.5
    steps = coarse * np.array([2 * np.pi / 2**18, 1.2e6 / 2**14, 8 * n.force(3e5, n.eps0) / 2**16, mdot * 0.7])
    return Noise(q, P, F, mdot, *map(float, steps), tails=float(rng.choice([0, 0, 0, 0, 6])))
