"""Three to five effects at once: which are drawn together, what each is of the gap, and how many are named.

An effect's share of the gap is what leaving it out costs: the power of what it leaves by itself on the same bench and
motion, refitted within the tolerances, over that of what all leave together, in the equation in which that is most.
Over all equations together, in units of the noise, a single lag of a sensor is more than all others.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from .metrics import NAMING, Figure, share, spread

COUNT = 150
"""Cases of a full run."""
FEWEST, MOST = 3, 5
LEVEL = (3.0, 30.0)
"""Strengths over the floor about which the effects of a case lie, drawn uniformly in the logarithm."""
APART = 3.0
"""How many times stronger or weaker than that each may be."""
TOLD = 0.05
"""Share of the gap from which an effect has to be named, and distance within which the remainder is right."""
DECIDABLE = 5.0
"""Lead in evidence, in nats, from which an effect is decidable."""

HOME = {
    "force": (
        "coulomb_friction", "stribeck_friction", "viscous_friction", "hysteresis", "bladder_elasticity",
        "thread_extensibility", "end_cap", "creep", "force_lag", "force_bias", "force_gain", "pressure_bias",
        "pressure_gain", "pressure_lag", "length", "diameter", "braid_angle", "angle_gain",
    ),
    "flow": ("leakage", "heat_transfer", "polytropic_exponent", "dead_volume", "gas_temperature", "flow_lag"),
    "valve": (
        "valve_dead_zone", "valve_saturation", "valve_asymmetry", "valve_lag", "transport_delay", "supply_droop",
        "valve_conductance", "flow_bias",
    ),
    "joint": ("inertia", "joint_damping", "gravity", "angle_delay"),
}  # fmt: skip
"""Equation that each effect is counted to when effects are drawn over equations or within one."""


def together(rng: np.random.Generator, index: int, rivals: Sequence[tuple[str, str]]) -> dict[str, float]:
    """Draw effects and their strengths: in turn over three equations and more, and at least half within one.

    Parameters
    ----------
    rng : Generator
        Chance.
    index : int
        Number of the case; three, four and five effects take turns.
    rivals : sequence of tuple of str
        Effects known to be mistaken for each other, which are not drawn together.
    """
    count, within = FEWEST + index // 2 % (MOST - FEWEST + 1), index % 2 == 1
    home = {name: equation for equation, names in HOME.items() for name in names}
    apart = {frozenset(pair) for pair in rivals}
    while True:
        chosen = [str(n) for n in rng.choice(list(home), count, replace=False)]
        counts = sorted((sum(home[n] == e for n in chosen) for e in HOME), reverse=True)
        fits = counts[0] >= (count + 1) // 2 if within else sum(c > 0 for c in counts) >= FEWEST
        if fits and not any(frozenset((a, b)) in apart for a in chosen for b in chosen):
            break
    level = rng.uniform(*np.log(LEVEL))
    return {name: float(np.exp(level + rng.uniform(-1.0, 1.0) * np.log(APART))) for name in chosen}


Windows = Mapping[str, np.ndarray]


def power(contribution: Windows, floors: Mapping[str, float]) -> dict[str, float]:
    """Return the power of what is left in the windows of each equation, in units of the noise."""
    return {e: float(np.sum(np.square(c))) / floors[e] ** 2 for e, c in contribution.items()}


def share_of_gap(own: Windows, whole: Windows, floors: Mapping[str, float]) -> float:
    """Return an effect's share of the gap's power, in the equation in which that is most.

    Only equations count in which the gap is as large as the noise, or where there is none, all.
    """
    mine, every = power(own, floors), power(whole, floors)
    gapped = [e for e in every if every[e] >= whole[e].size] or list(every)
    return max(mine[e] / max(every[e], 1e-300) for e in gapped)


def part_of_all(own: Windows, whole: Windows, floors: Mapping[str, float]) -> float:
    """Return an effect's share of the gap's power over all equations."""
    return sum(power(own, floors).values()) / max(sum(power(whole, floors).values()), 1e-300)


# --- what came of it ------------------------------------------------------------------------------------------
Result = Mapping[str, Any]


def effects(
    results: Sequence[Result], least: float = TOLD, decidable: bool = False, of: str = "share"
) -> list[tuple[Result, str]]:
    """Return the effects of at least some share of the gap, with their cases; those that can be decided."""
    found = [(r, n) for r in results for n, e in r["key"]["effects"].items() if e[of] >= least]
    return [(r, n) for r, n in found if not decidable or (lead(r, n) or 0.0) >= DECIDABLE]


def lead(result: Result, name: str) -> float | None:
    """Return by how much a true effect can be told, in nats; None without an oracle.

    That is what its true form gains over leaving it out, the others free; and at most by how much all effects in their
    true form, or in that of the library, are ahead of the best set of the library without it.
    """
    if result.get("oracle") is None or "diagnosis" not in result or name not in result.get("oracle_each", {}):
        return None
    sets = [(set(h["effects"]), h["gain"]) for h in result["diagnosis"]["hypotheses"]]
    others = [gain for names, gain in sets if name not in names]
    every = [gain for names, gain in sets if names >= set(result["key"]["effects"])]
    ahead = max([float(result["oracle"]), *every]) - max([*others, 0.0])
    return min(float(result["oracle_each"][name]), ahead)


def named(result: Result) -> list[set[str]]:
    """Return the names of each cause that a case was given."""
    d = result.get("diagnosis")
    return [set(c["effects"]) for c in d["causes"]] if d and d["verdict"] in NAMING else []


def found(results: Sequence[Result], least: float = TOLD, decidable: bool = False, of: str = "share") -> Figure:
    """Share of effects of at least some share of the gap that are named."""
    return share(any(n in names for names in named(r)) for r, n in effects(results, least, decidable, of))


def wrong(results: Sequence[Result], sure: bool = False) -> Figure:
    """Share of named causes none of whose names is an effect of the bench; if asked, of sure ones."""
    kept = [r for r in results if not (sure and r.get("diagnosis", {}).get("with_reserve"))]
    return share(not names & set(r["key"]["effects"]) for r in kept for names in named(r))


def whole(results: Sequence[Result]) -> Figure:
    """Share of cases in which all effects of the least share are named, and nothing else."""
    flags = []
    for r in results:
        true, causes = r["key"]["effects"], named(r)
        every = all(any(n in c for c in causes) for n, e in true.items() if e["share"] >= TOLD)
        flags.append(every and all(c & set(true) for c in causes))
    return share(flags)


def _remainders(results: Sequence[Result]) -> list[float]:
    pairs = [(r["diagnosis"]["remainder"].get("share"), r.get("left")) for r in results if named(r)]
    return [abs(said - true) for said, true in pairs if said is not None and true is not None]


def remainder_right(results: Sequence[Result]) -> Figure:
    """Share of named cases whose remainder's share is within five points of what is left on unseen trajectories."""
    return share(d <= TOLD for d in _remainders(results))


