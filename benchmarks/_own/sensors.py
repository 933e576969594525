"""Cases of any simulator with and without a true reading of another signal: no right name may be lost by it."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np

from benchmarks._answers import Record, short
from benchmarks.any_simulator import generator
from benchmarks.any_simulator.nominal import simulator_of

from .ask import ask, names_of
from .shorter import captured, truth

FURTHER: dict[str, tuple[str, ...]] = {
    "servo": ("hinge_dq",), "cart": ("v", "omega"), "cylinder": ("v",), "tanks": ("h1",),
}  # fmt: skip
"""States of each system whose reading is left out and added."""
NOISE = 3e-3
"""Of an added reading, as a share of its range."""


def solve(spec: generator.Spec) -> Record:
    """Return what is named without and with the reading."""
    case, happened = captured(spec)
    if not case.key["decidable"]:
        return {"skipped": "cannot be decided"}
    plant, rng = case.plant, np.random.default_rng([spec.seed, spec.number, 11])
    further = [n for n in FURTHER[plant.name] if n != case.key["port"]]
    if not further:
        return {"skipped": "its cause is a fault of that reading"}
    fewer = case.log.drop(columns=[n for n in further if n in case.log])
    more = case.log.copy()
    for name in (n for n in further if n not in more):
        x = happened.x[:, plant.states.index(name)]
        more[name] = (x + NOISE * float(np.ptp(x)) * rng.standard_normal(x.shape)).T.ravel()
    with tempfile.TemporaryDirectory() as folder:
        simulator = simulator_of(plant, Path(folder))
        answers = {"without": ask(fewer, simulator), "with": ask(more, simulator)}
    return judged(case, answers, further)


def judged(case: generator.Case, answers: dict[str, Record], further: list[str]) -> Record:
    """Return whether the right name is lost, gained, or accompanied by others."""
    library = sorted({k for a in answers.values() for k in a["scores"]})
    true = truth(case.key, library)
    named = {w: any(names & true for names in names_of(a)) for w, a in answers.items()}
    alone = {w: named[w] and len(a["causes"]) == 1 for w, a in answers.items()}
    told = " | ".join(f"{w} {', '.join(further)}: {short(a)}" for w, a in answers.items())
    return {
        "right": named["with"] or not named["without"], "named": named, "alone": alone,
        "runs": {w: a["runs"] for w, a in answers.items()}, "took": {w: a["took"] for w, a in answers.items()},
        "said": f"{case.key['effect']}@{case.key['port']}: {told}",
    }  # fmt: skip


def jobs(cases: int, seed: int) -> list[tuple[str, Callable[[], Record]]]:
    """Return the cases: singles of the check on any simulator."""
    some = [s for s in generator.specs(seed) if s.suite == "single"][:cases]
    return [(f"sensors {s.name}", partial(solve, s)) for s in some]


def line(record: Record) -> str:
    """Return a case in one line."""
    if "skipped" in record:
        return f"skipped: {record['skipped']}"
    word = "kept" if record["named"]["with"] else "LOST" if not record["right"] else "named by neither"
    gained = ", gained" if record["named"]["with"] and not record["named"]["without"] else ""
    return f"{word}{gained} {record['said']}"


def summary(records: list[Record]) -> list[str]:
    """Return what they come to."""
    done = [r for r in records if "right" in r]
    count = lambda what, way: sum(r[what][way] for r in done)  # noqa: E731
    lost = sum(not r["right"] for r in done)
    spoilt = sum(r["alone"]["without"] and not r["alone"]["with"] for r in done)
    runs = [n for r in done for n in r["runs"].values() if n]
    return [
        *([f"whole runs of an FMU in one diagnosis: {min(runs):.0f} to {max(runs):.0f}"] if runs else []),
        f"right names lost by a further reading: {lost} of {count('named', 'without')} "
        f"({len(done)} cases that can be decided)",
        f"named {count('named', 'without')} without, {count('named', 'with')} with; "
        f"alone {count('alone', 'without')} and {count('alone', 'with')}, no longer alone {spoilt}",
    ]  # fmt: skip
