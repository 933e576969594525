"""Right simulators whose logs were made in few steps a sample, as in games and gyms: any cause is a false alarm."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from benchmarks._answers import Record

from .logs import Recording, simulated
from .right import drawn, line, solve, summary
from .systems import SYSTEMS, System

__all__ = ["jobs", "line", "summary"]
APART = 0.1
"""Most that coarse steps may change a motion, in its own size: with coarser ones nobody would use a simulator."""
COARSE = tuple(s for s in SYSTEMS if s.euler is not None)


def coarse(system: System, rng: np.random.Generator) -> tuple[dict[str, float], dict[str, float], Recording, str]:
    """Return a case whose log is made in as few steps as follow the motion, one to eight a sample, else fine ones."""
    nominal, true, how, way = drawn(system, rng)
    method, seed = str(rng.choice(["euler", "semi-implicit"])), int(rng.integers(2**31))
    for steps in (1, 2, 4, 8):
        found = replace(how, integrator=method, steps=steps, linear=False)
        exact = replace(found, integrator="runge-kutta", steps=0)
        with np.errstate(all="ignore"):
            x, y = (simulated(system, true, h, np.random.default_rng(seed))[0] for h in (found, exact))
            size = np.sqrt(np.mean(np.square(y - np.mean(y, axis=0)), axis=(0, 2)))
            if np.all(np.sqrt(np.mean(np.square(x - y), axis=(0, 2))) < APART * size):
                return nominal, true, found, way
    return nominal, true, replace(found, steps=0), way


def jobs(cases: int, seed: int) -> list[tuple[str, Callable[[], Record]]]:
    """Return the cases."""
    return [
        (f"stepped {k:03d} {COARSE[k % len(COARSE)].name}", partial(solve, k, seed, COARSE, coarse))
        for k in range(cases)
    ]
