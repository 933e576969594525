"""Runs of a simulator under given inputs, with effects at its ports: what sensors would read."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..effects import Effect
from .accelerations import added_to_rates, rates_read
from .base import Simulator
from .integrate import Runner
from .placement import Placement
from .structure import JointPort, speed_name

ROUNDS = 20
"""Most runs until forces that depend on what a whole run reads agree with it."""
_BALANCED = 1e-3
"""Share of those forces that may be missing."""


def played(
    simulator: Simulator,
    t: np.ndarray,
    u: np.ndarray,
    x0: np.ndarray,
    numbers: np.ndarray,
    active: Sequence[tuple[Placement, Effect]] = (),
    joints: Sequence[JointPort] = (),
    substeps: int = 1,
) -> list[dict[str, np.ndarray]]:
    """Return the inputs, states and outputs of runs as sensors read them, without noise."""
    dt, start, many, n = float(t[1] - t[0]), np.array([0]), len(u), len(t)
    p = np.repeat(np.asarray(numbers, dtype=float)[:, None], n, axis=1)
    for place, made in active:
        if place.enters == "parameter":
            p = place.adjusted(made, p, list(simulator.parameters), np.arange(n) / max(n - 1, 1), t - t[0])
    drive = np.array(u, dtype=float)
    for place, made in active:
        if place.enters == "input" and not place.acts:
            k = simulator.inputs.index(place.at)
            drive[:, k] = [place.drive(made, one, dt, start) for one in drive[:, k]]
    with np.errstate(all="ignore"):
        if simulator.form == "ode":
            runner = Runner(simulator, dt, joints, substeps)
            times, acting = np.repeat(t[:, None], many, axis=1), [a for a in active if a[0].acts]
            starts, wide = np.repeat(x0[:, None], many, axis=1), np.repeat(p.T[:, :, None], many, axis=2)
            x = runner.states(times, starts, np.moveaxis(drive, 0, 2).swapaxes(0, 1), wide, acting)
            states = [x[:, : len(simulator.states), k].T for k in range(many)]
            found = [dict(zip(simulator.states, own, strict=True)) for own in states]
            if simulator.outputs:
                read = rates_read(simulator, {j.velocity for j in joints}, t, states[0], drive[0])
                for k, own in enumerate(states):
                    rows = simulator.output(t, own, drive[k], p)
                    if acting and np.any(read):
                        at = dt, start, t, own, drive[k], p
                        rows = rows + read @ added_to_rates(simulator, acting, joints, *at)
                    found[k] |= dict(zip(simulator.outputs, rows, strict=True))
        else:
            found = _followed(simulator, t, u, drive, x0, p, active, joints)
    for place, made in active:
        for one in found:
            for name in set(place.readings) & set(one):
                one[name] = place.reading(made, np.asarray(one[name], dtype=float), dt, start)
    return [{**dict(zip(simulator.inputs, given, strict=True)), **one} for given, one in zip(u, found, strict=True)]


def _followed(
    simulator: Simulator, t: np.ndarray, u: np.ndarray, drive: np.ndarray, x0: np.ndarray, p: np.ndarray,
    active: Sequence[tuple[Placement, Effect]], joints: Sequence[JointPort],
) -> list[dict[str, np.ndarray]]:  # fmt: skip
    """Return the outputs of a simulator of whole runs, or of one without states; forces there follow what is read."""
    dt, start, forces = float(t[1] - t[0]), np.array([0]), [a for a in active if a[0].acts]
    paths = {f"{j.name}.path": j.velocity for j in joints if not j.position}
    speeds = {j.velocity: j.position for j in joints if j.velocity == speed_name(j.name)}
    many, numbers = len(u), np.mean(p, axis=1)

    def outputs(pushed: np.ndarray) -> list[dict[str, np.ndarray]]:
        if simulator.form == "run":
            rows = simulator.runs(t, pushed, np.tile(numbers, (many, 1)), np.tile(x0, (many, 1)))
        else:
            rows = np.array([simulator.output(t, np.zeros((0, len(t))), one, p) for one in pushed])
        return [dict(zip(simulator.outputs, np.asarray(one, dtype=float), strict=True)) for one in rows]

    found = outputs(drive)
    acted, past = _Balance(drive), 0
    while forces and past < ROUNDS:
        wanted = drive.copy()
        for r, one in enumerate(found):
            signals = {**dict(zip(simulator.inputs, u[r], strict=True)), **one}
            signals |= {path: np.cumsum(signals[v]) * dt for path, v in paths.items() if v in signals}
            signals |= {v: np.gradient(signals[x], dt) for v, x in speeds.items() if x in signals}
            for place, made in forces:
                s = place.signals(signals, t)
                memory = made.trace(s, place.plant, dt * place.scales.time, start)
                k = simulator.inputs.index(place.at)
                wanted[r, k] += np.broadcast_to(place.force(made, s, memory), (len(t),))
        if acted.holds(wanted, found):
            break
        found, past = outputs(acted.step()), past + 1
    return acted.best or found


class _Balance:
    """Inputs that hold the forces which follow from their own outputs, by Anderson's acceleration, run by run."""

    def __init__(self, drive: np.ndarray) -> None:
        self.drive, self.now = drive, drive
        self.given: list[np.ndarray] = []
        self.wanted: list[np.ndarray] = []
        self.best: list[dict[str, np.ndarray]] = []
        self.misses = np.full(len(drive), np.inf)

    def holds(self, wanted: np.ndarray, found: list[dict[str, np.ndarray]]) -> bool:
        """Return whether what was given is what is wanted, and keep the outputs of each run that came nearest."""
        self.given.append(self.now)
        self.wanted.append(wanted)
        self.best = self.best or list(found)
        size = np.sqrt(np.sum((wanted - self.drive) ** 2, axis=(1, 2)))
        miss = np.sqrt(np.sum((wanted - self.now) ** 2, axis=(1, 2))) / np.where(size > 0.0, size, 1.0)
        for r in np.flatnonzero(miss < self.misses):
            self.best[r], self.misses[r] = found[r], miss[r]
        return bool(np.all(self.misses <= _BALANCED))

    def step(self) -> np.ndarray:
        """Return the inputs to try next."""
        self.now = self.wanted[-1].copy()
        for r in range(len(self.now)):
            x, g = (np.array([one[r].ravel() for one in part]) for part in (self.given, self.wanted))
            if len(x) > 1 and np.isfinite(g).all():
                f = g - x
                share = np.linalg.lstsq(np.diff(f, axis=0).T, f[-1], rcond=1e-10)[0]
                self.now[r] = (g[-1] - share @ np.diff(g, axis=0)).reshape(self.now[r].shape)
        return self.now
