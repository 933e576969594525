"""Logs whose readings have noise that lasts, as filters leave it: right simulators, and those that lack one cause."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from benchmarks._answers import Record

from . import named, right
from .logs import Recording
from .systems import SYSTEMS, System

SHORTEST, LONGEST = 0.7, 30.0
"""Samples over which the noise falls to 1/e."""


def drawn(system: System, rng: np.random.Generator) -> tuple[dict[str, float], dict[str, float], Recording, str]:
    """Return a case of right simulators whose noise lasts; readings are not rounded, which would be white."""
    nominal, true, how, way = right.drawn(system, rng)
    memory = float(np.exp(rng.uniform(np.log(SHORTEST), np.log(LONGEST))))
    return nominal, true, replace(how, memory=memory, noise=min(how.noise, 1.0), step=0.0), way


def jobs(cases: int, seed: int) -> list[tuple[str, Callable[[], Record]]]:
    """Return the cases: every system in turn, right once and with a cause once."""
    found: list[tuple[str, Callable[[], Record]]] = []
    for k in range(cases):
        kind = SYSTEMS[k // 2 % len(SYSTEMS)].name
        number = k // 2
        if k % 2:
            found.append((f"coloured {k:03d} {kind}, a cause", partial(named.solve, number, seed, drawn)))
        else:
            found.append((f"coloured {k:03d} {kind}, right", partial(right.solve, number, seed, SYSTEMS, drawn)))
    return found


def line(record: Record) -> str:
    """Return a case in one line."""
    return named.line(record) if "word" in record else right.line(record)


def summary(records: list[Record]) -> list[str]:
    """Return what they come to."""
    plain = [r for r in records if "word" not in r]
    return [*right.summary(plain), *named.summary(records)] if plain else named.summary(records)
