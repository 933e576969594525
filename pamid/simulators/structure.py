"""The structure of a simulator: which states are positions and velocities, and which input acts on which."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..errors import ParameterError
from ..signals.units import UNITS
from .base import Simulator
from .ports import Port

if TYPE_CHECKING:
    from .lever import Lever

_SOME = 200
"""Instants at which a simulator's structure is probed."""
_OWN = 0.98
"""Share of instants at which an input must push the same way to be the drive of a joint."""
_SAME = 1e-6
"""Share of what half a turn changes that may be left after a full one."""


class JointPort(NamedTuple):
    """A place where forces act."""

    name: str
    """Its name: that of the joint port, else of the position, else of the velocity."""
    position: str
    velocity: str
    """States; empty where there is none."""
    through: str
    """Input that forces there act like; empty where they add to the rate of the velocity."""
    unit: str
    """Unit of those forces."""
    lever: Lever | None = None
    """How the whole mechanism responds to them; None where they act on this joint alone, or through an input."""


def kinematic_pairs(simulator: Simulator, t: np.ndarray, x: np.ndarray, u: np.ndarray) -> dict[str, str]:
    """Return the states whose rate is another state: positions, with their velocities."""
    rate = simulator.rate(t, x, u, spread_numbers(simulator, x.shape[1]))
    found = {}
    for i, name in enumerate(simulator.states):
        for k, other in enumerate(simulator.states):
            if i != k and np.ptp(x[k]) > 0.0 and np.allclose(rate[i], x[k], rtol=1e-9, atol=0.0):
                found[name] = other
                break
    return found


def spread_numbers(simulator: Simulator, n: int) -> np.ndarray:
    """Return the values of the parameters at n instants, shape (n_parameters, n)."""
    return np.repeat(simulator.numbers[:, None], n, axis=1)


def straight(simulator: Simulator, t: np.ndarray, x: np.ndarray, u: np.ndarray, k: int, size: float) -> bool:
    """Return whether the rates are linear in an input over changes of a size, at some instants."""
    p = spread_numbers(simulator, len(t))

    def moved(share: float) -> np.ndarray:
        there = u.copy()
        there[k] += share * size
        return simulator.rate(t, x, there, p)

    base = moved(0.0)
    slope = moved(1.0) - base
    most = 0.37 * np.max(np.abs(slope), axis=1, keepdims=True)
    return bool(np.all(np.abs(moved(-0.37) - (base - 0.37 * slope)) <= 1e-6 * most + 1e-12))


def speed_name(joint: str) -> str:
    """Return the name of the speed of a joint that names none: its position's rate."""
    return f"{joint}.speed"


def why_left_out(joint: Port) -> str:
    """Return why a joint that the user named is none where forces follow readings."""
    if not joint.through:
        return f"The joint '{joint.name}' names no input through which forces act there (through = INPUT)."
    where = [f"{role} {name}" for role in ("position", "velocity") if (name := getattr(joint, role))]
    return (
        f"The joint '{joint.name}' has no reading: the log lacks its {' and its '.join(where)}."
        if where else f"The joint '{joint.name}' names neither its position nor its velocity."
    )  # fmt: skip


def joints_of(
    simulator: Simulator, pairs: Mapping[str, str], pushes: Mapping[tuple[str, str], float]
) -> list[JointPort]:
    """Return the joints of a simulator: those of its joint ports, and those that its kinematics show."""
    found = []
    for port in simulator.ports:
        if port.kind == "joint":
            for role, name in (("position", port.position), ("velocity", port.velocity)):
                if name and name not in simulator.states:
                    raise ParameterError(
                        f"The {role} of the joint '{port.name}' is {name!r}, which is not a state.",
                        f"one of its states: {', '.join(simulator.states)}",
                        f"Name the state that {name!r} reads: forces of a joint act along its states.",
                    )
            velocity, through = port.velocity or pairs.get(port.position, ""), port.through
            if pushes.get((through, velocity), 1.0) < 0.0:  # a force along it would act against the motion it follows
                through = ""
            # Whatever unit it was given, what acts there is added to an input or to a rate.
            acts = simulator.port(through).unit if through else rate_unit(simulator, velocity) if velocity else "-"
            unit = acts if acts != "-" else port.unit
            found.append(JointPort(port.name, port.position, velocity, through, unit))
    declared, known = len(found), {j.position for j in found} | {j.velocity for j in found}
    taken = {j.through for j in found}
    speeds = {v: k for k, v in pairs.items()}
    for name in simulator.states:
        position = speeds.get(name, "")
        is_speed = bool(position) or simulator.port(name).unit.endswith("/s")
        if name in known or not is_speed:
            continue
        drives = [u for u in simulator.inputs if pushes.get((u, name), 0.0) > 0.0 and u not in taken]
        through = drives[0] if drives else ""
        taken |= {through} if through else set()
        unit = simulator.port(through).unit if through else rate_unit(simulator, name)
        found.append(JointPort(position or name, position, name, through, unit))
    mixed = [k for k in range(declared, len(found)) if _mixed(found[k], found, pushes)]
    return [
        j._replace(through="", unit=rate_unit(simulator, j.velocity)) if k in mixed else j for k, j in enumerate(found)
    ]