def remainder_error(results: Sequence[Result]) -> Figure:
    """Median distance of the two."""
    return spread(_remainders(results), np.median)


def unknown(results: Sequence[Result]) -> Figure:
    """Share of cases that are answered with ``unknown``."""
    return share(r.get("diagnosis", {}).get("verdict") == "unknown" for r in results)


def reserved(results: Sequence[Result]) -> Figure:
    """Share of cases whose names are said with reservations."""
    return share(bool(named(r)) and bool(r["diagnosis"]["with_reserve"]) for r in results)


ROWS: tuple[tuple[str, str, Callable[[Sequence[Result]], Figure], Callable[[float], bool], str], ...] = (
    ("effects of ≥ 5 % of the gap of an equation, named", "≥ 85 %", found, lambda v: v >= 0.85, "%"),
    ("the same, decidable", "–", lambda r: found(r, decidable=True), lambda v: True, "%"),
    ("effects of ≥ 5 % of all equations together", "–", lambda r: found(r, of="part"), lambda v: True, "%"),
    ("effects of any share, decidable", "–", lambda r: found(r, 0.0, True), lambda v: True, "%"),
    ("named causes that are wrong", "≤ 5 %", wrong, lambda v: v <= 0.05, "%"),
    ("the same, of those named without reservations", "≤ 5 %", lambda r: wrong(r, True), lambda v: v <= 0.05, "%"),
    ("all effects of ≥ 5 % named, and nothing else", "–", whole, lambda v: True, "%"),
    ("remainder's share within 5 points", "–", remainder_right, lambda v: True, "%"),
    ("remainder's share, distance (median)", "≤ 5 points", remainder_error, lambda v: v <= 0.05, "p"),
    ("answered with unknown", "–", unknown, lambda v: True, "%"),
    ("named with reservations", "–", reserved, lambda v: True, "%"),
)
"""Figure, what is asked, how it is measured, whether it is met, how it is written."""


def kinds(results: Sequence[Result]) -> dict[str, list[Result]]:
    """Return the cases by how many effects they have, and by how these were drawn."""
    out: dict[str, list[Result]] = {"all": list(results)}
    for count in range(FEWEST, MOST + 1):
        out[f"{count} effects"] = [r for r in results if len(r["key"]["effects"]) == count]
    indexed = [(int(str(r["key"]["name"]).rsplit("-", 1)[1]), r) for r in results]
    out["over equations"] = [r for k, r in indexed if k % 2 == 0]
    out["within one"] = [r for k, r in indexed if k % 2 == 1]
    return out
