"""Which cases can be decided at all: how far each possible cause moves the readings, by the true systems.

Predictions begin at the true state and go on for a stretch. What a cause adds to them is taken to first order in its
size; changes of the initial state and of the parameters within their tolerances are taken out. A case is detectable if
what is left exceeds the noise by `DETECTABLE` nats, and decidable if every other cause, at its best size, leaves
`MARGIN` nats and `FORM` of it. What a gain or a parameter does is taken anew at that size: a wrong pump constant and a
gain of the pump are one and the same at any.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from .causes import Cause, Command, Force, Number, Reading, menu
from .plants import Plant
from .simulate import Record, faulty

DETECTABLE, MARGIN, FORM = 20.0, 10.0, 0.01
SUBSTEPS = 2
SIZED = ("actuator_gain", "sensor_gain", "parameter_deviation")
"""Causes whose effect is not straight in their size."""
UNDRAWN = ("actuator_bias", "actuator_backlash")
"""Causes that could be meant and are not drawn."""
SIZES = (-0.6, -0.45, -0.3, -0.2, -0.12, -0.06, -0.03, 0.03, 0.06, 0.12, 0.2, 0.3, 0.45, 0.7, 0.9)
ROUNDS = 7
"""Sizes at which they are tried, and halvings of what lies between."""


class Decision(NamedTuple):
    """What a case can show.

    Parameters
    ----------
    nats : float
        Gain in log-likelihood that the true cause brings.
    margin : float
        What the best other cause leaves of it.
    rival : str
        That cause.
    detectable, decidable : bool
        See the module.
    """

    nats: float
    margin: float
    rival: str
    detectable: bool
    decidable: bool


def hypotheses(plant: Plant, sizes: dict[str, tuple[float, float]]) -> list[Cause]:
    """Return what may be thought of, at usual sizes and over a grid of shapes."""
    found: list[Cause] = []
    for name, port in [*menu(plant), *((n, i) for n in UNDRAWN for i in plant.inputs)]:
        if port in plant.forces:
            x, v = plant.forces[port]
            F, speed, span = 0.1 * plant.sizes[port], sizes[plant.states[v]][0], sizes[plant.states[x]][1]
            base = {"a": F, "z0": span * 5e-4, "orifice": 0.5, "scale": speed, "power": 1.0}
            base["a"] = {"viscous_friction": F / speed, "quadratic_drag": F / speed**2, "leakage": F / 2.5e5}.get(
                name, F
            )
            shapes = [{"rise": 1.5, "vs": f * speed, "sharp": 1.5} for f in (0.1, 0.3, 1.0)]
            found += [Force(name, port, base | s) for s in (shapes if name.startswith("str") else [{}])]
        elif port in plant.inputs:
            deviation, span = sizes[port]
            grid = {
                "actuator_gain": [{"a": 0.05}], "actuator_bias": [{"a": 0.05 * deviation}],
                "actuator_dead_zone": [{"a": f * deviation} for f in (0.03, 0.1, 0.3)],
                "actuator_backlash": [{"a": 0.5 * f * deviation} for f in (0.03, 0.1, 0.3)],
                "actuator_saturation": [{"limit": 0.5 * span * f} for f in (0.4, 0.55, 0.7)],
            }.get(name, [{"a": f * plant.dt} for f in (1.0, 2.5, 6.0)])  # fmt: skip
            found += [Command(name, port, p) for p in grid]
        elif name == "parameter_deviation":
            found.append(Number(name, port, {"a": 0.1}))
        else:
            deviation = sizes[port][0]
            grid = {"sensor_gain": [{"a": 0.03}], "sensor_bias": [{"a": 0.05 * deviation}]}
            found += [Reading(name, port, p) for p in grid.get(name, [{"a": f * plant.dt} for f in (0.5, 1.5, 4.0)])]
    return found


def decide(
    plant: Plant, made: Record, true: Cause, sizes: dict[str, tuple[float, float]], p: dict[str, float]
) -> Decision:
    """Return what a case with one cause can show; `p` are the true parameters without it."""
    some = hypotheses(plant, sizes)
    # What the true cause does is taken at its own size, as everything else is.
    projector = _Projector(plant, made, p)
    columns = projector.effects([[true], *([h] for h in some)])
    gap = columns[0]
    nats = 0.5 * float(gap @ gap)
    best, rival = nats, "none"
    for h, d in zip(some, columns[1:], strict=True):
        power = float(d @ d)
        if (h.name, h.port) == (true.name, true.port) or not power > 0.0:
            continue
        left = 0.5 * float(gap @ gap - (gap @ d) ** 2 / power)
        if h.name in SIZED and nats > DETECTABLE:
            left = min(left, _at_its_size(projector, h, gap))
        if left < best:
            best, rival = left, f"{h.name}@{h.port}"
    detectable = nats > DETECTABLE
    return Decision(nats, best, rival, detectable, detectable and best > MARGIN + FORM * nats)


def _at_its_size(projector: _Projector, h: Cause, gap: np.ndarray) -> float:
    """Return what a cause leaves at the size that fits best: the best of a grid of both signs, and between its points.

    Runs bend so much that steps from a small size can end on the wrong side of none.
    """

    def left(size: float) -> float:
        with np.errstate(all="ignore"):  # what is off by so much may run away
            [d] = projector.effects([[type(h)(h.name, h.port, h.p | {"a": size})]])
        power = float(d @ d)
        return 0.5 * float(gap @ gap - (gap @ d) ** 2 / power) if power > 0.0 else np.inf

    found = {size: left(size) for size in SIZES}
    best = min(found, key=lambda size: found[size])
    near = sorted((*SIZES, 0.0))
    k = near.index(best)
    low, high = near[max(k - 1, 0)], near[min(k + 1, len(near) - 1)]
    for _ in range(ROUNDS):
        for size in (0.5 * (low + best), 0.5 * (best + high)):
            found[size] = left(size) if size else np.inf
        points = sorted((low, best, high, 0.5 * (low + best), 0.5 * (best + high)))
        best = min(points[1:-1], key=lambda size: found.get(size, np.inf))
        k = points.index(best)
        low, high = points[k - 1], points[k + 1]
    return min(found.values())


class _Projector:
    """Readings over stretches, in units of the noise, less what initial states and tolerances would explain."""

    def __init__(self, plant: Plant, made: Record, p: dict[str, float]) -> None:
        self.plant, self.made, self.p = plant, made, p
        n, runs = plant.samples, made.x.shape[2]
        self.length = min(plant.stretch, n)
        firsts = np.arange(0, n - self.length + 1, self.length)
        self.rows = (firsts[:, None] + np.arange(self.length)[None])[..., None].repeat(runs, 2)  # stretch, sample, run
        self.order = {name: k for k, name in enumerate(plant.forces)}
        self.clean = {name: made.x[:, row] for name, (row, _) in plant.readings.items()}
        self._prepare()

    def _stretches(self, x: np.ndarray) -> np.ndarray:
        """Return an array (samples, rows, runs) cut into (length, rows, stretches * runs)."""
        at = self.rows[:, :, 0]
        return np.moveaxis(x[at], 0, 2).reshape(self.length, x.shape[1], -1)

    def _predict(self, x0: np.ndarray, u: np.ndarray, f: np.ndarray, p: dict[str, float]) -> np.ndarray:
        plant, h = self.plant, self.plant.dt / SUBSTEPS
        out = np.empty((self.length, len(plant.readings), x0.shape[1]))
        rows = [row for row, _ in plant.readings.values()]
        x = x0
        for k in range(self.length):
            out[k] = x[rows]
            for _ in range(SUBSTEPS):
                a = plant.rates(x, u[k], f[k], p)
                b = plant.rates(x + h / 2 * a, u[k], f[k], p)
                c = plant.rates(x + h / 2 * b, u[k], f[k], p)
                d = plant.rates(x + h * c, u[k], f[k], p)
                x = x + h / 6 * (a + 2 * b + 2 * c + d)
        sigma = np.array([s for _, s in plant.readings.values()])[:, None]
        return np.clip(np.nan_to_num(out / sigma, nan=1e9), -1e9, 1e9)

    def _prepare(self) -> None:
        plant = self.plant
        self.x0 = self._stretches(self.made.x)[0]
        self.u = self._stretches(self.made.c)
        self.f = np.zeros((self.length, max(len(self.order), 1), self.x0.shape[1]))
        self.base = self._predict(self.x0, self.u, self.f, self.p)
        slopes = []
        for k in range(len(plant.states)):
            step = 1e-4 * (float(np.ptp(self.made.x[:, k])) or 1.0)
            moved = self.x0.copy()
            moved[k] += step
            slopes.append((self._predict(moved, self.u, self.f, self.p) - self.base).reshape(-1, self.x0.shape[1]))
        O = np.stack(slopes, axis=1)  # noqa: E741 - (length * readings, states, columns)
        size = np.sqrt(np.sum(O * O, axis=0, keepdims=True)) + 1e-300
        self.Q = [np.linalg.qr((O / size)[:, :, j])[0] for j in range(O.shape[2])]
        wide = []
        for name, (value, tolerance) in plant.numbers.items():
            moved = self._predict(self.x0, self.u, self.f, self.p | {name: self.p[name] + 0.1 * tolerance * value})
            wide.append(self._cleared((moved - self.base) / 0.1))
        self.T = np.stack(wide, axis=1)

    def _cleared(self, y: np.ndarray) -> np.ndarray:
        flat = y.reshape(-1, y.shape[-1]).copy()
        for j, Q in enumerate(self.Q):
            flat[:, j] -= Q @ (Q.T @ flat[:, j])
        return flat.ravel()

    def effects(self, sets: Sequence[Sequence[Cause]]) -> list[np.ndarray]:
        """Return what causes do to the readings, in noise, projected."""
        found = []
        gram = self.T.T @ self.T + np.eye(self.T.shape[1])
        for causes in sets:
            y = self._cleared(self._changed(causes))
            x = np.linalg.solve(gram, self.T.T @ y)
            # What is left, and what the deviations cost, as one vector.
            found.append(np.concatenate([y - self.T @ x, x]))
        return found

    def _changed(self, causes: Sequence[Cause]) -> np.ndarray:
        plant, made = self.plant, self.made
        [cause] = causes
        cause.begin(made.x[0, plant.forces[cause.port][0]] if cause.port in plant.forces else made.x[0])
        if isinstance(cause, Reading):
            y = faulty(plant, causes, self.clean)
            change = np.stack([(y[n] - self.clean[n]) / s for n, (_, s) in plant.readings.items()], axis=1)
            return self._stretches(change)
        if isinstance(cause, Number):
            p = self.p | {cause.port: plant.numbers[cause.port][0] * (1.0 + cause.p["a"])}
            return self._predict(self.x0, self.u, self.f, p) - self.base
        if isinstance(cause, Force):
            series = np.zeros((plant.samples, max(len(self.order), 1), made.x.shape[2]))
            i, v = plant.forces[cause.port]
            for k in range(plant.samples):
                x = made.x[k]
                series[k, self.order[cause.port]] = cause.force(k * plant.dt, x[i], x[v])
                cause.commit(x[i], x[v])
            series[:-1] = 0.5 * (series[:-1] + series[1:])
            return self._predict(self.x0, self.u, self._stretches(series), self.p) - self.base
        assert isinstance(cause, Command)
        c, h = made.c.copy(), plant.dt / plant.substeps
        k0 = plant.inputs.index(cause.port)
        for k in range(plant.samples):
            c[k, k0] = np.mean([cause.drive(made.c[k, k0], h) for _ in range(plant.substeps)], axis=0)
        return self._predict(self.x0, self._stretches(c), self.f, self.p) - self.base