def _mixed(joint: JointPort, joints: Sequence[JointPort], pushes: Mapping[tuple[str, str], float]) -> bool:
    """Return whether the input at a joint is another force, as of a rotor: responses to forces there are symmetric."""
    return any(
        pushes.get((other.through, joint.velocity), 0.0) * pushes.get((joint.through, other.velocity), 0.0) < 0.0
        for other in joints
        if joint.through and other.through != joint.through
    )


def pushes_of(
    simulator: Simulator, t: np.ndarray, x: np.ndarray, u: np.ndarray, step: np.ndarray
) -> dict[tuple[str, str], float]:
    """Return the slopes of states' rates over inputs, where their sign is constant."""
    p = spread_numbers(simulator, x.shape[1])
    base = simulator.rate(t, x, u, p)
    found = {}
    for k, name in enumerate(simulator.inputs):
        if not step[k] > 0.0:
            continue
        moved = u.copy()
        moved[k] += step[k]
        slope = (simulator.rate(t, x, moved, p) - base) / step[k]
        for i, state in enumerate(simulator.states):
            if np.mean(slope[i] > 0.0) > _OWN or np.mean(slope[i] < 0.0) > _OWN:
                found[name, state] = float(np.median(slope[i]))
    return found


def fed_by(simulator: Simulator, t: np.ndarray, x: np.ndarray, u: np.ndarray) -> dict[str, str]:
    """Return the states that feed one other: their levels always raise its rate, and that of no other."""
    p, found = spread_numbers(simulator, x.shape[1]), {}
    base = simulator.rate(t, x, u, p)
    for k, name in enumerate(simulator.states):
        moved = x.copy()
        moved[k] += 1e-3 * (float(np.ptp(x[k])) or abs(float(x[k][0])) or 1.0)
        slope = simulator.rate(t, moved, u, p) - base
        others = [
            other
            for i, other in enumerate(simulator.states)
            if i != k
            and simulator.port(other).unit == simulator.port(name).unit
            and np.mean(slope[i] > 0.0) > _OWN
            and np.mean(slope[k] < 0.0) > _OWN
        ]
        if len(others) == 1:
            found[name] = others[0]
    return found


def full_turns(simulator: Simulator, t: np.ndarray, x: np.ndarray, u: np.ndarray) -> dict[str, float]:
    """Return a full turn of each state in which the simulator comes round: angles that act as on a pendulum."""
    p, found = spread_numbers(simulator, x.shape[1]), {}
    base = simulator.rate(t, x, u, p)
    for k, name in enumerate(simulator.states):
        unit = UNITS.get(simulator.port(name).unit)
        if unit is None or unit.dimension != "angle":
            continue
        turn = 2.0 * np.pi / unit.factor
        half, whole = (simulator.rate(t, x + share * turn * np.eye(len(x))[:, [k]], u, p) for share in (0.5, 1.0))
        size = np.max(np.abs(half - base))
        if np.max(np.abs(whole - base)) < _SAME * size:
            found[name] = turn
    return found


def rate_unit(simulator: Simulator, state: str) -> str:
    """Return the unit of a state's rate."""
    from .dimensions import unit_text

    return unit_text([(simulator.port(state).unit, 1), ("s", -1)])


def some_instants(n: int) -> np.ndarray:
    """Return some of n instants, evenly spread."""
    return np.unique(np.linspace(0, max(n - 1, 0), min(n, _SOME)).astype(int))
