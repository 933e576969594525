"""Cases: a system, what it has that its simulator lacks, logs, and a key that the diagnosis does not see."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from .causes import Cause, Number, drawn, foreign_menu, menu
from .decide import Decision, decide
from .plants import PLANTS, Plant
from .simulate import Record, log_of, record

RUNS = 4
DRAWS = 50
COUNTS = {"none": 17, "single": 37, "foreign": 11}
"""Cases of each suite and system."""


@dataclass(frozen=True)
class Spec:
    """Which case.

    Parameters
    ----------
    suite, plant : str
        None, single or foreign; the system.
    number, seed : int
        Its number, and the seed of the check.
    """

    suite: str
    plant: str
    number: int
    seed: int

    @property
    def name(self) -> str:
        """A name of its own."""
        return f"{self.suite}-{self.plant}-{self.number:03d}"


@dataclass
class Case:
    """A case.

    Parameters
    ----------
    spec : Spec
        Which.
    plant : Plant
        The system.
    cause : Cause or None
        What it has.
    log, future : DataFrame
        What was recorded, and runs to come, the latter without noise.
    decision : Decision or None
        What the log can show.
    """

    spec: Spec
    plant: Plant
    cause: Cause | None
    log: pd.DataFrame
    future: pd.DataFrame
    decision: Decision | None

    @property
    def key(self) -> dict[str, Any]:
        """What is true."""
        c, d = self.cause, self.decision
        return {
            "suite": self.spec.suite, "plant": self.spec.plant, "effect": c.name if c else "none",
            "port": c.port if c else "", "numbers": c.p if c else {}, "nats": d.nats if d else 0.0,
            "margin": d.margin if d else 0.0, "rival": d.rival if d else "",
            "detectable": bool(d and d.detectable), "decidable": bool(d and d.decidable),
        }  # fmt: skip


def specs(seed: int, counts: dict[str, int] | None = None) -> list[Spec]:
    """Return the cases of a check, all suites and systems mixed."""
    found = [Spec(s, p, k, seed) for s, n in (counts or COUNTS).items() for k in range(n) for p in PLANTS]
    order = np.random.default_rng(seed).permutation(len(found))
    return [found[k] for k in order]


def sizes_of(plant: Plant, base: Record) -> dict[str, tuple[float, float]]:
    """Return deviation and range of each signal of a record."""
    rows = {n: base.x[:, k] for k, n in enumerate(plant.states)} | {n: base.c[:, k] for k, n in enumerate(plant.inputs)}
    rows |= {n: base.x[:, row] for n, (row, _) in plant.readings.items()}
    return {n: (float(np.std(x)), float(np.ptp(x))) for n, x in rows.items()}


def _possible(plant: Plant, causes: list[Cause], off: dict[str, float], rng: np.random.Generator, runs: int) -> Record:
    """Return runs that stay inside the system; others are drawn anew."""
    for _ in range(DRAWS):
        with np.errstate(all="ignore"):
            made = record(plant, causes, off, rng, runs)
        if plant.inside(made.x):
            return made
    raise RuntimeError(f"{plant.name} left its room in each of {DRAWS} draws")


def make(spec: Spec) -> Case:
    """Return a case."""
    suites = ["none", "single", "foreign"]
    rng = np.random.default_rng([spec.seed, suites.index(spec.suite), list(PLANTS).index(spec.plant), spec.number])
    plant = PLANTS[spec.plant]()
    sizes = sizes_of(plant, record(plant, [], {}, rng, 2))
    off = {n: float(rng.uniform(-0.7, 0.7)) * tol for n, (_, tol) in plant.numbers.items()}
    causes: list[Cause] = []
    if spec.suite != "none":
        some = menu(plant) if spec.suite == "single" else foreign_menu(plant)
        name, port = some[rng.permutation(len(some))[0]] if spec.suite == "single" else some[spec.number % len(some)]
        causes = [drawn(name, port, plant, sizes, rng)]
    made, later = (_possible(plant, causes, off, rng, n) for n in (RUNS, 2))
    decision = None
    if causes:
        numbers = plant.value({n: v * (1.0 + off[n]) for n, (v, _) in plant.numbers.items()})
        if isinstance(causes[0], Number):
            numbers[causes[0].port] = plant.numbers[causes[0].port][0]
        decision = decide(plant, made, causes[0], sizes, numbers)
    log, future = log_of(plant, made, rng), log_of(plant, later, None)
    return Case(spec, plant, causes[0] if causes else None, log, future, decision)
