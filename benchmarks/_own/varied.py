"""The practice logs as others might have recorded them: a sensor less, rows lost, and half of the library at hand."""

from __future__ import annotations

import zlib
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from benchmarks._answers import Record

from . import practice

WAYS = ("rows lost", "half of the library", "a sensor less")
LOST = 0.2
"""Share of the rows that are lost."""
line, summary = practice.line, practice.summary


def solve(name: str, way: str, seed: int) -> Record:
    """Return what is said of one folder, recorded another way."""
    from pamid.simulators import port_effects

    rng = np.random.default_rng([seed, zlib.crc32(f"{name} {way}".encode())])
    log, simulator = practice.read(practice.FOLDER[0] / name, practice.LOGS[name])
    effects: Any = "all"
    if way == "rows lost":
        log = log[rng.random(len(log)) > LOST].reset_index(drop=True)
    elif way == "a sensor less":
        there = [p.source for p in simulator.ports if p.kind in ("state", "output") and p.source in log]
        gone = there[rng.integers(len(there))] if len(there) > 1 else []  # the only one stays
        log, way = log.drop(columns=gone), f"without {gone}"
    else:
        true = practice.LOGS[name].effects
        others = [k for k in sorted(port_effects()) if k not in true]
        effects = sorted([*true, *rng.choice(others, len(others) // 2, replace=False).tolist()])
    return practice.judged(name, log, simulator, effects) | {"way": way}


def jobs(cases: int, seed: int) -> list[tuple[str, Callable[[], Record]]]:
    """Return the cases."""
    names = [name.removeprefix("practice ") for name, _ in practice.jobs(len(practice.LOGS), seed)]
    every = [(f"varied {n}, {way}", n, way) for n in names for way in WAYS]
    return [(case, partial(solve, n, way, seed)) for case, n, way in every[:cases]]
