"""Logs of the systems, with causes in them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd

from .causes import Cause, Command, Force, Number, Reading
from .plants import Plant


class Record(NamedTuple):
    """What happened, without noise: arrays over (samples, rows, runs).

    Parameters
    ----------
    x : array
        States.
    c : array
        Commands as they are logged.
    y : dict of str to array, shape (samples, runs)
        Readings.
    """

    x: np.ndarray
    c: np.ndarray
    y: dict[str, np.ndarray]


def record(plant: Plant, causes: Sequence[Cause], off: dict[str, float], rng: np.random.Generator, runs: int) -> Record:
    """Simulate runs of a system; `off` are the relative deviations of its parameters from nominal."""
    p = plant.value({k: v * (1.0 + off.get(k, 0.0)) for k, (v, _) in plant.numbers.items()})
    for cause in causes:
        if isinstance(cause, Number):
            p[cause.port] = plant.numbers[cause.port][0] * (1.0 + cause.p["a"])
    plan, x = plant.plan(rng, runs), plant.begin(rng, runs)
    forces = [c for c in causes if isinstance(c, Force)]
    rows = {c.port: plant.forces[c.port] for c in forces}
    order = {name: k for k, name in enumerate(plant.forces)}
    for cause in causes:
        cause.begin(x[rows[cause.port][0]] if cause.port in rows else x)
    h, xs, cs = plant.dt / plant.substeps, [], []
    for k in range(plant.samples):
        c = plant.command(plan, k, x)
        xs.append(x)
        cs.append(c)
        for j in range(plant.substeps):
            t = k * plant.dt + j * h
            u = c.copy()
            for cause in causes:
                if isinstance(cause, Command):
                    i = plant.inputs.index(cause.port)
                    u[i] = cause.drive(u[i], h)

            def rate(later: float, y: np.ndarray, u: np.ndarray = u, t: float = t) -> np.ndarray:
                f = np.zeros((max(len(order), 1), runs))
                for cause in forces:
                    a, b = rows[cause.port]
                    f[order[cause.port]] += cause.force(t + later, y[a], y[b])
                return plant.rates(y, u, f, p)

            a = rate(0.0, x)
            b = rate(h / 2, x + h / 2 * a)
            d = rate(h / 2, x + h / 2 * b)
            e = rate(h, x + h * d)
            x = x + h / 6 * (a + 2 * b + 2 * d + e)
            for cause in forces:
                i, v = rows[cause.port]
                cause.commit(x[i], x[v])
    X, C = np.stack(xs), np.stack(cs)
    y = {name: X[:, row] for name, (row, _) in plant.readings.items()}
    return Record(X, C, faulty(plant, causes, y))


def faulty(plant: Plant, causes: Sequence[Cause], y: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return readings as faulty sensors give them."""
    out = dict(y)
    for cause in causes:
        if isinstance(cause, Reading):
            out[cause.port] = cause.read(out[cause.port], plant.dt, y)
    return out


def log_of(plant: Plant, made: Record, rng: np.random.Generator | None) -> pd.DataFrame:
    """Return a log, with noise unless there is no generator."""
    parts = []
    for r in range(made.x.shape[2]):
        table = {"trajectory": f"run {r}", "time": np.arange(plant.samples) * plant.dt}
        table |= {name: made.c[:, k, r] for k, name in enumerate(plant.inputs)}
        for name, (_, sigma) in plant.readings.items():
            noise = sigma * rng.standard_normal(plant.samples) if rng is not None else 0.0
            table[name] = made.y[name][:, r] + noise
        parts.append(pd.DataFrame(table))
    return pd.concat(parts, ignore_index=True)
