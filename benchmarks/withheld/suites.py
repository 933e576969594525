"""The suites: which cases there are, and in which batches they are generated."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from . import several
from .catalogue import CONFUSABLE, FOREIGN, VOCABULARY
from .generator import Spec

SUITES = ("none", "single", "pairs", "off-library", "confusable", "several")
COUNTS = {"none": 600, "single": 400, "pairs": 100, "off-library": 400, "confusable": 60}
"""Cases of each suite in a full check; that of several effects is run by itself."""
DEVELOP = {"single": 120, "pairs": 40, "off-library": 120, "confusable": 20, "several": 60}
"""Cases of each suite on which trust in names is measured."""
LEARN = {"single": 250}
"""Cases whose signatures the rivals of the open set learn from."""
SHORT = {"none": 10, "single": 18, "pairs": 4, "off-library": 6, "confusable": 4}
"""Cases of each suite in a short one."""
LAYOUTS = ((5, 2600), (6, 2800), (4, 4200), (5, 3400))
"""Runs a log, and samples a run: 10,000 to 20,000 rows in all."""
FEW_RUNS = ((2, 750), (1, 3000), (3, 1500), (2, 2000))
"""The same of short logs: what is little, as many users have it."""
BATCH = 24
LOUD, QUIET = (1.0, 100.0), (0.17, 1.0)
"""Strengths over the floor, drawn uniformly in the logarithm."""


@dataclass(frozen=True)
class Batch:
    """Cases that are generated together.

    Parameters
    ----------
    name : str
        Name of the batch.
    specs : tuple of Spec
        Its cases.
    layout : tuple of int
        Runs a log, and samples a run.
    """

    name: str
    specs: tuple[Spec, ...]
    layout: tuple[int, int]


def _target(rng: np.random.Generator, loud: bool) -> float:
    lo, hi = LOUD if loud else QUIET
    return float(np.exp(rng.uniform(np.log(lo), np.log(hi))))


def _spec(suite: str, index: int, root: int) -> Spec:
    entropy = (root, SUITES.index(suite), index)
    rng = np.random.default_rng((*entropy, 0))
    muscle = str(rng.choice(["A", "B", "B", "C", "C"]))
    names = list(VOCABULARY)
    if suite == "single":
        # Every name in turn, related ones far apart, and each as often loud as quiet.
        turn, place = divmod(index, len(names))
        name = names[7 * place % len(names)]
        return Spec(suite, index, entropy, muscle, {name: _target(rng, (place + turn) % 2 == 0)})
    if suite == "pairs":
        rivals = {frozenset(pair) for pair in CONFUSABLE}
        while True:
            one, two = map(str, rng.choice(names, 2, replace=False))
            if frozenset((one, two)) not in rivals:
                break
        return Spec(suite, index, entropy, muscle, {one: _target(rng, True), two: _target(rng, True)})
    if suite == "several":
        return Spec(suite, index, entropy, muscle, several.together(rng, index, CONFUSABLE))
    if suite == "off-library":
        # Alternately a name of the vocabulary taken out of the library, and a cause foreign to it.
        if index % 2 == 0:
            name = names[(index // 2 * 7) % len(names)]
            return Spec(suite, index, entropy, muscle, {name: _target(rng, True)}, (name,))
        return Spec(suite, index, entropy, muscle, {FOREIGN[index // 2 % len(FOREIGN)]: _target(rng, True)})
    if suite == "confusable":
        pair = CONFUSABLE[index // 2 % len(CONFUSABLE)]
        return Spec(suite, index, entropy, muscle, {pair[index % 2]: _target(rng, True)}, poor=True)
    return Spec(suite, index, entropy, muscle)


def specs(suite: str, count: int, root: int) -> list[Spec]:
    """Return the cases of a suite; more of them keep those that are there already."""
    return [_spec(suite, k, root) for k in range(count)]


def batches(counts: dict[str, int], root: int, layouts: Sequence[tuple[int, int]] = LAYOUTS) -> list[Batch]:
    """Return all batches, in the order in which they are run.

    Parameters
    ----------
    counts : dict of str to int
        Cases of each suite.
    root : int
        Seed of the check.
    layouts : sequence of tuple of int
        Runs a log, and samples a run, which batches take in turns.
    """
    out: list[tuple[float, Batch]] = []
    for suite, count in counts.items():
        # Cases of one effect stand together: a batch costs what all that is in it costs. Of several at once every batch
        # has them all.
        listed = specs(suite, count, root)
        if suite != "several":
            listed.sort(key=lambda s: (sorted(s.targets), s.index))
        for k, start in enumerate(range(0, count, BATCH)):
            layout = layouts[k % len(layouts)]
            # Suites take turns, so that a check that is stopped holds a fair share of each.
            batch = Batch(f"{suite}-{k:03d}", tuple(listed[start : start + BATCH]), layout)
            out.append(((start + 0.5 * BATCH) / count, batch))
    return [batch for _, batch in sorted(out, key=lambda turn: turn[0])]
