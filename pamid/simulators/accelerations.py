r"""Outputs that read an acceleration, as accelerometers do: what an effect adds to a rate, they read, too.

A simulator computes such an output from the forces that it knows, as in :math:`y = (k i - b v) / m`. The real sensor
reads those that it lacks, too. Of a load cell this is not true: hence the unit has to be that of the rate.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from itertools import pairwise

import numpy as np

from ..effects import Effect
from .base import Simulator
from .dimensions import unit_powers
from .placement import Placement
from .structure import JointPort, rate_unit

_SHAKEN = 0.1
"""Share of its size by which each signal and parameter is changed to see what an output reads."""
_SAME = 1e-9
"""Share of an output that may differ from a rate by rounding."""


def rates_read(
    simulator: Simulator, speeds: Collection[str], t: np.ndarray, x: np.ndarray, u: np.ndarray
) -> np.ndarray:
    """Return how many times outputs read the rate of a speed, whatever changes, shape (n_outputs, n_states)."""
    found = np.zeros((len(simulator.outputs), len(simulator.states)))
    units = {v: unit_powers(rate_unit(simulator, v)) for v in simulator.states if v in speeds}
    alike = [(j, v) for j, y in enumerate(simulator.outputs) for v in units
             if unit_powers(simulator.port(y).unit) == units[v]]  # fmt: skip
    if not alike or simulator.form != "ode":
        return found
    rng, p = np.random.default_rng(0), np.repeat(simulator.numbers[:, None], len(t), axis=1)
    x, u, p = (rows + _SHAKEN * np.abs(rows) * rng.standard_normal(rows.shape) for rows in (x, u, p))
    with np.errstate(all="ignore"):
        outputs, rates = simulator.output(t, x, u, p), simulator.rate(t, x, u, p)
    for j, v in alike:
        k = simulator.states.index(v)
        sound = np.isfinite(outputs[j]) & np.isfinite(rates[k])
        y, r = (row[sound] - np.mean(row[sound]) for row in (outputs[j], rates[k]))
        if not np.any(r):
            continue
        slope = float(y @ r) / float(r @ r)
        if np.any(y) and np.max(np.abs(y - slope * r)) <= _SAME * np.max(np.abs(outputs[j][sound])):
            found[j, k] = slope
    return found


def added_to_rates(
    simulator: Simulator, acting: Sequence[tuple[Placement, Effect]], joints: Sequence[JointPort], dt: float,
    starts: np.ndarray, t: np.ndarray, x: np.ndarray, u: np.ndarray, p: np.ndarray,
) -> np.ndarray:  # fmt: skip
    """Return what effects add to the rates along runs whose states are known, shape (n_states, n)."""
    plain = simulator.rate(t, x, u, p)
    spans = list(pairwise([*starts, len(t)]))
    if any(made.holds for _, made in acting):  # at rest, just as much as holds the motion
        whole = np.zeros_like(x)
        for a, b in spans:
            whole[:, a : b - 1] = np.diff(x[:, a:b]) / dt
            whole[:, b - 1] = whole[:, max(b - 2, a)]
        return whole - plain
    table = dict(zip((*simulator.states, *simulator.inputs), (*x, *u), strict=True))
    for joint in joints:
        if not joint.position:
            v = table[joint.velocity]
            table[f"{joint.name}.path"] = np.concatenate([dt * (np.cumsum(v[a:b]) - v[a]) for a, b in spans])
    pushed, added = u.copy(), np.zeros_like(x)
    for place, made in acting:
        s = place.signals(table, t)
        memory = made.trace(s, place.plant, dt * place.scales.time, starts)
        force = np.broadcast_to(np.asarray(place.force(made, s, memory), dtype=float), (len(t),))
        place.push(made, force, simulator, (t, x, u, p), pushed, added)
    return added if np.array_equal(pushed, u) else added + simulator.rate(t, x, pushed, p) - plain
