"""Which states of a simulator a log holds, and what follows from them."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from ...signals import differentiate
from ...signals.ends import end_of
from ...signals.resting import resting_rows
from ...simulators.base import Simulator
from ...simulators.port_log import PortLog
from ...simulators.structure import JointPort, kinematic_pairs, some_instants, speed_name, spread_numbers

LEAST_MOVING = 20
"""Windows of motion that a joint must have for those at rest to be left out: the logs of
``benchmarks/any_simulator`` have 388 and more."""


def measured_states(simulator: Simulator, log: PortLog) -> dict[str, str] | None:
    """Return the velocities that follow from logged positions; None if a relevant state is not available."""
    if simulator.form == "algebraic":
        return {}
    if simulator.form != "ode":
        return None
    pairs = pairs_of(simulator, log)
    derived = {p: v for p, v in pairs.items() if p in log.channels and v not in log.channels}
    known = set(log.channels) | set(derived.values())
    hidden = [s for s in simulator.states if s not in known]
    return derived if all(_idle(simulator, log, s) for s in hidden) else None


def probe(simulator: Simulator, log: PortLog) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return instants of the log with states that all differ, to probe the structure."""
    at, rng = some_instants(log.n), np.random.RandomState(0)
    x = np.stack(
        [
            log.channels[s][at] if s in log.channels and np.ptp(log.channels[s]) > 0 else _around(simulator, s, rng, at)
            for s in simulator.states
        ]
    )
    return log.t[at], x, log.inputs(simulator)[:, at]


def _around(simulator: Simulator, state: str, rng: np.random.RandomState, at: np.ndarray) -> np.ndarray:
    start = simulator.port(state).begins
    return start + 0.1 * (abs(start) or 1.0) * rng.uniform(0.1, 1.0, len(at))


def pairs_of(simulator: Simulator, log: PortLog) -> dict[str, str]:
    """Return the positions whose rate is another state, with that state."""
    return kinematic_pairs(simulator, *probe(simulator, log))


def _idle(simulator: Simulator, log: PortLog, state: str) -> bool:
    """Return whether nothing depends on a state, such as a position that enters no force."""
    t, x, u = probe(simulator, log)
    moved, k = x.copy(), simulator.states.index(state)
    moved[k] += 0.1 * (float(np.max(np.abs(x[k]))) or 1.0)
    p = spread_numbers(simulator, len(t))
    same = np.allclose(simulator.rate(t, x, u, p), simulator.rate(t, moved, u, p), rtol=1e-12, atol=0.0)
    shown = simulator.outputs and np.allclose(simulator.output(t, x, u, p), simulator.output(t, moved, u, p))
    return bool(same and (not simulator.outputs or shown))


def roles_of(simulator: Simulator, joints: Sequence[JointPort], equation: str) -> dict[str, str]:
    """Return the signal of each name of the state, for the equation of a port."""
    found = {}
    joint = next((j for j in joints if equation in (j.name, j.velocity, j.position)), None)
    states = list(simulator.states)
    if joint is not None:
        found = {"eps": joint.position, "deps": joint.velocity}
    elif equation in states:
        found = {"eps": equation}
    elif states:
        found = {"eps": states[0]}
    used = set(found.values())
    others = [s for s in states if s not in used] + list(simulator.inputs[1:])
    if others:
        found["P"] = others[0]
    if len(others) > 1:
        found["dP"] = others[1]
    if simulator.inputs:
        found["u"] = joint.through if joint is not None and joint.through else simulator.inputs[0]
    if "eps" not in found and simulator.inputs:
        found["eps"] = simulator.inputs[0]
    return {k: v for k, v in found.items() if v}


def read_joints(simulator: Simulator, log: PortLog) -> tuple[list[JointPort], dict[str, np.ndarray]]:
    """Return the joints of a simulator of readings, and the speeds of those of which the log holds positions alone.

    Forces there are functions of what the log reads.
    """
    joints, speeds = list[JointPort](), dict[str, np.ndarray]()
    for p in simulator.ports:
        velocity = p.velocity if p.velocity in simulator.outputs else speed_name(p.name)
        if p.kind != "joint" or not p.through or not {p.position, velocity} & log.channels.keys():
            continue
        if velocity not in log.channels:
            x = log.channels[p.position]
            runs = [differentiate(x[a:b], log.t[a:b], warn=False)[1] for a, b in log.spans]
            speeds[velocity] = np.concatenate(runs)
        joints.append(JointPort(p.name, p.position, velocity, p.through, p.unit))
    return joints, speeds


def integral(v: np.ndarray, log: PortLog, starts: np.ndarray | None = None) -> np.ndarray:
    """Return the path of a speed along each run, or from each of some rows on."""
    out = np.zeros(log.n)
    for a, b in log.spans if starts is None else pairwise([*starts, log.n]):
        out[a + 1 : b] = np.cumsum(0.5 * (v[a : b - 1] + v[a + 1 : b])) * log.dt
    return out


def resting_joints(log: PortLog, joints: Sequence[JointPort], tested: set[str], n: int) -> dict[str, np.ndarray]:
    """Return the rows in which each joint that is tested rests, by its name, where it moves in enough of n samples."""
    found = {}
    codes = np.repeat(np.arange(len(log.spans)), [e - a for a, e in log.spans])
    for joint in joints:
        if joint.position in log.channels and joint.name in tested:
            x = log.channels[joint.position]
            end = end_of(x, log.spans)
            rows = resting_rows(x, log.dt, codes)
            rows = rows if end is None else rows & ~end.rows  # there the sensor stands still, not the joint
            if rows.any() and np.sum(~rows) >= LEAST_MOVING * n:
                found[joint.name] = rows
    return found
