"""The simulators that are given to the diagnosis: a MuJoCo model, functions, an FMU that is compiled here."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from pamid.simulators import FmuSimulator, FunctionSimulator, MujocoSimulator, Port, Simulator

from .plants import Plant

ARM = """
<mujoco><compiler angle="radian"/><option gravity="0 0 -9.81"/>
<worldbody><body name="arm"><joint name="hinge" axis="0 1 0" armature="0.002"/>
<inertial pos="0 0 -0.15" mass="0.5" diaginertia="0.00125 0.00125 0.00125"/></body></worldbody>
<actuator><motor name="motor" joint="hinge"/></actuator></mujoco>
"""


def cart_rates(t: Any, x: Any, u: Any, p: Any) -> Any:
    """Return the rates of a cart with a pendulum."""
    s, c = np.sin(x.angle), np.cos(x.angle)
    l, J = 0.3, 0.004  # noqa: E741
    mass, bob = p.cart + p.bob, p.bob * l * l + J
    cross = p.bob * l * c
    F = u.force + p.bob * l * x.omega**2 * s
    M = u.torque - p.bob * 9.81 * l * s
    det = mass * bob - cross * cross
    return {"x": x.v, "angle": x.omega, "v": (bob * F - cross * M) / det, "omega": (mass * M - cross * F) / det}


def cylinder_rates(t: Any, x: Any, u: Any, p: Any) -> Any:
    """Return the rates of a pneumatic cylinder."""
    RT = 287.0 * 293.0

    def through(opening: Any, pressure: Any) -> Any:
        up = np.where(opening > 0, 7e5, pressure)
        down = np.where(opening > 0, pressure, 1.01e5)
        r = np.clip((down / up - 0.3) / 0.7, 0, 1)
        return p.C * opening * up * np.sqrt(1 - r * r + 1e-4)

    one = RT * (through(u.valve, x.p1) + u.w1) - x.p1 * 8e-4 * x.v
    two = RT * (through(-u.valve, x.p2) + u.w2) + x.p2 * 7e-4 * x.v
    force = (x.p1 - 1.01e5) * 8e-4 - (x.p2 - 1.01e5) * 7e-4 - 60 * x.v + u.load
    return {
        "s": x.v,
        "v": force / p.m,
        "p1": 1.4 * one / (8e-4 * (0.12 + x.s)),
        "p2": 1.4 * two / (7e-4 * (0.12 - x.s)),
    }


def simulator_of(plant: Plant, folder: Path) -> Simulator:
    """Return the nominal simulator of a system."""
    return {"servo": _servo, "cart": _cart, "cylinder": _cylinder, "tanks": _tanks}[plant.name](plant, folder)


def _servo(plant: Plant, folder: Path) -> Simulator:
    (folder / "arm.xml").write_text(ARM)
    return MujocoSimulator(folder / "arm.xml", parameters={"body_mass.arm": (0.5, 0.05, "kg")})


def _cart(plant: Plant, folder: Path) -> Simulator:
    ports = [
        Port("force", "input", "N"), Port("torque", "input", "N m"),
        Port("x", "state", "m"), Port("angle", "state", "rad"), Port("v", "state", "m/s"),
        Port("omega", "state", "rad/s"), Port("rail", "joint", "N", position="x", velocity="v", through="force"),
        Port("hinge", "joint", "N m", position="angle", velocity="omega", through="torque"),
    ]  # fmt: skip
    return FunctionSimulator(cart_rates, ports, {k: (v, tol, "kg") for k, (v, tol) in plant.numbers.items()})


def _cylinder(plant: Plant, folder: Path) -> Simulator:
    ports = [
        Port("valve", "input"), Port("load", "input", "N"), Port("w1", "input", "kg/s"), Port("w2", "input", "kg/s"),
        Port("s", "state", "m"), Port("v", "state", "m/s"), Port("p1", "state", "Pa"), Port("p2", "state", "Pa"),
        Port("rod", "joint", "N", position="s", velocity="v", through="load"),
        Port("chamber1", "chamber", level="p1", through="w1"), Port("chamber2", "chamber", level="p2", through="w2"),
    ]  # fmt: skip
    units = {"m": "kg", "C": "kg/(s Pa)"}
    return FunctionSimulator(cylinder_rates, ports, {k: (v, t, units[k]) for k, (v, t) in plant.numbers.items()})


def _tanks(plant: Plant, folder: Path) -> Simulator:
    from .tanks_fmu import build

    path = build(folder)
    ports = [Port("h1", "state", start=3.0), Port("h2", "state", start=3.0)]
    return FmuSimulator(path, ports, {k: (v, t) for k, (v, t) in plant.numbers.items()}, trust=True)


PORTS = {
    "servo": {"m": "body_mass.arm"},
}
"""Names of ports of the simulators that differ from those of the systems."""
